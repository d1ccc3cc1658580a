//! Harmonics of a lattice whose phases may bend.

use nalgebra::{DVector, Matrix2, Vector2};
use rustfft::num_complex::Complex64;

use crate::explain::normal::{Normal, RIDGE, Sums, amplitudes, total};
use crate::explain::scene::Scene;
use crate::spectrum::shells::shells;

/// Coefficients of cubic phases beyond a plane.
pub(crate) const CUBIC: usize = 7;

/// Damping that only keeps singular equations solvable.
const TINY: f64 = 1e-9;
/// Terms of a quadratic background.
const GROUND: usize = 6;
/// Steps of the fit of wave vectors.
const STEPS: usize = 5;
/// Bins along a line over which waves are stepped: ratios of third order are off by the rounding of phases, and so is a phase by its cube.
const STRETCH: usize = 32;
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
        powers[most as usize] = [Complex64::ONE; 2];
        let own = (0..2).map(|j| self.pair.column(j).into_owned());
        let own: Vec<Vector2<f64>> = own
            .filter(|_| most > 0)
            .chain(self.others.clone())
            .collect();
        let straight = self.bend.is_empty();
        let place = |unit: Vector2<f64>| {
            let at = unit.component_mul(&scene.half);
            if straight {
                at
            } else {
                at + self.displacement(unit)
            }
        };
        let mut stepped = vec![Stepped::default(); own.len()];
        for (i, block) in scene.block.iter().enumerate() {
            if (i % scene.columns).is_multiple_of(STRETCH) {
                let end = scene.columns - i % scene.columns;
                let ahead = &scene.block[i..][..end.min(STRETCH)];
                if ahead.iter().any(Option::is_some) {
                    let places =
                        [0.0, 1.0, 2.0, 3.0].map(|n| place(scene.unit(i) + scene.step() * n));
                    for (stepped, q) in stepped.iter_mut().zip(&own) {
                        *stepped = Stepped::new(places.map(|at| q.dot(&at)));
                    }
                }
            }
            if let Some(block) = *block {
                for (j, first) in stepped
                    .iter()
                    .take(if most > 0 { 2 } else { 0 })
                    .enumerate()
                {
                    for n in 1..=most as usize {
                        let next = powers[most as usize + n - 1][j] * first.value();
                        powers[most as usize + n][j] = next;
                        powers[most as usize - n][j] = next.conj();
                    }
                }
                for (wave, [h, k]) in waves.iter_mut().zip(indices) {
                    *wave = powers[(most + h) as usize][0] * powers[(most + k) as usize][1];
                }
                let others = &stepped[own.len() - self.others.len()..];
                for (wave, other) in waves[indices.len()..].iter_mut().zip(others) {
                    *wave = other.value();
                }
                each(i, block, scene.unit(i), &waves);
            }
            stepped.iter_mut().for_each(Stepped::step);
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
        let mut weights = self.weights(scene, indices)?;
        for _ in 0..STEPS {
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
                let fitted = row[..linear].iter().zip(weights.iter());
                let rest = scene.values[i] - fitted.map(|(a, b)| a * b).sum::<f64>();
                sums.add(0, &row, rest);
            });
            let all = amplitudes(&sums.normals()[0], TINY)?;
            let step = all.rows(linear, size - linear).into_owned();
            let part = (LONGEST_STEP / step.amax().max(1e-12)).min(1.0);
            weights += all.rows(0, linear) * part;
            let step = step * part;
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

    /// Amplitudes of cosine and sine of all waves and of a quadratic background.
    fn weights(&self, scene: &Scene, indices: &[[i32; 2]]) -> Option<DVector<f64>> {
        let n = 2 * (indices.len() + self.others.len()) + GROUND;
        let (mut sums, mut row) = (Sums::new(1, n), vec![0.0; n]);
        self.for_each(scene, indices, |i, _, unit, waves| {
            Self::row(unit, waves, &mut row);
            sums.add(0, &row, scene.values[i]);
        });
        amplitudes(&sums.normals()[0], TINY)
    }

    /// These amplitudes, and what they leave of each bin.
    pub(crate) fn rest(
        &self,
        scene: &Scene,
        indices: &[[i32; 2]],
    ) -> Option<(DVector<f64>, Vec<f64>)> {
        let weights = self.weights(scene, indices)?;
        let mut row = vec![0.0; weights.len()];
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

/// A wave along a line whose phase is a cubic polynomial: the value and its ratios of first, second and third order from bin to bin.
#[derive(Clone, Copy, Default)]
struct Stepped([Complex64; 4]);

impl Stepped {
    /// From the phases of the first four bins.
    fn new([a, b, c, d]: [f64; 4]) -> Self {
        let differences = [a, b - a, c - 2.0 * b + a, d - 3.0 * c + 3.0 * b - a];
        Self(differences.map(Complex64::cis))
    }

    fn value(&self) -> Complex64 {
        self.0[0]
    }

    fn step(&mut self) {
        let [value, first, second, third] = self.0;
        self.0 = [value * first, first * second, second * third, third];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::image::Image;

    /// Waves that are stepped along lines are those of the phases at each bin, where pixels are missing, too; products of rows are added whatever their
    /// number and order.
    #[test]
    fn waves_are_those_of_their_phases() {
        let (columns, rows) = (201, 7);
        let there = |i: usize| if i % 11 < 8 { 1.0 } else { f64::NAN };
        let values = (0..columns * rows).map(there).collect();
        let scene = Scene::of(&Image::new(rows, columns, values)).unwrap();
        let mut phases = Phases::straight(Matrix2::new(0.9, -0.2, 0.3, 0.8));
        phases.bend = (0..CUBIC)
            .map(|t| [0.7 - 0.3 * t as f64, 0.2 * t as f64])
            .collect();
        phases.others = vec![Vector2::new(0.4, -1.1)];
        let indices = shells(2);
        let (mut direct, mut value) = (Vec::new(), 0.0);
        phases.for_each(&scene, indices, |i, block, unit, waves| {
            assert_eq!(Some(block), scene.block[i]);
            let at = unit.component_mul(&scene.half) + phases.displacement(unit);
            let lattice = indices
                .iter()
                .map(|index| phases.pair * Vector2::from(index.map(f64::from)));
            let all = lattice.chain(phases.others.clone());
            let mut row = Vec::new();
            for (q, wave) in all.zip(waves) {
                assert!((Complex64::cis(q.dot(&at)) - wave).norm() < 1e-8, "{i}");
                row.extend([wave.re, wave.im]);
            }
            value += row[0] * row[5];
            direct.push(block);
        });
        assert_eq!(direct.len(), scene.block.iter().flatten().count());
        let total = total(&phases.normals(&scene, indices));
        assert!((total.gram[(0, 5)] - value).abs() < 1e-9 * value.abs().max(1.0));
        assert_eq!(total.gram, total.gram.transpose());
    }
}
