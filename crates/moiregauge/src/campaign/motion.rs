//! How the sample moves under the tip.

use heterostrain::Estimate;
use nalgebra::{Matrix2, Vector2};

use crate::drift::drawn::DriftMonteCarlo;
use crate::drift::joint::found::TestedTerm;
use crate::drift::joint::path::DriftPath;

/// Motion of the sample in the frame of the sensors.
#[derive(Clone, Debug)]
pub struct Drift {
    /// Velocity, nm/s.
    pub velocity: Vector2<f64>,
    /// Its covariance, (nm/s)².
    pub covariance: Matrix2<f64>,
    /// Whether the user gave it (from an earlier calibration).
    pub given: bool,
    /// Quality of the fit; `None` for a given drift.
    pub fit: Option<DriftFit>,
    /// The Monte Carlo distribution; `None` for a given drift or where no draws were asked for.
    pub monte_carlo: Option<DriftMonteCarlo>,
    /// What the joint fit found beside a constant drift; `None` for other methods.
    pub joint: Option<JointTerms>,
}

/// The terms of a joint fit that earned their place, and what they came to.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct JointTerms {
    /// Whether phases link the frames.
    pub phases: bool,
    /// Change of the drift velocity, nm/s².
    pub acceleration: Option<Vector2<f64>>,
    /// Time constant of an exponential settling, s.
    pub settling_s: Option<f64>,
    /// Relative gain error of the fast axis.
    pub fast_gain: Option<Estimate>,
    /// Scatter of the positions about the fit beyond the noise of the phases, nm.
    pub instability_nm: f64,
    /// The terms that were tried, and their information criteria.
    pub tested: Vec<TestedTerm>,
}

/// How well the scans determine the drift.
#[derive(Clone, Debug)]
pub struct DriftFit {
    /// Rank of the six-parameter problem (two lattice vectors and the drift).
    pub rank: usize,
    /// Condition number of its column-scaled design matrix.
    pub condition: f64,
    /// Weighted sum of squared residuals.
    pub chi2: f64,
    /// Degrees of freedom of `chi2`.
    pub degrees_of_freedom: usize,
    /// The published estimate for comparison: approximate matrices, successive scans compared, nm/s.
    pub paper_velocity: Option<Vector2<f64>>,
}

/// When a frame was taken, and where the sample was.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Motion {
    /// Time of the middle of the frame, s from an origin that all scans share.
    pub middle: f64,
    /// The way of the sample, by the fit of all sets where there is one, otherwise by that of its set.
    pub path: DriftPath,
}
