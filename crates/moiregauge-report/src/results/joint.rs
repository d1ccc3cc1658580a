//! What a joint fit has beside the lattice and a constant drift.

use moiregauge::campaign::JointTerms;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::convert::{estimate, number, pair};
use super::estimate::ResultEstimate;

/// nm/s² → nm/min².
const PER_MINUTE2: f64 = 3600.0;

/// Terms of a joint fit; those that are `null` were not used, by the information criterion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JointResult {
    /// Whether phases link the frames, which tightens the drift by an order of magnitude.
    pub phases_linked: bool,
    /// Change of the drift velocity, x and y.
    pub acceleration_nm_per_min2: Option<[Option<f64>; 2]>,
    /// Time constant of an exponential settling, min.
    pub settling_min: Option<f64>,
    /// Gain error of the fast axis.
    pub fast_gain_percent: Option<ResultEstimate>,
    /// Scatter of the positions beyond the noise of the phases.
    pub position_instability_pm: Option<f64>,
    /// The terms that were tried beside a constant drift.
    pub tested: Vec<TestedResult>,
}

/// A term that was tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TestedResult {
    /// `acceleration`, `settling` or `fast-axis gain`.
    pub term: String,
    /// By how much it lowers the Bayesian information criterion; below 0 the term is not used.
    pub criterion_gain: Option<f64>,
    /// Whether the fit has it.
    pub used: bool,
}

impl From<&JointTerms> for JointResult {
    fn from(terms: &JointTerms) -> Self {
        Self {
            phases_linked: terms.phases,
            acceleration_nm_per_min2: terms.acceleration.map(|a| pair(a, PER_MINUTE2)),
            settling_min: terms.settling_s.and_then(|s| number(s / 60.0)),
            fast_gain_percent: terms.fast_gain.map(|g| estimate(g, 100.0)),
            position_instability_pm: number(terms.instability_nm * 1000.0).filter(|_| terms.phases),
            tested: terms
                .tested
                .iter()
                .map(|t| TestedResult {
                    term: t.name.to_owned(),
                    criterion_gain: number(t.gain),
                    used: t.used,
                })
                .collect(),
        }
    }
}
