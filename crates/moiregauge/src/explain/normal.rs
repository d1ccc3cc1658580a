//! Harmonics of a lattice whose phases may bend, and their normal equations block by block.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rustfft::num_complex::Complex64;

use crate::explain::scene::{FOLDS, Scene};
use crate::numbers::widest::widest;
use crate::spectrum::shells::shells;

/// Coefficients of cubic phases beyond a plane.
pub(crate) const CUBIC: usize = 7;

/// Damping of amplitudes, relative to each diagonal element of the normal equations: separates harmonics that a few blocks cannot.
pub(crate) const RIDGE: f64 = 1e-3;
/// Damping that only keeps singular equations solvable.
const TINY: f64 = 1e-9;
/// Terms of a quadratic background.
const GROUND: usize = 6;
/// Steps of the fit of wave vectors.
const STEPS: usize = 5;
/// Largest change of a phase at the ends of the frame in one step, rad.
const LONGEST_STEP: f64 = 1.0;

/// A lattice whose two phases are a plane and polynomials of the place: `φ_j(r) = q_j·r + Σ_t c_jt P_t(u, v)` with u, v from −1 to 1.
#[derive(Clone, Debug)]
pub(crate) struct Phases {
    /// Reciprocal pair at the middle, rad per bin.
    pub(crate) pair: Matrix2<f64>,
    /// Coefficients of [`terms`] of both phases, rad.
    pub(crate) bend: Vec<[f64; 2]>,
    /// Wave vectors of non-lattice waves, rad per bin: they follow the harmonics, and bend as these do.
    pub(crate) others: Vec<Vector2<f64>>,
}

/// Values of the first `count` polynomials beyond a plane: three of second order, four of third.
fn terms(u: f64, v: f64, count: usize) -> impl Iterator<Item = f64> {
    let all = [
        u * u,
        u * v,
        v * v,
        u * u * u,
        u * u * v,
        u * v * v,
        v * v * v,
    ];
    all.into_iter().take(count)
}

/// Normal equations of amplitudes in one block.
#[derive(Clone)]
pub(crate) struct Normal {
    pub(crate) gram: DMatrix<f64>,
    pub(crate) moment: DVector<f64>,
}

impl Phases {
    pub(crate) fn straight(pair: Matrix2<f64>) -> Self {
        Self {
            pair,
            bend: Vec::new(),
            others: Vec::new(),
        }
    }

    /// Those of a lattice (reciprocal pair, rad per bin) in an image; `bends`: they may be cubic polynomials.
    pub(crate) fn shown(scene: &Scene, pair: Matrix2<f64>, bends: bool) -> Self {
        let fitted = || Self::straight(pair).fitted(scene, shells(3), CUBIC);
        let bent = if bends { fitted() } else { None };
        bent.unwrap_or_else(|| Self::straight(pair))
    }

    /// How far the bends move a place, in bins: a straight lattice has the same phases there. `unit`: the place, from −1 to 1.
    pub(crate) fn displacement(&self, unit: Vector2<f64>) -> Vector2<f64> {
        let mut bend = Vector2::zeros();
        for (term, c) in terms(unit.x, unit.y, self.bend.len()).zip(&self.bend) {
            bend += Vector2::from(*c) * term;
        }
        let inverse = self.pair.transpose().try_inverse();
        inverse.map_or(bend, |inverse| inverse * bend)
    }

    /// Values of a wave (rad per bin) with the phases that it would have if the lattice were straight.
    pub(crate) fn unbent(&self, scene: &Scene, values: &[f64], q: Vector2<f64>) -> Vec<Complex64> {
        let turn = |i| Complex64::cis(-q.dot(&self.displacement(scene.unit(i))));
        let each = values.iter().enumerate();
        match self.bend.len() {
            0 => values.iter().copied().map(Complex64::from).collect(),
            _ => each.map(|(i, value)| value * turn(i)).collect(),
        }
    }

