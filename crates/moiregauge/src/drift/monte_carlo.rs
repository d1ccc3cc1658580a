//! The distribution of the drift over draws of peak positions and tip velocities.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use crate::drift::drawn::DriftMonteCarlo;
use crate::drift::linear::{Observation, chi2, least_squares, weights};
use crate::numbers::interrupt;
use crate::numbers::rng::stream;

/// Draws that share one random stream: enough to make its set-up cheap, and independent of threads.
const BATCH: usize = 256;

/// Draws lattice vectors (by their covariance) and tip velocities (by their errors) and solves each
/// draw in closed form. `None` without draws or where the problem has no solution.
///
/// The loss of a draw is the root-mean-square distance of its vectors from the common lattice, nm.
pub fn monte_carlo(
    observations: &[Observation],
    draws: usize,
    seed: u64,
    name: &str,
) -> Option<DriftMonteCarlo> {
    if draws == 0 {
        return None;
    }
    let weights = weights(observations).ok()?;
    let factors: Vec<Matrix4<f64>> = observations
        .iter()
        .map(|o| {
            let floor = Matrix4::identity() * 1e-24;
            Some((o.lattice.covariance + floor).cholesky()?.l())
        })
        .collect::<Option<_>>()?;
    let batches: Vec<Vec<(Vector2<f64>, f64)>> = (0..draws.div_ceil(BATCH))
        .into_par_iter()
        .map(|batch| {
            interrupt::check();
            let mut rng = stream(seed, name, batch as u64);
            let mut drawn = observations.to_vec();
            let unit = vec![Matrix4::identity(); drawn.len()];
            (0..BATCH.min(draws - batch * BATCH))
                .filter_map(|_| {
                    for ((new, old), factor) in drawn.iter_mut().zip(observations).zip(&factors) {
                        perturb(new, old, factor, &mut rng);
                    }
                    let (x, _) = least_squares(&drawn, &weights)?;
                    let velocity = Vector2::new(x[4], x[5]);
                    let lattice = Vector4::new(x[0], x[1], x[2], x[3]);
                    let squares = chi2(&drawn, &unit, &lattice, &velocity);
                    Some((velocity, (squares / (2.0 * drawn.len() as f64)).sqrt()))
                })
                .collect()
        })
        .collect();
    distribution(batches.into_iter().flatten())
}

/// Mean and covariance of draws of the drift (nm/s) with their losses (nm); `None` for fewer than two.
pub(crate) fn distribution(
    drawn: impl Iterator<Item = (Vector2<f64>, f64)>,
) -> Option<DriftMonteCarlo> {
    let (draws, losses): (Vec<_>, Vec<_>) = drawn.unzip();
    if draws.len() < 2 {
        return None;
    }
    let n = draws.len() as f64;
    let mean = draws.iter().sum::<Vector2<f64>>() / n;
    let covariance = draws
        .iter()
        .map(|d| (d - mean) * (d - mean).transpose())
        .sum::<Matrix2<f64>>()
        / (n - 1.0);
    Some(DriftMonteCarlo {
        draws,
        losses,
        mean,
        covariance,
    })
}

fn perturb(new: &mut Observation, old: &Observation, factor: &Matrix4<f64>, rng: &mut ChaCha8Rng) {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let noise = Vector4::from_fn(|_, _| normal());
    let shift = factor * noise;
    new.lattice.basis = old.lattice.basis + Matrix2::new(shift[0], shift[2], shift[1], shift[3]);
    // A speed error scales the time between lines; that along the line is 10⁻⁵ of it.
    let slower = 1.0 + old.speed_error[1] * normal();
    new.time_gradient = old.time_gradient / slower;
}
