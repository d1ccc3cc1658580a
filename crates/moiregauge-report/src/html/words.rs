//! Numbers of the document in words.

use heterostrain::Estimate;
use serde::Serialize;

use crate::draw::scale::fixed;
use crate::format::plus_minus;
use crate::results::{
    BudgetResult, Conventions, LatticeVector, ResultEstimate, Results, TwistStrainResult,
};

/// Twist and strain in words: with everything where that is known, otherwise with their statistical σ.
#[derive(Debug, Serialize)]
pub(super) struct Numbers {
    twist: String,
    strain: String,
    axis: String,
    axis_lattice: String,
    lattice_angle: String,
    significant: bool,
    interval: String,
    vector: String,
}

impl Numbers {
    /// With the statistical σ alone.
    pub(super) fn statistical(result: &TwistStrainResult) -> Self {
        let alone = |e: ResultEstimate| ResultEstimate {
            sigma_total: None,
            ..e
        };
        Self::new(&TwistStrainResult {
            twist_deg: alone(result.twist_deg),
            heterostrain_percent: alone(result.heterostrain_percent),
            lattice_angle_deg: alone(result.lattice_angle_deg),
            strain_axis_lab_deg: result.strain_axis_lab_deg.map(alone),
            strain_axis_lattice_deg: result.strain_axis_lattice_deg.map(alone),
            strain_vector_sigma_total_percent: None,
            ..*result
        })
    }

    /// With everything in the budget for limits and significance, too.
    pub(super) fn in_all(result: &TwistStrainResult, budget: &BudgetResult) -> Self {
        let doubtful = budget.strain_p_value.is_none_or(|p| p >= SIGNIFICANT);
        Self::new(&TwistStrainResult {
            strain_axis_lab_deg: result.strain_axis_lab_deg.filter(|_| !doubtful),
            strain_axis_lattice_deg: result.strain_axis_lattice_deg.filter(|_| !doubtful),
            strain_p_value: budget.strain_p_value,
            strain_upper_limit_95_percent: budget.strain_upper_limit_95_percent,
            strain_interval_95_percent: budget.strain_interval_95_percent,
            ..*result
        })
    }

    pub(super) fn new(result: &TwistStrainResult) -> Self {
        let significant = result.strain_axis_lab_deg.is_some();
        let axis = |angle: Option<ResultEstimate>| {
            angle.map_or_else(
                || "not significant".to_owned(),
                |a| format!("{}°", bracketed(a)),
            )
        };
        Self {
            twist: format!("{}°", bracketed(result.twist_deg)),
            strain: if significant {
                format!("{} %", bracketed(result.heterostrain_percent))
            } else {
                let limit = plain(result.strain_upper_limit_95_percent, 4);
                let p = plain(result.strain_p_value, 2);
                format!("< {limit} % (95 %; p = {p})")
            },
            axis: axis(result.strain_axis_lab_deg),
            axis_lattice: axis(result.strain_axis_lattice_deg),
            lattice_angle: format!("{}°", bracketed(result.lattice_angle_deg)),
            significant,
            interval: interval(result.strain_interval_95_percent),
            vector: vector(result),
        }
    }
}

/// An axis with a larger p-value means nothing.
const SIGNIFICANT: f64 = 0.01;

/// What calibration and model make of the significance of a strain.
#[derive(Debug, Serialize)]
pub(super) struct Budgeted {
    p_value: String,
    /// Whether an axis that stands out of the noise stands out of everything.
    doubtful: bool,
    /// Whether the drift, left in, is missing in all of these.
    without_drift: bool,
}

impl Budgeted {
    pub(super) fn new(budget: &BudgetResult) -> Self {
        let axis = budget.strain_axis_lab_deg.as_ref();
        Self {
            p_value: plain(budget.strain_p_value, 2),
            doubtful: axis.is_some() && budget.strain_p_value.is_some_and(|p| p >= SIGNIFICANT),
            without_drift: budget.twist_deg.drift.is_none(),
        }
    }
}

/// `low to high %`.
fn interval([low, high]: [Option<f64>; 2]) -> String {
    format!("{} to {} %", plain(low, 4), plain(high, 4))
}

/// Both components with their σ.
fn vector(result: &TwistStrainResult) -> String {
    let part = |i: usize| {
        let value = result.strain_vector_percent[i].unwrap_or(f64::NAN);
        let variance = result.strain_vector_covariance[i][i].unwrap_or(f64::NAN);
        let total = result.strain_vector_sigma_total_percent.and_then(|t| t[i]);
        plus_minus(Estimate::new(value, total.unwrap_or(variance.sqrt())))
    };
    format!("({}, {}) %", part(0), part(1))
}

/// `(value ± sigma)`, to be followed by a unit.
fn bracketed(estimate: ResultEstimate) -> String {
    format!("({})", shown(estimate))
}

/// `value ± sigma`, the total one where it is known.
pub(super) fn shown(estimate: ResultEstimate) -> String {
    plus_minus(estimate.in_all())
}

/// `value ± sigma`, the statistical one.
pub(super) fn statistical(estimate: ResultEstimate) -> String {
    plus_minus(estimate.plain())
}

/// A number with `decimals` decimals, or a dash.
pub(super) fn plain(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "–".to_owned(), |v| fixed(v, decimals))
}

/// Lengths of three vectors.
pub(super) fn wavelengths(vectors: &[LatticeVector; 3]) -> [String; 3] {
    vectors.each_ref().map(|v| shown(v.wavelength_nm))
}

/// Two sets and the σ between their drifts, twists and strains.
pub(super) fn consistency(results: &Results) -> Vec<[String; 5]> {
    let pairs = results.combined.iter().flat_map(|c| &c.consistency);
    pairs
        .map(|pair| {
            let [first, second] = pair.sets.clone();
            let sigmas = [pair.drift_sigmas, pair.twist_sigmas, pair.strain_sigmas];
            let [drift, twist, strain] = sigmas.map(|s| plain(s, 1));
            [first, second, drift, twist, strain]
        })
        .collect()
}

/// Name and text of every convention.
pub(super) fn conventions(conventions: &Conventions) -> [(&'static str, &str); 15] {
    [
        ("axes", &conventions.axes),
        ("angles", &conventions.angles),
        ("lattice vectors", &conventions.lattice_vectors),
        ("coordinates", &conventions.coordinates),
        ("drift", &conventions.drift),
        ("strain", &conventions.strain),
        ("layers", &conventions.layers),
        ("strained layer", &conventions.strained_layer),
        ("strain axis", &conventions.strain_axis),
        ("strain vector", &conventions.strain_vector),
        ("heterostrain", &conventions.heterostrain),
        ("twist", &conventions.twist),
        ("strain tensor", &conventions.strain_tensor),
        ("σ", &conventions.sigma),
        ("budget", &conventions.budget),
    ]
}