    /// Values at the nearest bins of where they would be if the lattice were straight: to see its peaks, not to measure them.
    pub(crate) fn straightened(&self, scene: &Scene, values: &[f64]) -> Vec<f64> {
        if self.bend.is_empty() {
            return values.to_vec();
        }
        let (columns, rows) = (scene.columns, values.len() / scene.columns);
        let mut straight = vec![0.0; values.len()];
        for (i, value) in values.iter().enumerate() {
            let place = Vector2::new((i % columns) as f64, (i / columns) as f64);
            let moved = (place + self.displacement(scene.unit(i))).map(f64::round);
            let inside = |at: f64, count: usize| (0.0..count as f64).contains(&at);
            if inside(moved.x, columns) && inside(moved.y, rows) {
                straight[moved.y as usize * columns + moved.x as usize] = *value;
            }
        }
        straight
    }

    /// Calls `each(bin, block, place, waves)` with the values of `exp(i φ_h)` of the harmonics at every bin that is there.
    fn for_each(
        &self,
        scene: &Scene,
        indices: &[[i32; 2]],
        mut each: impl FnMut(usize, usize, Vector2<f64>, &[Complex64]),
    ) {
        let most = indices
            .iter()
            .flatten()
            .map(|i| i.unsigned_abs())
            .max()
            .unwrap_or(0) as i32;
        let mut waves = vec![Complex64::default(); indices.len() + self.others.len()];
        let mut powers = vec![[Complex64::default(); 2]; 2 * most as usize + 1];
        for (i, block) in scene.block.iter().enumerate() {
            let Some(block) = *block else { continue };
            let unit = scene.unit(i);
            let at = unit.component_mul(&scene.half);
            let at = match self.bend.len() {
                0 => at,
                _ => at + self.displacement(unit),
            };
            let phases = self.pair.transpose() * at;
            for j in (0..2).filter(|_| most > 0) {
                let first = Complex64::cis(phases[j]);
                powers[most as usize][j] = Complex64::new(1.0, 0.0);
                for n in 1..=most as usize {
                    let next = powers[most as usize + n - 1][j] * first;
                    powers[most as usize + n][j] = next;
                    powers[most as usize - n][j] = next.conj();
                }
            }
            for (wave, [h, k]) in waves.iter_mut().zip(indices) {
                *wave = powers[(most + h) as usize][0] * powers[(most + k) as usize][1];
            }
            for (wave, q) in waves[indices.len()..].iter_mut().zip(&self.others) {
                *wave = Complex64::cis(q.dot(&at));
            }
            each(i, block, unit, &waves);
        }
    }

    /// Normal equations of the amplitudes of cosine and sine of each wave, block by block.
    pub(crate) fn normals(&self, scene: &Scene, indices: &[[i32; 2]]) -> Vec<Normal> {
        let n = 2 * (indices.len() + self.others.len());
        let mut sums = Sums::new(Scene::blocks(), n);
        let mut row = vec![0.0; n];
        self.for_each(scene, indices, |i, block, _, waves| {
            for (pair, wave) in row.chunks_exact_mut(2).zip(waves) {
                pair.copy_from_slice(&[wave.re, wave.im]);
            }
            sums.add(block, &row, scene.values[i]);
        });
        sums.normals()
    }

