//! Harmonics of a lattice whose phases may bend.

use std::array::from_fn;
use std::ops::Range;

use nalgebra::{DVector, Matrix2, Vector2};
use rustfft::num_complex::Complex64;

use crate::explain::lanes::{Lanes, STRETCH, add, product, step, take_off};
use crate::explain::normal::{Normal, RIDGE, Sums, amplitudes, total};
use crate::explain::scene::Scene;
use crate::numbers::widest::widest;
use crate::spectrum::shells::shells;

/// Coefficients of cubic phases beyond a plane.
pub(crate) const CUBIC: usize = 7;

/// Damping that only keeps singular equations solvable.
const TINY: f64 = 1e-9;
/// Terms of a quadratic background.
const GROUND: usize = 6;
/// Steps of the fit of wave vectors.
const STEPS: usize = 5;
/// Largest change of a phase at the ends of the frame in one step, rad.
const LONGEST_STEP: f64 = 1.0;
/// The fit stands still after a step of less than this, rad: the next one would be about its square.
const SMALL: f64 = 0.01;

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

    /// Calls `each(bins, columns)` for every stretch of a line with bins that are there. The first of `size` columns are cosine and sine of `φ_h` of each
    /// wave.
    fn for_each(
        &self,
        scene: &Scene,
        indices: &[[i32; 2]],
        size: usize,
        mut each: impl FnMut(Range<usize>, &mut [Lanes]),
    ) {
        let largest = indices.iter().flatten().map(|i| i.unsigned_abs() as usize);
        let most = largest.max().unwrap_or(0);
        let own = (0..2).map(|j| self.pair.column(j).into_owned());
        let own = own.filter(|_| most > 0).chain(self.others.clone());
        let own: Vec<Vector2<f64>> = own.collect();
        let place = |unit: Vector2<f64>| {
            let at = unit.component_mul(&scene.half);
            match self.bend.len() {
                0 => at,
                _ => at + self.displacement(unit),
            }
        };
        let mut columns = vec![[0.0; STRETCH]; size];
        let mut stepped = vec![[[0.0; STRETCH]; 2]; own.len()];
        // Of both waves of the pair, from 0 on.
        let mut powers = vec![[[[1.0; STRETCH], [0.0; STRETCH]]; 2]; most + 1];
        for start in (0..scene.block.len()).step_by(scene.columns) {
            for first in (start..start + scene.columns).step_by(STRETCH) {
                let bins = first..(first + STRETCH).min(start + scene.columns);
                if scene.block[bins.clone()].iter().all(Option::is_none) {
                    continue;
                }
                let unit = scene.unit(first);
                let places = [0.0, 1.0, 2.0, 3.0].map(|n| place(unit + scene.step() * n));
                for (lanes, q) in stepped.iter_mut().zip(&own) {
                    step(places.map(|at| q.dot(&at)), lanes);
                }
                widest(
                    #[inline(always)]
                    || {
                        for n in 1..=most {
                            for j in 0..2 {
                                let next = product(&powers[n - 1][j], &stepped[j], [1.0; 2]);
                                powers[n][j] = next;
                            }
                        }
                        let of_indices = columns.chunks_exact_mut(2).zip(indices);
                        for (wave, [h, k]) in of_indices {
                            let [a, b] = [h, k].map(|i| i.unsigned_abs() as usize);
                            let signs = [h, k].map(|i| f64::from(i.signum()));
                            wave.copy_from_slice(&product(&powers[a][0], &powers[b][1], signs));
                        }
                    },
                );
                let others = &stepped[own.len() - self.others.len()..];
                let of_others = columns[2 * indices.len()..].chunks_exact_mut(2);
                of_others
                    .zip(others)
                    .for_each(|(wave, other)| wave.copy_from_slice(other));
                each(bins, &mut columns);
            }
        }
    }

    /// Normal equations of the amplitudes of cosine and sine of each wave, block by block.
    pub(crate) fn normals(&self, scene: &Scene, indices: &[[i32; 2]]) -> Vec<Normal> {
        let n = 2 * (indices.len() + self.others.len());
        let mut sums = Sums::new(Scene::blocks(), n);
        self.for_each(scene, indices, n, |bins, columns| {
            add(
                &mut sums,
                scene,
                bins.clone(),
                columns,
                &scene.values[bins],
                |block| block,
            );
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
        // Without harmonics the pair stays.
        let shapes = if indices.is_empty() { 0 } else { 2 + bends };
        let size = linear + 2 * (shapes + self.others.len());
        let mut weights = self.weights(scene, indices)?;
        for _ in 0..STEPS {
            let mut sums = Sums::new(1, size);
            self.for_each(scene, indices, size, |bins, columns| {
                let places = ground(scene, bins.start, &mut columns[linear - GROUND..]);
                let (functions, slopes) = columns.split_at_mut(linear);
                let mut rest = [0.0; STRETCH];
                rest[..bins.len()].copy_from_slice(&scene.values[bins.clone()]);
                let weights = weights.as_slice();
                widest(
                    #[inline(always)]
                    || {
                        take_off(functions, weights, &mut rest);
                        let slope = |j: usize| -> Lanes {
                            let (cos, sin) = (&functions[2 * j], &functions[2 * j + 1]);
                            let (a, b) = (weights[2 * j], weights[2 * j + 1]);
                            from_fn(|t| b * cos[t] - a * sin[t])
                        };
                        let mut of_pair = [[0.0; STRETCH]; 2];
                        for (j, index) in indices.iter().enumerate() {
                            let slope = slope(j);
                            for (sums, i) in of_pair.iter_mut().zip(index) {
                                let sum = sums.iter_mut().zip(&slope);
                                sum.for_each(|(sum, slope)| *sum += f64::from(*i) * slope);
                            }
                        }
                        let times = |a: &Lanes, b: &Lanes| from_fn(|t| a[t] * b[t]);
                        let (shared, own) = slopes.split_at_mut(2 * shapes);
                        for (slopes, place) in shared.chunks_exact_mut(2).zip(&places) {
                            let each = slopes.iter_mut().zip(&of_pair);
                            each.for_each(|(slopes, of_pair)| *slopes = times(of_pair, place));
                        }
                        for (j, slopes) in own.chunks_exact_mut(2).enumerate() {
                            let slope = slope(indices.len() + j);
                            let each = slopes.iter_mut().zip(&places);
                            each.for_each(|(slopes, place)| *slopes = times(&slope, place));
                        }
                    },
                );
                add(&mut sums, scene, bins, columns, &rest, |_| 0);
            });
            let all = amplitudes(&sums.normals()[0], TINY)?;
            let step = all.rows(linear, size - linear).into_owned();
            let part = (LONGEST_STEP / step.amax().max(1e-12)).min(1.0);
            weights += all.rows(0, linear) * part;
            let step = step * part;
            for j in 0..shapes.min(2) {
                self.pair[(0, j)] += step[j] / scene.half.x;
                self.pair[(1, j)] += step[2 + j] / scene.half.y;
                for (t, bend) in self.bend.iter_mut().enumerate() {
                    bend[j] += step[4 + 2 * t + j];
                }
            }
            for (j, other) in self.others.iter_mut().enumerate() {
                let own = step.rows(2 * (shapes + j), 2).into_owned();
                *other += own.component_div(&scene.half);
            }
            if step.amax() < SMALL {
                break;
            }
        }
        Some(self)
    }

    /// Amplitudes of cosine and sine of all waves and of a quadratic background.
    fn weights(&self, scene: &Scene, indices: &[[i32; 2]]) -> Option<DVector<f64>> {
        let waves = 2 * (indices.len() + self.others.len());
        let mut sums = Sums::new(1, waves + GROUND);
        self.for_each(scene, indices, waves + GROUND, |bins, columns| {
            ground(scene, bins.start, &mut columns[waves..]);
            add(
                &mut sums,
                scene,
                bins.clone(),
                columns,
                &scene.values[bins],
                |_| 0,
            );
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
        let rest = self.without(scene, indices, weights.as_slice());
        Some((weights, rest))
    }

    /// Amplitude of each wave.
    pub(crate) fn amplitudes(normal: &Normal) -> Option<Vec<f64>> {
        let weights = amplitudes(normal, RIDGE)?;
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
        Some(self.without(scene, indices, weights.as_slice()))
    }

    /// Values less all waves and, if it has `weights`, the background; 0 where a bin is missing.
    fn without(&self, scene: &Scene, indices: &[[i32; 2]], weights: &[f64]) -> Vec<f64> {
        let waves = 2 * (indices.len() + self.others.len());
        let mut all = vec![0.0; scene.values.len()];
        self.for_each(scene, indices, weights.len(), |bins, columns| {
            if weights.len() > waves {
                ground(scene, bins.start, &mut columns[waves..]);
            }
            let mut rest = [0.0; STRETCH];
            rest[..bins.len()].copy_from_slice(&scene.values[bins.clone()]);
            widest(
                #[inline(always)]
                || take_off(columns, weights, &mut rest),
            );
            let there = bins.zip(rest).filter(|(i, _)| scene.block[*i].is_some());
            there.for_each(|(i, rest)| all[i] = rest);
        });
        all
    }
}

/// Sets the first columns to the terms of a quadratic background along a line from a bin on. Returns those of phases: a plane, and [`terms`].
fn ground(scene: &Scene, first: usize, columns: &mut [Lanes]) -> [Lanes; 2 + CUBIC] {
    let mut all = [[0.0; STRETCH]; 2 + CUBIC];
    let (start, step) = (scene.unit(first), scene.step());
    for lane in 0..STRETCH {
        let at = start + step * lane as f64;
        let shapes = [at.x, at.y].into_iter().chain(terms(at.x, at.y, CUBIC));
        all.iter_mut()
            .zip(shapes)
            .for_each(|(all, shape)| all[lane] = shape);
    }
    columns[0] = [1.0; STRETCH];
    columns[1..GROUND].copy_from_slice(&all[..GROUND - 1]);
    all
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
        let (mut seen, mut value) = (0, 0.0);
        phases.for_each(&scene, indices, 2 * (indices.len() + 1), |bins, columns| {
            for (lane, i) in bins.enumerate().filter(|(_, i)| scene.block[*i].is_some()) {
                let unit = scene.unit(i);
                let at = unit.component_mul(&scene.half) + phases.displacement(unit);
                let lattice = indices
                    .iter()
                    .map(|index| phases.pair * Vector2::from(index.map(f64::from)));
                let all = lattice.chain(phases.others.clone());
                for (q, wave) in all.zip(columns.chunks_exact(2)) {
                    let wave = Complex64::new(wave[0][lane], wave[1][lane]);
                    assert!((Complex64::cis(q.dot(&at)) - wave).norm() < 1e-8, "{i}");
                }
                value += columns[0][lane] * columns[5][lane];
                seen += 1;
            }
        });
        assert_eq!(seen, scene.block.iter().flatten().count());
        let total = total(&phases.normals(&scene, indices));
        assert!((total.gram[(0, 5)] - value).abs() < 1e-9 * value.abs().max(1.0));
        assert_eq!(total.gram, total.gram.transpose());
    }
}
