//! What the scans themselves say of the errors: residuals, leave-one-out, bootstrap.

use moiregauge::campaign::{Checks, Residual, Scatter};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::convert::{PER_MINUTE, PERCENT, degree, number, pair};

/// Errors from the scatter of the scans, to compare with the stated σ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChecksResult {
    /// From leaving out one scan at a time (jackknife).
    pub leave_one_out: Option<ScatterResult>,
    /// From a bootstrap over pairs of up and down scans.
    pub bootstrap: Option<ScatterResult>,
}

/// One standard deviation of each quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScatterResult {
    /// Of the drift, x and y.
    pub drift_nm_per_min: [Option<f64>; 2],
    /// Of the twist.
    pub twist_deg: Option<f64>,
    /// Of the components of the strain vector.
    pub strain_vector_percent: [Option<f64>; 2],
}

/// How a scan lies against the fit of all others of its set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ResidualResult {
    /// χ² of its wave vectors and phases against what the others predict.
    pub chi2: Option<f64>,
    /// Degrees of freedom of `chi2`.
    pub degrees_of_freedom: usize,
    /// Probability of so large a χ² by chance, relative to that of the other scans if this exceeds 1.
    pub p_value: Option<f64>,
    /// Distance of the lattice from the place that the other scans predict, x and y; `null` without linked phases.
    pub displacement_nm: Option<[Option<f64>; 2]>,
    /// Whether it stands out: `p_value` < 0.001 divided by the number of scans.
    pub outlying: bool,
}

impl From<&Checks> for ChecksResult {
    fn from(checks: &Checks) -> Self {
        Self {
            leave_one_out: checks.leave_one_out.as_ref().map(Into::into),
            bootstrap: checks.bootstrap.as_ref().map(Into::into),
        }
    }
}

impl From<&Scatter> for ScatterResult {
    fn from(scatter: &Scatter) -> Self {
        Self {
            drift_nm_per_min: scatter.drift.map(|d| number(d * PER_MINUTE)),
            twist_deg: number(scatter.twist * degree()),
            strain_vector_percent: scatter.strain.map(|s| number(s * PERCENT)),
        }
    }
}

impl From<&Residual> for ResidualResult {
    fn from(residual: &Residual) -> Self {
        Self {
            chi2: number(residual.chi2),
            degrees_of_freedom: residual.degrees_of_freedom,
            p_value: number(residual.p_value),
            displacement_nm: residual.displacement.map(|d| pair(d, 1.0)),
            outlying: residual.outlying,
        }
    }
}