    /// Fits wave vectors and `bends` coefficients of bending with amplitudes and background free (Gauss–Newton); `None` where they cannot be told
    /// apart.
    pub(crate) fn fitted(
        mut self,
        scene: &Scene,
        indices: &[[i32; 2]],
        bends: usize,
    ) -> Option<Self> {
        self.bend.resize(bends, [0.0; 2]);
        let linear = 2 * (indices.len() + self.others.len()) + GROUND;
        for _ in 0..STEPS {
            let (weights, rest) = self.rest(scene, indices)?;
            let size = linear + 2 * (2 + bends + self.others.len());
            let (mut sums, mut row) = (Sums::new(1, size), vec![0.0; size]);
            self.for_each(scene, indices, |i, _, unit, waves| {
                Self::row(unit, waves, &mut row);
                let mut slopes = [0.0; 2];
                for (j, index) in indices.iter().enumerate() {
                    let slope = weights[2 * j + 1] * row[2 * j] - weights[2 * j] * row[2 * j + 1];
                    slopes[0] += f64::from(index[0]) * slope;
                    slopes[1] += f64::from(index[1]) * slope;
                }
                let shape = [unit.x, unit.y].into_iter();
                for (t, shape) in shape.chain(terms(unit.x, unit.y, bends)).enumerate() {
                    row[linear + 2 * t] = slopes[0] * shape;
                    row[linear + 2 * t + 1] = slopes[1] * shape;
                }
                for j in 0..self.others.len() {
                    let (wave, at) = (indices.len() + j, linear + 2 * (2 + bends + j));
                    let slope = weights[2 * wave + 1] * row[2 * wave]
                        - weights[2 * wave] * row[2 * wave + 1];
                    (row[at], row[at + 1]) = (slope * unit.x, slope * unit.y);
                }
                sums.add(0, &row, rest[i]);
            });
            let step = amplitudes(&sums.normals()[0], TINY)?;
            let step = step.rows(linear, size - linear).into_owned();
            let step = &step * (LONGEST_STEP / step.amax().max(1e-12)).min(1.0);
            for j in 0..2 {
                self.pair[(0, j)] += step[j] / scene.half.x;
                self.pair[(1, j)] += step[2 + j] / scene.half.y;
                for (t, bend) in self.bend.iter_mut().enumerate() {
                    bend[j] += step[4 + 2 * t + j];
                }
            }
            for (j, other) in self.others.iter_mut().enumerate() {
                let own = step.rows(2 * (2 + bends + j), 2).into_owned();
                *other += own.component_div(&scene.half);
            }
            if step.amax() < 1e-3 {
                break;
            }
        }
        Some(self)
    }

    /// The row of the amplitudes of all waves and of a quadratic background.
    fn row(unit: Vector2<f64>, waves: &[Complex64], row: &mut [f64]) {
        for (pair, wave) in row.chunks_exact_mut(2).zip(waves) {
            pair.copy_from_slice(&[wave.re, wave.im]);
        }
        let (u, v) = (unit.x, unit.y);
        row[2 * waves.len()..2 * waves.len() + GROUND].copy_from_slice(&[
            1.0,
            u,
            v,
            u * u,
            u * v,
            v * v,
        ]);
    }

    /// Amplitudes of cosine and sine of all waves and of a quadratic background, and what they leave of each bin.
    pub(crate) fn rest(
        &self,
        scene: &Scene,
        indices: &[[i32; 2]],
    ) -> Option<(DVector<f64>, Vec<f64>)> {
        let n = 2 * (indices.len() + self.others.len()) + GROUND;
        let (mut sums, mut row) = (Sums::new(1, n), vec![0.0; n]);
        self.for_each(scene, indices, |i, _, unit, waves| {
            Self::row(unit, waves, &mut row);
            sums.add(0, &row, scene.values[i]);
        });
        let weights = amplitudes(&sums.normals()[0], TINY)?;
        let mut rest = vec![0.0; scene.values.len()];
        self.for_each(scene, indices, |i, _, unit, waves| {
            Self::row(unit, waves, &mut row);
            rest[i] = scene.values[i]
                - row
                    .iter()
                    .zip(weights.iter())
                    .map(|(a, b)| a * b)
                    .sum::<f64>();
        });
        Some((weights, rest))
    }

    /// Amplitude of each wave.
    pub(crate) fn amplitudes(normals: &[Normal]) -> Option<Vec<f64>> {
        let weights = amplitudes(&total(normals), RIDGE)?;
        Some(
            weights
                .as_slice()
                .chunks_exact(2)
                .map(|w| w[0].hypot(w[1]))
                .collect(),
        )
    }

