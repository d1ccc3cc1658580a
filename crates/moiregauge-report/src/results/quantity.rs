//! Mean, spread and trend of a quantity of a map.

use moiregauge::map::Spread;
use moiregauge::region::Trend;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Mean and spread of a quantity over the good nodes.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct QuantityResult {
    /// Its name in the files.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Mean.
    pub mean: f64,
    /// Standard error of the mean by image noise; an upper limit of it for the size of the strain and displacements.
    pub mean_sigma: f64,
    /// Standard deviation over the nodes.
    pub spread: f64,
    /// The same with the noise taken off.
    pub spread_corrected: f64,
    /// Root mean square of the errors of the nodes.
    pub noise: f64,
    /// What bends of the grid that no sensor told may add to the nodes, root mean square; in no other number, and left out where it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bends: Option<f64>,
    /// A plane through the good nodes; `null` where they are too few or too near to each other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trend: Option<TrendResult>,
}

/// A plane through the good nodes: how much of the spread is a change across the frame (creep, drift that changes, a
/// scanner that bows, or the sample).
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct TrendResult {
    /// Change along x and along y, per 100 nm.
    pub per_100nm: [f64; 2],
    /// Their standard errors by the noise of the image.
    pub per_100nm_sigma: [f64; 2],
    /// Value at the middle of the frame (of stripes: of the nodes of the pattern), where a fit to all its pixels has its
    /// mean.
    pub middle: f64,
    /// Its standard error by the noise of the image.
    pub middle_sigma: f64,
    /// Standard deviation over the good nodes due to the plane.
    pub of_trend: f64,
    /// Standard deviation due to noise.
    pub noise: f64,
    /// Standard deviation that neither trend nor noise explains.
    pub rest: f64,
}

impl TrendResult {
    pub(super) fn new(t: &Trend, factor: f64) -> Self {
        let scaled = t.gradient.map(|g| g.scaled(100.0 * factor));
        Self {
            per_100nm: scaled.map(|g| g.value),
            per_100nm_sigma: scaled.map(|g| g.sigma),
            middle: factor * t.middle.value,
            middle_sigma: factor * t.middle.sigma,
            of_trend: factor * t.of_trend,
            noise: factor * t.noise,
            rest: factor * t.rest,
        }
    }
}

impl QuantityResult {
    /// In another unit, without a trend.
    pub(super) fn new(name: &str, unit: &str, found: &Spread, factor: f64) -> Self {
        Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            mean: factor * found.mean,
            mean_sigma: factor * found.mean_sigma,
            spread: factor * found.spread,
            spread_corrected: factor * found.corrected,
            noise: factor * found.noise,
            bends: None,
            trend: None,
        }
    }
}
