//! Means of scans and of sets.

use heterostrain::TotalEstimate;
use heterostrain::lattice::Lattice;
use heterostrain::strain::TwistStrain;
use nalgebra::Vector2;

use crate::campaign::motion::{Drift, JointTerms};
use crate::caveat::drifting::AssumedDrift;
use crate::drift::joint::path::DriftPath;
use crate::meaning::budget::Budget;
use crate::meaning::readings::Readings;

/// One lattice for several scans.
#[derive(Clone, Debug)]
pub struct SetMean {
    /// Lattice vectors, nm.
    pub lattice: Lattice,
    /// Twist and strain of that lattice.
    pub twist_strain: TwistStrain,
    /// What contributes to their uncertainty, calibration and model included.
    pub budget: Budget,
    /// The drift that was assumed where the scans do not tell it; `None` where it was measured or given.
    pub assumed: Option<AssumedDrift>,
    /// What else the lattice can mean.
    pub readings: Readings,
    /// Standard deviation of the twist over the scans, rad; NaN for a single scan.
    pub twist_scatter: f64,
    /// Root-mean-square deviation per component of the strain vector over the scans; NaN for one scan.
    pub strain_scatter: f64,
    /// χ² per degree of freedom of the scans against the common lattice; `None` for one image, which has nothing to differ from.
    pub chi2_per_dof: Option<f64>,
    /// Factor by which all variances were enlarged for that scatter; 1 where it is not significant.
    pub enlargement: f64,
    /// Whether each scan's wavelengths lie within ±1 % of the common ones.
    pub within_one_percent: bool,
}

/// All sets taken together.
#[derive(Clone, Debug)]
pub struct Combined {
    /// Weighted mean lattice, nm.
    pub lattice: Lattice,
    /// Its twist and strain.
    pub twist_strain: TwistStrain,
    /// What contributes to their uncertainty, calibration and model included.
    pub budget: Budget,
    /// What else the lattice can mean.
    pub readings: Readings,
    /// Whether one joint fit over all scans made them, and with which terms.
    pub joint: Option<JointTerms>,
    /// The drift in the middle of the campaign, where one joint fit over all scans describes it.
    pub drift: Option<Drift>,
    /// The way of the sample by the fit over all scans, where that made them.
    pub path: Option<DriftPath>,
    /// What the scans themselves say of the errors.
    pub checks: Option<Checks>,
    /// How far every two sets are apart.
    pub consistency: Vec<Consistency>,
}

/// How many standard deviations lie between two sets.
#[derive(Clone, Debug)]
pub struct Consistency {
    /// Names of the two sets.
    pub sets: [String; 2],
    /// Difference of the drift velocities: square root of χ² for two components; `None` where unknown.
    pub drift_sigmas: Option<f64>,
    /// Difference of the twist angles in units of its σ.
    pub twist_sigmas: f64,
    /// Difference of the strain vectors: square root of χ² for two components.
    pub strain_sigmas: f64,
}

/// The lattice of all scans of a set that no twist and strain explain: of atoms, of a surface, of other layers.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SetLattice {
    /// Lattice vectors, nm, corrected for drift where the set has one.
    pub lattice: Lattice,
    /// The drift that was assumed where the scans do not tell it; `None` where it was measured or given.
    pub assumed: Option<AssumedDrift>,
    /// Lengths of L₁, L₂ and L₃ with their statistical and total uncertainties, nm.
    pub wavelengths: [TotalEstimate; 3],
    /// The total of the first length without the drift, nm.
    pub without_drift: f64,
    /// Standard deviations of the three lengths over the scans, nm; NaN for one scan.
    pub scatter: [f64; 3],
    /// χ² per degree of freedom of the scans against this lattice; `None` for one image.
    pub chi2_per_dof: Option<f64>,
}

/// Errors from the scatter of the scans, to compare with those that are stated.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Checks {
    /// From leaving out one scan at a time (jackknife); `None` for fewer than four scans.
    pub leave_one_out: Option<Scatter>,
    /// From a bootstrap over pairs of up and down scans; `None` for fewer than four pairs.
    pub bootstrap: Option<Scatter>,
}

/// One standard deviation of each quantity.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Scatter {
    /// Drift velocity along x and y, nm/s.
    pub drift: [f64; 2],
    /// θ, rad.
    pub twist: f64,
    /// Components of the strain vector.
    pub strain: [f64; 2],
}

/// How a scan lies against the fit of all others of its set.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Residual {
    /// χ² of its wave vectors and phases against what the others predict.
    pub chi2: f64,
    /// Degrees of freedom of `chi2`.
    pub degrees_of_freedom: usize,
    /// Probability of so large a χ² by chance, relative to that of the other scans if this exceeds 1.
    pub p_value: f64,
    /// Where the scan stands from where the others have it, nm; `None` without linked phases.
    pub displacement: Option<Vector2<f64>>,
    /// Whether it stands out: p < 0.001 divided by the number of scans.
    pub outlying: bool,
}