    /// Values less the fitted waves; 0 where a bin is missing.
    pub(crate) fn residual(&self, scene: &Scene, indices: &[[i32; 2]]) -> Option<Vec<f64>> {
        let weights = amplitudes(&total(&self.normals(scene, indices)), RIDGE)?;
        let mut rest = scene.values.clone();
        self.for_each(scene, indices, |i, _, _, waves| {
            let fitted = waves
                .iter()
                .enumerate()
                .map(|(j, wave)| weights[2 * j] * wave.re + weights[2 * j + 1] * wave.im);
            rest[i] -= fitted.sum::<f64>();
        });
        Some(rest)
    }
}

/// Sums of products, block by block.
pub(crate) struct Sums {
    size: usize,
    /// Lower triangles of the Gram matrices, row by row.
    grams: Vec<Vec<f64>>,
    moments: Vec<Vec<f64>>,
}

impl Sums {
    pub(crate) fn new(blocks: usize, size: usize) -> Self {
        Self {
            size,
            grams: vec![vec![0.0; size * size]; blocks],
            moments: vec![vec![0.0; size]; blocks],
        }
    }

    /// Adds the products of a row with a value alone.
    pub(crate) fn add_moment(&mut self, block: usize, row: &[f64], value: f64) {
        let sums = self.moments[block].iter_mut().zip(row);
        sums.for_each(|(sum, a)| *sum += a * value);
    }

    /// Adds the products of a row with itself and with a value.
    pub(crate) fn add(&mut self, block: usize, row: &[f64], value: f64) {
        let n = self.size;
        self.add_moment(block, row, value);
        let gram = &mut self.grams[block];
        widest(
            #[inline(always)]
            || {
                for (i, a) in row.iter().enumerate() {
                    for (sum, b) in gram[i * n..=i * n + i].iter_mut().zip(row) {
                        *sum += a * b;
                    }
                }
            },
        );
    }

    pub(crate) fn normals(self) -> Vec<Normal> {
        let both = self.grams.into_iter().zip(self.moments);
        both.map(|(lower, moment)| {
            let mut gram = DMatrix::from_row_slice(self.size, self.size, &lower);
            gram.fill_upper_triangle_with_lower_triangle();
            let moment = DVector::from_vec(moment);
            Normal { gram, moment }
        })
        .collect()
    }
}

/// The sum over blocks.
pub(crate) fn total(normals: &[Normal]) -> Normal {
    let mut sum = normals[0].clone();
    for normal in &normals[1..] {
        sum.gram += &normal.gram;
        sum.moment += &normal.moment;
    }
    sum
}

/// Damped least squares; `None` if the normal equations are singular.
fn amplitudes(normal: &Normal, ridge: f64) -> Option<DVector<f64>> {
    let n = normal.moment.len();
    let scales = normal.gram.diagonal().map(|d| d.max(1e-300).sqrt());
    let mut gram = normal.gram.clone();
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        gram[(i, j)] /= scales[i] * scales[j];
    }
    (0..n).for_each(|i| gram[(i, i)] += ridge);
    let scaled = normal.moment.component_div(&scales);
    Some(gram.cholesky()?.solve(&scaled).component_div(&scales))
}

/// What amplitudes of the harmonics `kept` fitted to the other folds explain of each block: the drop of its sum of squares.
pub(crate) fn gains(normals: &[Normal], kept: &[usize]) -> Option<Vec<f64>> {
    let of = |normal: &Normal| Normal {
        gram: DMatrix::from_fn(kept.len(), kept.len(), |i, j| {
            normal.gram[(kept[i], kept[j])]
        }),
        moment: DVector::from_fn(kept.len(), |i, _| normal.moment[kept[i]]),
    };
    let parts: Vec<Normal> = normals.iter().map(of).collect();
    let mut found = vec![0.0; parts.len()];
    for fold in 0..FOLDS {
        let held = |b: &usize| Scene::fold(*b) == fold;
        let seen: Vec<Normal> = (0..parts.len())
            .filter(|b| !held(b))
            .map(|b| parts[b].clone())
            .collect();
        let weights = amplitudes(&total(&seen), RIDGE)?;
        for b in (0..parts.len()).filter(held) {
            found[b] =
                2.0 * weights.dot(&parts[b].moment) - weights.dot(&(&parts[b].gram * &weights));
        }
    }
    Some(found)
}
