//! Domain structure of a map as part of its document: degrees, per cent, nm.

use moiregauge::domains::{Contrast, DomainMap, Regime, RegimeChoice};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::convert::{PERCENT, degree, number};

/// Nodes and triangles in a few numbers; each of them is in `nodes.csv` and `domains.csv`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct DomainsResult {
    /// `bright` or `dark`.
    pub nodes_are: String,
    /// Nodes found.
    pub nodes: usize,
    /// Median error of the place of a node along an axis, nm; what all nodes share is not in it.
    pub node_sigma_nm: Option<f64>,
    /// Triangles with twist and strain.
    pub triangles: usize,
    /// Places where a node is missing, nm.
    pub missing_nm: Vec<[f64; 2]>,
    /// Nodes that fit into no triangle, nm.
    pub extra_nm: Vec<[f64; 2]>,
    /// Dislocations.
    pub dislocations: Vec<DislocationResult>,
    /// Median twist of the triangles, degrees.
    pub median_twist_deg: Option<f64>,
    /// Standard deviation of the twist over the triangles, degrees.
    pub twist_spread_deg: Option<f64>,
    /// Median of their errors, degrees.
    pub twist_noise_deg: Option<f64>,
}

/// A line along which the lattice does not close.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct DislocationResult {
    /// Place, nm.
    pub place_nm: [f64; 2],
    /// Burgers vector (h, k) on the lattice.
    pub burgers: [i32; 2],
}

/// Which regime applies.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct RegimeResult {
    /// `phase map` or `domains` (the triangles between nodes): what is to be used.
    pub use_of: String,
    /// Whether the phase map is in doubt.
    pub phase_map_in_doubt: bool,
    /// Why.
    pub reasons: Vec<String>,
    /// Share of inner nodes of the map that are bent or defects, %.
    pub blurred_percent: Option<f64>,
    /// Change of the area of cells over the width of the window, %.
    pub variation_percent: Option<f64>,
}

impl From<&DomainMap> for DomainsResult {
    fn from(map: &DomainMap) -> Self {
        let twists = map.cells.iter().filter_map(|c| c.twist_strain);
        let [mut values, mut sigmas] = [Vec::new(), Vec::new()];
        for found in twists {
            values.push(degree() * found.twist);
            sigmas.push(degree() * found.twist().sigma);
        }
        let spread = crate::stats::mean_and_deviation(&values).1;
        Self {
            nodes_are: if map.contrast == Contrast::Dark {
                "dark"
            } else {
                "bright"
            }
            .to_owned(),
            nodes: map.nodes.len(),
            node_sigma_nm: median(
                map.covariances
                    .iter()
                    .map(|c| (c.trace() / 2.0).sqrt())
                    .collect(),
            ),
            triangles: map.cells.len(),
            missing_nm: map.missing.iter().map(|p| (*p).into()).collect(),
            extra_nm: map.extra.iter().map(|&n| map.nodes[n].into()).collect(),
            dislocations: map
                .dislocations
                .iter()
                .map(|d| DislocationResult {
                    place_nm: d.place.into(),
                    burgers: d.burgers,
                })
                .collect(),
            median_twist_deg: median(values),
            twist_spread_deg: number(spread),
            twist_noise_deg: median(sigmas),
        }
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().and_then(number)
}

impl From<&Regime> for RegimeResult {
    fn from(regime: &Regime) -> Self {
        Self {
            use_of: match regime.choice {
                RegimeChoice::Phases => "phase map",
                RegimeChoice::Domains => "domains",
            }
            .to_owned(),
            phase_map_in_doubt: regime.in_doubt,
            reasons: regime.reasons.clone(),
            blurred_percent: number(PERCENT * regime.blurred),
            variation_percent: number(PERCENT * regime.variation),
        }
    }
}
