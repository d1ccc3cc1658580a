//! Which harmonics belong to the model: those that earn their two parameters.

use nalgebra::{DMatrix, Vector2};

use crate::lattice::fit::fit_pixels::{FinalNoise, Fit, ROUNDS};
use crate::lattice::fit::frame::{Basis, STRAIGHT, wave};
use crate::lattice::fit::gram::gram;
use crate::lattice::fit::leverage::Leverage;
use crate::lattice::fit::model::look;
use crate::lattice::fit::solve;
use crate::lattice::fit::tables::Tables;
use crate::spectrum::shells::{FASTEST, FIRST_SHELL, shells};

/// A harmonic of which less than this share is left by those that are fitted cannot be told from them. Chosen by eye.
const TOLD_APART: f64 = 0.05;

impl Fit<'_> {
    /// Adds harmonics until none earns its place, drops those that lost theirs, and fits anew each
    /// time. Returns the noise that is left.
    pub(crate) fn choose(&mut self) -> Option<FinalNoise> {
        if self.sigma.is_infinite() {
            self.converge()?;
        }
        for _ in 0..ROUNDS {
            if self.mind_the_lines() || !self.settled {
                self.converge()?;
            }
            let noise = self.noise()?;
            let residual = &noise.residual;
            let new = self.earned(|p, leverage| residual.median_around(p, leverage))?;
            if new.is_empty() {
                return self.pruned(noise);
            }
            self.add(new);
            self.converge()?;
        }
        let noise = self.noise()?;
        self.pruned(noise)
    }

    fn add(&mut self, indices: Vec<[i32; 2]>) {
        for index in indices {
            self.model.basis.indices.push(index);
            self.model.waves.push([0.0; 2]);
        }
    }

    /// Δχ² of a harmonic has to exceed `2 ln N`, the price of two parameters.
    fn price(&self) -> f64 {
        2.0 * (self.frame.pixels() as f64).ln()
    }

    /// The harmonics outside the model that are sampled.
    fn outside(&self) -> Vec<[i32; 2]> {
        candidates()
            .into_iter()
            .filter(|index| !self.model.basis.indices.contains(index))
            .filter(|&index| {
                let p = wave(&self.model.pair, index).component_div(&self.frame.edge());
                p.amax().max(-p.amin()) < FASTEST
            })
            .collect()
    }

    /// The harmonics outside the model that are significant against the `noise` there.
    fn earned(
        &mut self,
        noise: impl Fn(Vector2<f64>, &Leverage) -> Option<f64>,
    ) -> Option<Vec<[i32; 2]>> {
        let outside = self.outside();
        if outside.is_empty() {
            return Some(outside);
        }
        let inside = self.model.basis.indices.len();
        let basis = Basis {
            terms: self.model.basis.terms.clone(),
            indices: [self.model.basis.indices.clone(), outside.clone()].concat(),
            orders: STRAIGHT,
        };
        // The residual has nothing left in common with what is fitted: only the rest is looked at.
        let tables = Tables::new(&self.frame, &self.model.pair, &self.model.basis.indices);
        let probed = Basis {
            terms: Vec::new(),
            indices: outside.clone(),
            orders: STRAIGHT,
        };
        let probes = Tables::new(&self.frame, &self.model.pair, &outside);
        let (frame, model, clip) = (&self.frame, &self.model, self.clip());
        let lines = &mut self.lines;
        let seen = look(frame, model, &tables, &probed, &probes, lines, clip);
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
            let Some(noise) = noise(wave(&self.model.pair, index), &leverage) else {
                continue;
            };
            let Some(amplitudes) = solve::solve(&left, &score) else {
                continue;
            };
            // Where hardly anything is left of a harmonic, it cannot be told from the others.
            let whole: DMatrix<f64> = gram.view((first, first), (2, 2)).into_owned();
            if left.trace() > TOLD_APART * whole.trace()
                && amplitudes.dot(&score) > self.price() * noise
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

/// The harmonics of the second to fifth shell, near ones first.
fn candidates() -> Vec<[i32; 2]> {
    let order = |[h, k]: [i32; 2]| h * h + h * k + k * k;
    let mut all = shells(5)[FIRST_SHELL.len()..].to_vec();
    all.sort_unstable_by_key(|index| (order(*index), *index));
    all
}
