//! A map along a line: the numbers of `profiles.csv`, for programs.

use moiregauge::region::Profile;
use moiregauge::window::Mask;
use serde::Serialize;

use super::convert::{PERCENT, degree, estimate};
use super::estimate::ResultEstimate;

/// A line.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProfileResult {
    /// What the user calls it.
    pub name: String,
    /// Its ends, nm.
    pub ends_nm: [[f64; 2]; 2],
    /// Points a node's distance apart, both ends included.
    pub points: Vec<ProfilePointResult>,
}

/// A point of a line. Without values where a node around it is masked, or beyond the map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProfilePointResult {
    /// From the start of the line, nm.
    pub distance_nm: f64,
    /// Place, nm.
    pub place_nm: [f64; 2],
    /// `good`, or why there are no values.
    pub mask: &'static str,
    /// Twist, degrees. Near points share their noise.
    pub twist_deg: Option<ResultEstimate>,
    /// Magnitude of the heterostrain, bias of noise removed, per cent.
    pub heterostrain_percent: Option<ResultEstimate>,
    /// Components of the strain vector, ε cos 2φ and ε sin 2φ, per cent.
    pub strain_vector_percent: Option<[ResultEstimate; 2]>,
    /// Mean of the three wavelengths, nm.
    pub wavelength_nm: Option<ResultEstimate>,
}

impl From<&Profile> for ProfileResult {
    fn from(found: &Profile) -> Self {
        let points = found.points.iter().map(|point| {
            let values = point.values.as_ref();
            ProfilePointResult {
                distance_nm: point.distance,
                place_nm: point.place.into(),
                mask: point.mask.map_or("beyond the map", Mask::name),
                twist_deg: values.map(|v| estimate(v.twist, degree())),
                heterostrain_percent: values.map(|v| estimate(v.magnitude, PERCENT)),
                strain_vector_percent: values.map(|v| v.strain.map(|e| estimate(e, PERCENT))),
                wavelength_nm: values.map(|v| estimate(v.wavelength, 1.0)),
            }
        });
        Self {
            name: found.name.clone(),
            ends_nm: found.ends.map(Into::into),
            points: points.collect(),
        }
    }
}
