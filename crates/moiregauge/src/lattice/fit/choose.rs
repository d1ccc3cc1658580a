//! Which harmonics belong to the model: those that earn their two parameters.

use nalgebra::{DMatrix, Vector2};

use crate::lattice::fit::fit_pixels::{FinalNoise, Fit, ROUNDS};
use crate::lattice::fit::frame::{Basis, STRAIGHT, wave};
use crate::lattice::fit::gram::gram;
use crate::lattice::fit::leverage::Leverage;
use crate::lattice::fit::model::look;
use crate::lattice::fit::solve;
use crate::lattice::fit::tables::Tables;
use crate::spectrum::harmonics::Harmonics;
use crate::spectrum::shells::{FIRST_SHELL, shells};

/// A harmonic of which less than this share is left by those that are fitted cannot be told from them. Chosen by eye.
const TOLD_APART: f64 = 0.05;
/// A sketch of a larger share of the lines saves nothing. Chosen by eye.
const WORTH_A_SKETCH: f64 = 0.3;
/// Frames with more pixels have many periods. Chosen by eye.
const MANY_PIXELS: usize = 100_000;
/// Lines of a sketch: few enough to cost little. Chosen by eye.
const SKETCHED: usize = 64;
/// Power over noise of the weakest first harmonic in the lines of a sketch, at least: three times what a lattice
/// needs to be found.
const SKETCHABLE: f64 = 60.0;
/// Multiples of it are spread evenly, modulo 1: the golden ratio.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// Largest wave vector, as a share of the Nyquist frequency. Chosen by eye.
const HIGHEST: f64 = 0.9;

impl Fit<'_> {
    /// Whether a few lines of the image are enough to get near the end.
    pub(crate) fn worth_a_sketch(&self, start: &Harmonics) -> bool {
        let share = SKETCHED as f64 / self.frame.lines().max(1) as f64;
        let first = start.list.iter().take(FIRST_SHELL.len());
        let weakest = first
            .map(|harmonic| harmonic.significance(start.window_sums))
            .fold(f64::INFINITY, f64::min);
        share < WORTH_A_SKETCH && share * weakest > SKETCHABLE
    }

    /// Fits to one line of each of a few stripes. Ends near enough to the lattice of all lines for
    /// one step.
    pub(crate) fn sketch(&mut self) -> Option<()> {
        let whole = self.frame.clone();
        let count: Vec<usize> = (0..whole.image.rows)
            .filter(|&r| whole.present[r] > 0)
            .collect();
        let stripe = count.len() as f64 / SKETCHED as f64;
        // At irregular places, lest waves look like others.
        let places = (0..SKETCHED).map(|i| {
            let within = (i as f64 * GOLDEN).fract();
            count[((i as f64 + within) * stripe) as usize]
        });
        let mut picked = vec![false; whole.image.rows];
        for row in places {
            picked[row] = true;
        }
        self.frame.leave_out(|row| !picked[row]);
        self.converge()?;
        if self.mind_the_lines() {
            self.converge()?;
        }
        let sigma = self.sigma;
        let new = self.earned(|_| true, |_, _| Some(sigma * sigma))?;
        if !new.is_empty() {
            self.add(new);
            self.converge()?;
        }
        self.frame = whole;
        self.settled = false;
        Some(())
    }

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
            // On large frames, which have many periods, what does not show in the transform of the
            // residual is not looked at more closely.
            let all = self.frame.pixels() < MANY_PIXELS;
            let residual = &noise.residual;
            let new = self.earned(
                |p| all || residual.is_promising(p),
                |p, leverage| residual.median_around(p, leverage),
            )?;
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

    /// The harmonics outside the model that are `promising` by their wave vector (phase at the edges).
    fn outside(&self, promising: impl Fn(Vector2<f64>) -> bool) -> Vec<[i32; 2]> {
        candidates()
            .into_iter()
            .filter(|index| !self.model.basis.indices.contains(index))
            .filter(|&index| {
                let p = wave(&self.model.pair, index).component_div(&self.frame.edge());
                p.amax().max(-p.amin()) < HIGHEST * std::f64::consts::PI
            })
            .filter(|&index| promising(wave(&self.model.pair, index)))
            .collect()
    }

    /// The harmonics outside the model that are `promising` by their wave vector (phase at the edges)
    /// and significant against the `noise` there.
    fn earned(
        &mut self,
        promising: impl Fn(Vector2<f64>) -> bool,
        noise: impl Fn(Vector2<f64>, &Leverage) -> Option<f64>,
    ) -> Option<Vec<[i32; 2]>> {
        let outside = self.outside(promising);
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
