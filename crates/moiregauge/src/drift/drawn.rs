//! The distribution of a drift over Monte Carlo draws.

use nalgebra::{Matrix2, Vector2};

/// Distribution of the drift over draws of peak positions and tip velocities.
#[derive(Clone, Debug)]
pub struct DriftMonteCarlo {
    /// Drift velocity of each draw, nm/s.
    pub draws: Vec<Vector2<f64>>,
    /// Root-mean-square residual of each draw, nm.
    pub losses: Vec<f64>,
    /// Mean of the fitted Gaussian, nm/s.
    pub mean: Vector2<f64>,
    /// Covariance of the fitted Gaussian, (nm/s)².
    pub covariance: Matrix2<f64>,
}
