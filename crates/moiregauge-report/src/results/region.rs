//! Regions, uniform areas and wanted areas of a map as parts of its document: degrees, per cent, nm.

use moiregauge::region::{Device, RegionMean, RegionStatistics, WantedArea, WantedTwist};
use moiregauge::window::Mask;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::convert::{PERCENT, degree, number};
use super::lattice::TwistStrainResult;
use crate::map_details::MapDetails;

/// What was asked of a map.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
pub struct MapDetailsResult {
    /// Grains that lie side by side; they have no corners, and their area is that of their good nodes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub grains: Vec<RegionResult>,
    /// Boxes and polygons.
    pub regions: Vec<RegionResult>,
    /// The most uniform areas of the wanted size, best first.
    pub devices: Vec<DeviceResult>,
    /// How much of the map has the wanted twist.
    pub wanted: Option<WantedResult>,
    /// Domain structure, where it was looked for and found.
    pub domains: Option<super::domains::DomainsResult>,
    /// Whether the maps or the triangles are to be used.
    pub regime: Option<super::domains::RegimeResult>,
    /// The pattern of the first image: undistorted, and its averaged cell; nothing where phases are not followed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pattern: Option<super::pattern::PatternResult>,
    /// What the registry of the layers in `displacement.csv` and `map.zarr` counts from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub registry: Option<super::pattern::RegistryResult>,
}

/// Mean and spread of a quantity over an area.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct RegionMeanResult {
    /// Mean over the area of the good nodes.
    pub mean: Option<f64>,
    /// Its standard error from image noise (neighbouring nodes are correlated) and from `blur`. Errors that all nodes
    /// share (drift, calibration, lattice constant, model) are not included.
    pub sigma: Option<f64>,
    /// Shift of the mean by smoothing with the window, from the curvature of the map.
    pub blur: Option<f64>,
    /// Standard deviation over the nodes.
    pub spread: Option<f64>,
    /// The same without what noise adds.
    pub spread_corrected: Option<f64>,
    /// Upper limit of the spread (95 %), with noise and smoothing (`spread_widening`) taken into account. It holds
    /// where the lattice changes over eight windows or more; for shorter changes it may be too small.
    pub spread_below_95: Option<f64>,
    /// Factor by which smoothing with the window may have reduced the spread, from the curvature of the map.
    pub spread_widening: Option<f64>,
    /// Root mean square of the errors of the nodes.
    pub noise: Option<f64>,
}

impl RegionMeanResult {
    fn new(mean: RegionMean, factor: f64) -> Self {
        let scaled = mean.scaled(factor);
        Self {
            mean: number(scaled.mean),
            sigma: number(scaled.sigma),
            blur: number(scaled.blur),
            spread: number(scaled.spread),
            spread_corrected: number(scaled.corrected),
            spread_below_95: number(scaled.below),
            spread_widening: number(scaled.widening),
            noise: number(scaled.noise),
        }
    }
}

/// A region in numbers.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct RegionResult {
    /// Its name.
    pub name: String,
    /// Corners in order, nm.
    pub corners_nm: Vec<[f64; 2]>,
    /// Area, nm².
    pub area_nm2: f64,
    /// Share of the area that the map covers, %.
    pub covered_percent: f64,
    /// Nodes whose cells the area covers at least in part.
    pub nodes: usize,
    /// Good nodes.
    pub good_nodes: usize,
    /// Share of masked nodes, %.
    pub masked_percent: f64,
    /// Masked nodes by reason, % of the nodes within.
    pub masked_by_percent: Vec<MaskShare>,
    /// Twist, degrees.
    pub twist_deg: Option<RegionMeanResult>,
    /// Components of the strain vector, %.
    pub strain_vector_percent: Option<[RegionMeanResult; 2]>,
    /// Twist and strain of the mean of the region.
    pub mean: Option<TwistStrainResult>,
    /// Root mean square of the local strain without noise, %.
    pub strain_rms_percent: Option<f64>,
    /// Mean wavelength, nm.
    pub wavelength_nm: Option<RegionMeanResult>,
}

