//! Numbers of the document in words.

use serde::Serialize;

use crate::draw::scale::fixed;
use crate::format::plus_minus;
use crate::results::{Conventions, LatticeVector, ResultEstimate, Results, TwistStrainResult};

/// Twist and strain in words.
#[derive(Debug, Serialize)]
pub(super) struct Numbers {
    twist: String,
    strain: String,
    axis: String,
    axis_lattice: String,
    lattice_angle: String,
    significant: bool,
}

impl Numbers {
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
        }
    }
}

/// `(value ± sigma)`, to be followed by a unit.
fn bracketed(estimate: ResultEstimate) -> String {
    format!("({})", shown(estimate))
}

/// `value ± sigma`.
pub(super) fn shown(estimate: ResultEstimate) -> String {
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
pub(super) fn conventions(conventions: &Conventions) -> [(&'static str, &str); 12] {
    [
        ("axes", &conventions.axes),
        ("angles", &conventions.angles),
        ("lattice vectors", &conventions.lattice_vectors),
        ("coordinates", &conventions.coordinates),
        ("drift", &conventions.drift),
        ("strain", &conventions.strain),
        ("strained layer", &conventions.strained_layer),
        ("strain axis", &conventions.strain_axis),
        ("strain vector", &conventions.strain_vector),
        ("heterostrain", &conventions.heterostrain),
        ("twist", &conventions.twist),
        ("σ", &conventions.sigma),
    ]
}
