//! Which harmonics belong to the model: those that earn their two parameters.

use nalgebra::DMatrix;

use super::frame::{Basis, wave};
use super::gram::gram;
use super::model::{Clip, Tables, look};
use super::noise::{Leverage, ResidualNoise};
use super::{FinalNoise, Fit, ROUNDS, solve};
use crate::lattice::harmonics::{Harmonic, Harmonics};

/// The three that make the lattice; always in.
pub(super) const FIRST_SHELL: [[i32; 2]; 3] = [[1, 0], [0, 1], [-1, 1]];
/// |h|² of the last of the five shells.
const LAST_SHELL: i32 = 9;
/// On frames with more pixels, which have many periods, harmonics that do not show in the transform
/// of the residual are not looked at more closely.
const MANY_PIXELS: usize = 100_000;
/// Largest wave vector, as a share of the Nyquist frequency.
const HIGHEST: f64 = 0.9;

/// What the fit starts with: the first shell, and of the others what the spectrum shows clearly.
/// `None` where the first shell is not complete (one of it beyond the Nyquist frequency).
pub(super) fn at_first(start: &Harmonics, pixels: usize) -> Option<Vec<([i32; 2], &Harmonic)>> {
    let inverse = start.pair.try_inverse()?;
    let price = (pixels as f64).ln();
    let found = start.list.iter().map(|harmonic| {
        let index = (inverse * harmonic.q).map(|n| n.round() as i32);
        ([index.x, index.y], harmonic)
    });
    let chosen: Vec<_> = found
        .filter(|(index, harmonic)| {
            FIRST_SHELL.contains(index) || harmonic.significance(start.window_sums) > price
        })
        .collect();
    let first = chosen.iter().map(|(index, _)| *index).take(3);
    first.eq(FIRST_SHELL).then_some(chosen)
}

impl Fit<'_> {
    /// Adds harmonics until none earns its place, drops those that lost theirs, and fits anew each
    /// time. Returns the noise that is left.
    pub(super) fn choose(&mut self) -> Option<FinalNoise> {
        for _ in 0..ROUNDS {
            if self.mind_the_lines() {
                self.converge()?;
            }
            let noise = self.noise()?;
            let new = self.earned(&noise.residual)?;
            if new.is_empty() {
                return self.pruned(noise);
            }
            for index in new {
                self.model.basis.indices.push(index);
                self.model.waves.push([0.0; 2]);
            }
            self.converge()?;
        }
        let noise = self.noise()?;
        self.pruned(noise)
    }

    /// Δχ² of a harmonic has to exceed `2 ln N`, the price of two parameters.
    fn price(&self) -> f64 {
        2.0 * (self.frame.pixels() as f64).ln()
    }

    /// The harmonics outside the model that are significant in the residual.
    fn earned(&mut self, residual: &ResidualNoise) -> Option<Vec<[i32; 2]>> {
        let outside: Vec<[i32; 2]> = candidates()
            .into_iter()
            .filter(|index| !self.model.basis.indices.contains(index))
            .filter(|&index| {
                let p = wave(&self.model.pair, index).component_div(&self.frame.edge());
                p.amax().max(-p.amin()) < HIGHEST * std::f64::consts::PI
            })
            .filter(|&index| {
                self.frame.pixels() < MANY_PIXELS
                    || residual.is_promising(wave(&self.model.pair, index))
            })
            .collect();
        if outside.is_empty() {
            return Some(outside);
        }
        let inside = self.model.basis.indices.len();
        let basis = Basis {
            terms: self.model.basis.terms.clone(),
            indices: [self.model.basis.indices.clone(), outside.clone()].concat(),
        };
        // The residual has nothing left in common with what is fitted: only the rest is looked at.
        let tables = Tables::new(&self.frame, &self.model.pair, &self.model.basis.indices);
        let probed = Basis {
            terms: Vec::new(),
            indices: outside.clone(),
        };
        let probes = Tables::new(&self.frame, &self.model.pair, &outside);
        let (frame, clip) = (&self.frame, Clip::at(self.sigma));
        let probes = (&probed, &probes);
        let seen = look(frame, &self.model, &tables, probes, &mut self.lines, clip);
        let gram = gram(frame, &basis, &self.model.pair, &self.lines.lambda);
        let map = solve::contraction(&self.model, |_, _| 1.0).resize_vertically(basis.len(), 0.0);
        let normal = map.transpose() * &gram * &map;
        let known = solve::inverse(&normal)?;
        let leverage = Leverage::new(&self.frame, &self.model, &normal)?;
        let mut earned = Vec::new();
        for (i, &index) in outside.iter().enumerate() {
            let first = basis.cosine(inside + i);
            let cross = map.transpose() * gram.columns(first, 2);
            // What the fitted functions leave of the pair (cos, sin).
            let left = gram.view((first, first), (2, 2)) - cross.transpose() * &known * &cross;
            let score = seen.gradient.rows(probed.cosine(i), 2).into_owned();
            let Some(noise) = residual.median_around(wave(&self.model.pair, index), &leverage)
            else {
                continue;
            };
            let Some(amplitudes) = solve::solve(&left, &score) else {
                continue;
            };
            // Where hardly anything is left of a harmonic, it cannot be told from the others.
            let whole: DMatrix<f64> = gram.view((first, first), (2, 2)).into_owned();
            if left.trace() > 0.05 * whole.trace() && amplitudes.dot(&score) > self.price() * noise
            {
                earned.push(index);
            }
        }
        Some(earned)
    }

    /// Drops the harmonics that are no longer significant beside the others.
    fn pruned(&mut self, noise: FinalNoise) -> Option<FinalNoise> {
        let quarter = 0.25 * self.frame.pixels() as f64;
        let price = 0.5 * self.price();
        let keeps: Vec<bool> = (0..self.model.waves.len())
            .map(|i| {
                let [alpha, beta] = self.model.waves[i];
                let power = quarter * (alpha * alpha + beta * beta);
                let local = 0.5 * (noise.local[i][0] + noise.local[i][1]);
                i < FIRST_SHELL.len() || power > price * local
            })
            .collect();
        if keeps.iter().all(|k| *k) {
            return Some(noise);
        }
        let mut keep = keeps.iter();
        self.model
            .basis
            .indices
            .retain(|_| *keep.next().unwrap_or(&true));
        let mut keep = keeps.iter();
        self.model.waves.retain(|_| *keep.next().unwrap_or(&true));
        self.converge()?;
        self.noise()
    }
}

/// The harmonics of the second to fifth shell, one of each ± pair, near ones first.
fn candidates() -> Vec<[i32; 2]> {
    let mut all: Vec<(i32, [i32; 2])> = Vec::new();
    for k in 0..=3 {
        for h in -3..=3 {
            // The pair stands at 60°, so |h q₁ + k q₂|² is h² + hk + k² in units of |q|².
            let order = h * h + h * k + k * k;
            if (k > 0 || h > 0) && (2..=LAST_SHELL).contains(&order) {
                all.push((order, [h, k]));
            }
        }
    }
    all.sort_unstable();
    all.into_iter().map(|(_, index)| index).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hexagonal lattice has 3 + 3 + 3 + 6 + 3 pairs of harmonics in its first five shells.
    #[test]
    fn five_shells_have_eighteen_pairs() {
        let rest = candidates();
        assert_eq!(rest.len(), 15);
        for [h, k] in &rest {
            assert!(!rest.contains(&[-h, -k]));
        }
    }
}
