//! The published drift estimate: four approximate matrices, successive scans compared.
//!
//! Each scan has six peaks of its autocorrelation. With the right drift they are the same, once corrected, in all
//! scans. The objective is the mean squared distance between the corrected peaks of successive scans, scan i
//! with scan i + 1. The matrices drop the drift of the slow component during a fast line, an error of
//! `D_slow/V_fast` ≈ 10⁻⁵ (2·10⁻⁴ at twenty times the drift). Its distribution is that of the minimum over draws
//! of all peaks and tip velocities (10,000 in the paper).
//!
//! What the paper leaves open, and what is done here: peaks are drawn from normal distributions along x and y,
//! each of the six by itself; where trace and retrace are used, trace is compared with the next trace and retrace
//! with the next retrace, and both sums are one objective; the drift is the mean of the draws.
//!
//! # References
//! Tran et al., arXiv:2406.08681, supplementary material (the fourth matrix, fast x and backward, is
//! not printed there).

use nalgebra::{Matrix2, Vector2};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use spmfile::LineDirection;

use crate::drift::drawn::DriftMonteCarlo;
use crate::drift::monte_carlo::distribution;
use crate::frame::axis::Axis;
use crate::numbers::interrupt;
use crate::numbers::rng::stream;

/// Draws that share one random stream: enough to make its set-up cheap, and independent of threads.
const BATCH: usize = 256;

/// One line direction of one scan as the published method sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PaperScan {
    /// The six peaks around the middle of the autocorrelation, 60° apart in order of their angle, sensor
    /// coordinates, nm; the same order in all scans.
    pub(crate) peaks: [Vector2<f64>; 6],
    /// Covariance of each of them, nm².
    pub(crate) peak_covariance: Matrix2<f64>,
    /// Slow axis.
    pub(crate) slow_axis: Axis,
    /// Signed tip velocity along the fast axis, nm/s (laboratory sense).
    pub(crate) fast_velocity: f64,
    /// Signed velocity along the slow axis, nm/s (laboratory sense; negative is "backward").
    pub(crate) slow_velocity: f64,
    /// Spread of the fast and slow velocities over the lines, nm/s.
    pub(crate) velocity_sigmas: [f64; 2],
    /// Trace or retrace: each is compared with its like.
    pub(crate) line: LineDirection,
}

impl PaperScan {
    /// The six peaks of a lattice of two vectors: these, their difference, and the opposites.
    pub(crate) fn six(basis: &Matrix2<f64>) -> [Vector2<f64>; 6] {
        let (first, second): (Vector2<f64>, Vector2<f64>) =
            (basis.column(0).into(), basis.column(1).into());
        let third = second - first;
        [first, second, third, -first, -second, -third]
    }

    /// The peaks without the drift (nm/s); `None` where the sample outruns the slow scan.
    pub(crate) fn corrected(&self, drift: &Vector2<f64>) -> Option<[Vector2<f64>; 6]> {
        let inverse = matrix(self, drift).try_inverse()?;
        Some(self.peaks.map(|peak| inverse * peak))
    }

    /// The same scan with peaks and velocities drawn from their distributions.
    #[must_use]
    pub(crate) fn drawn(&self, rng: &mut ChaCha8Rng) -> Self {
        let mut new = *self;
        for peak in &mut new.peaks {
            *peak += normal_vector(&self.peak_covariance, rng);
        }
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        new.fast_velocity += self.velocity_sigmas[0] * normal();
        new.slow_velocity += self.velocity_sigmas[1] * normal();
        new
    }
}

/// A normally distributed vector of mean zero.
pub(crate) fn normal_vector(covariance: &Matrix2<f64>, rng: &mut ChaCha8Rng) -> Vector2<f64> {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let white = Vector2::new(normal(), normal());
    covariance
        .cholesky()
        .map_or_else(Vector2::zeros, |c| c.l() * white)
}