/// Share of nodes with a mask.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct MaskShare {
    /// The reason.
    pub reason: String,
    /// Share, %.
    pub percent: f64,
}

impl From<&RegionStatistics> for RegionResult {
    fn from(found: &RegionStatistics) -> Self {
        let all = found.nodes.max(1) as f64;
        let share = |&(mask, count): &(Mask, usize)| MaskShare {
            reason: mask.name().to_owned(),
            percent: PERCENT * count as f64 / all,
        };
        let percent = |m: RegionMean| RegionMeanResult::new(m, PERCENT);
        Self {
            name: found.region.name.clone(),
            corners_nm: found.region.corners.iter().map(|c| (*c).into()).collect(),
            area_nm2: found.area_nm2,
            covered_percent: PERCENT * found.covered,
            nodes: found.nodes,
            good_nodes: found.good,
            masked_percent: PERCENT * found.masked_share,
            masked_by_percent: found.masked.iter().map(share).collect(),
            twist_deg: found.twist.map(|t| RegionMeanResult::new(t, degree())),
            strain_vector_percent: found.strain.map(|e| e.map(percent)),
            mean: found.mean.as_ref().map(Into::into),
            strain_rms_percent: found.strain_rms.and_then(|s| number(PERCENT * s)),
            wavelength_nm: found.wavelength.map(|w| RegionMeanResult::new(w, 1.0)),
        }
    }
}

/// An area for a device.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct DeviceResult {
    /// 1 is the best.
    pub rank: usize,
    /// Centre, nm.
    pub centre_nm: [f64; 2],
    /// Direction of the first side, degrees from x.
    pub angle_deg: f64,
    /// The area in numbers.
    pub area: RegionResult,
}

/// How much of a map has a wanted twist, % of the good nodes.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct WantedResult {
    /// The wanted twist, degrees.
    pub twist_deg: f64,
    /// The allowed deviation, degrees.
    pub within_deg: f64,
    /// Good nodes.
    pub nodes: usize,
    /// Share of nodes whose measured twist is within the limits.
    pub measured_percent: Option<f64>,
    /// Share expected without noise.
    pub corrected_percent: Option<f64>,
    /// Shift of this share by smoothing with the window, from the curvature of the map.
    pub blur_percent: Option<f64>,
    /// Share of nodes that are within the limits by at least two of their σ.
    pub certain_percent: Option<f64>,
    /// Share of nodes that are not outside the limits by two of their σ.
    pub possible_percent: Option<f64>,
}

fn wanted((wanted, area): &(WantedTwist, Option<WantedArea>)) -> WantedResult {
    let share = |of: fn(&WantedArea) -> f64| area.as_ref().map(|a| PERCENT * of(a));
    WantedResult {
        twist_deg: degree() * wanted.twist,
        within_deg: degree() * wanted.within,
        nodes: area.map_or(0, |a| a.nodes),
        measured_percent: share(|a| a.measured),
        corrected_percent: share(|a| a.corrected),
        blur_percent: share(|a| a.blur),
        certain_percent: share(|a| a.certain),
        possible_percent: share(|a| a.possible),
    }
}

impl From<&MapDetails> for MapDetailsResult {
    fn from(details: &MapDetails) -> Self {
        let device = |(i, device): (usize, &Device)| DeviceResult {
            rank: i + 1,
            centre_nm: device.centre.into(),
            angle_deg: degree() * device.angle,
            area: (&device.found).into(),
        };
        Self {
            grains: details.grains.iter().map(Into::into).collect(),
            regions: details.regions.iter().map(Into::into).collect(),
            devices: details.devices.iter().enumerate().map(device).collect(),
            wanted: details.wanted.as_ref().map(wanted),
            domains: details.domains.as_ref().map(Into::into),
            regime: details.regime.as_ref().map(Into::into),
            pattern: details.pattern.as_ref().map(Into::into),
            registry: details.registry.as_ref().map(Into::into),
        }
    }
}