/// The matrix that takes true to observed vectors: `r = T R`.
///
/// With signed velocities the published forward and backward matrices are one expression.
pub(crate) fn matrix(scan: &PaperScan, drift: &Vector2<f64>) -> Matrix2<f64> {
    let (vf, vs) = (scan.fast_velocity, scan.slow_velocity);
    match scan.slow_axis {
        Axis::X => {
            let fast = 1.0 + drift.y / (vf - drift.y);
            Matrix2::new(
                1.0 + drift.x / (vs - drift.x),
                0.0,
                drift.y / (vs - drift.x) * fast,
                fast,
            )
        }
        Axis::Y => {
            let fast = 1.0 + drift.x / (vf - drift.x);
            Matrix2::new(
                fast,
                drift.x / (vs - drift.y) * fast,
                0.0,
                1.0 + drift.y / (vs - drift.y),
            )
        }
    }
}

/// Mean squared distance between the corrected peaks of successive scans, nm²; scans are in order of time.
pub(crate) fn successive_objective(scans: &[PaperScan], drift: &Vector2<f64>) -> f64 {
    let Some(differences) = differences(scans, drift).filter(|d| !d.is_empty()) else {
        return f64::INFINITY;
    };
    let squares: f64 = differences.iter().map(Vector2::norm_squared).sum();
    squares / differences.len() as f64
}

/// The drift that minimises the published objective, nm/s; `None` where it has no minimum.
pub(crate) fn successive_drift(scans: &[PaperScan]) -> Option<Vector2<f64>> {
    let mut drift = Vector2::zeros();
    let scale = scans
        .iter()
        .map(|s| s.slow_velocity.abs())
        .fold(0.0, f64::max);
    for _ in 0..20 {
        let base = differences(scans, &drift)?;
        let step = 1e-5 * scale;
        let along = |axis: usize| {
            let mut moved = drift;
            moved[axis] += step;
            let changed = differences(scans, &moved)?;
            let slopes = changed.iter().zip(&base).map(|(a, b)| (a - b) / step);
            Some(slopes.collect::<Vec<_>>())
        };
        let (x, y) = (along(0)?, along(1)?);
        let dot = |a: &[Vector2<f64>], b: &[Vector2<f64>]| -> f64 {
            a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
        };
        let normal = Matrix2::new(dot(&x, &x), dot(&x, &y), dot(&x, &y), dot(&y, &y));
        let change = normal.try_inverse()? * Vector2::new(dot(&x, &base), dot(&y, &base));
        drift -= change;
        if !(drift.norm() < scale) {
            return None;
        }
        if change.norm() < 1e-9 * scale {
            break;
        }
    }
    Some(drift)
}

/// The distribution of the published drift: the minimum of the objective for each draw of peaks and tip velocities.
///
/// The loss of a draw is the root-mean-square distance of its corrected peaks between successive scans, nm.
/// `None` without draws. Draws without a minimum are left out.
pub(crate) fn successive_draws(
    scans: &[PaperScan],
    draws: usize,
    seed: u64,
    name: &str,
) -> Option<DriftMonteCarlo> {
    let batches: Vec<Vec<(Vector2<f64>, f64)>> = (0..draws.div_ceil(BATCH))
        .into_par_iter()
        .map(|batch| {
            interrupt::check();
            let mut rng = stream(seed, name, batch as u64);
            (0..BATCH.min(draws - batch * BATCH))
                .filter_map(|_| {
                    let drawn: Vec<PaperScan> = scans.iter().map(|s| s.drawn(&mut rng)).collect();
                    let drift = successive_drift(&drawn)?;
                    Some((drift, successive_objective(&drawn, &drift).sqrt()))
                })
                .collect()
        })
        .collect();
    distribution(batches.into_iter().flatten())
}

/// Corrected peaks of each scan less those of the next one with the same line direction.
fn differences(scans: &[PaperScan], drift: &Vector2<f64>) -> Option<Vec<Vector2<f64>>> {
    let corrected: Vec<_> = scans
        .iter()
        .map(|s| s.corrected(drift))
        .collect::<Option<_>>()?;
    let pairs = scans.iter().enumerate().filter_map(|(i, scan)| {
        let next = scans[i + 1..].iter().position(|s| s.line == scan.line)?;
        Some((i, i + 1 + next))
    });
    Some(
        pairs
            .flat_map(|(i, j)| (0..6).map(move |k| (i, j, k)))
            .map(|(i, j, k)| corrected[i][k] - corrected[j][k])
            .collect(),
    )
}
