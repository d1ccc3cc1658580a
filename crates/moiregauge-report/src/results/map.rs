//! The summary of a map as a document, `moiregauge/map/1`: degrees, per cent, nm.

use moiregauge::map::{Agreement, DriftChange, Plane, TwistStrainMap};
use moiregauge::region::Trends;
use moiregauge::settings::Settings;
use moiregauge::window::{Mask, UsedHarmonic};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::caveat::ResultCaveat;
use super::conventions::Conventions;
use super::lattice::TwistStrainResult;
use super::provenance::Provenance;
use super::quantity::{QuantityResult, TrendResult};

/// What a map comes to.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct MapResults {
    /// Name and version of this document.
    pub schema: String,
    /// Program, seed, inputs.
    pub provenance: Provenance,
    /// What the numbers mean.
    pub conventions: Conventions,
    /// What the errors of the maps are and what they leave out.
    pub errors: String,
    /// The settings of the analysis.
    pub settings: Settings,
    /// How the map was made: `demodulation` or `tiles`.
    pub method: String,
    /// Width of the window, standard deviation of the Gaussian, nm.
    pub window_nm: f64,
    /// Resolution: full width at half maximum of the window, nm.
    pub resolution_nm: f64,
    /// Columns and rows of nodes.
    pub nodes: [usize; 2],
    /// Node (0, 0), nm.
    pub origin_nm: [f64; 2],
    /// The way to the next node in a row, and to the next row, nm.
    pub step_nm: [[f64; 2]; 2],
    /// From where to where the nodes reach, half a step beyond the outer ones: along x and along y, nm.
    pub extent_nm: [[f64; 2]; 2],
    /// Nodes by mask.
    pub masks: Vec<MaskCount>,
    /// Mean and spread of every quantity over the good nodes.
    pub quantities: Vec<QuantityResult>,
    /// The fit to the whole images, to compare with.
    pub whole_image: Option<TwistStrainResult>,
    /// The images behind the map.
    pub images: Vec<MappedImage>,
    /// Patterns of stripes, in a map of stripes: such a map has no twist and no strain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stripes: Option<super::stripes::StripesResult>,
    /// How images of one place agree.
    pub agreement: Option<AgreementResult>,
    /// Difference between upward and downward frames along the slow axis: a drift that changes, not strain.
    pub drift_change: Option<DriftChangeResult>,
    /// Regions, uniform areas, wanted twist.
    pub details: super::region::MapDetailsResult,
    /// Doubts.
    pub caveats: Vec<ResultCaveat>,
}

/// How many nodes have a mask.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct MaskCount {
    /// Its number in the files.
    pub value: u8,
    /// What it means.
    pub name: String,
    /// Nodes.
    pub nodes: usize,
}

/// One image behind a map.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct MappedImage {
    /// The file as the user named it.
    pub file: String,
    /// `trace` or `retrace`.
    pub line: String,
    /// Whether its drift is taken off.
    pub drift_corrected: bool,
    /// What the atoms of a layer measured in place of the scanner; left out without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ruler: Option<MappedRuler>,
    /// The harmonics that were used.
    pub harmonics: Vec<HarmonicResult>,
}

/// What the atoms of a layer measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MappedRuler {
    /// Places and lattices by one linear map for the frame.
    Frame,
    /// Places by one linear map, the lattice of each node by the atoms under its window: free of slow distortions.
    Nodes,
}

impl MappedRuler {
    /// Node by node, or the whole frame.
    pub fn of(nodes: bool) -> Self {
        if nodes { Self::Nodes } else { Self::Frame }
    }
}

/// A harmonic of the lattice.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct HarmonicResult {
    /// (h, k).
    pub index: [i32; 2],
    /// Amplitude, root mean square over the frame, unit of the image.
    pub amplitude: f64,
    /// Variance per pixel of white noise as strong as the noise there.
    pub noise: f64,
}

impl From<&UsedHarmonic> for HarmonicResult {
    fn from(h: &UsedHarmonic) -> Self {
        Self {
            index: h.index,
            amplitude: h.amplitude,
            noise: h.noise,
        }
    }
}

/// `A_up − A_down` of the drift within frames.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct DriftChangeResult {
    /// Along x, nm/min².
    pub x: f64,
    /// Its standard error.
    pub x_sigma: f64,
    /// Along y, nm/min².
    pub y: f64,
    /// Its standard error.
    pub y_sigma: f64,
    /// χ² that both are zero, two degrees of freedom.
    pub chi2: f64,
}

impl From<DriftChange> for DriftChangeResult {
    fn from(found: DriftChange) -> Self {
        let [x, y] = found.acceleration.map(|a| a.scaled(3600.0));
        Self {
            x: x.value,
            x_sigma: x.sigma,
            y: y.value,
            y_sigma: y.sigma,
            chi2: found.chi2,
        }
    }
}

/// How images of one place agree.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct AgreementResult {
    /// χ² per degree of freedom of the single images about their average.
    pub chi2_per_dof: f64,
    /// Factor on all variances that follows from it.
    pub variance_factor: f64,
    /// Nodes that two images or more cover.
    pub nodes: usize,
}

impl From<Agreement> for AgreementResult {
    fn from(a: Agreement) -> Self {
        Self {
            chi2_per_dof: a.chi2_per_dof,
            variance_factor: a.factor,
            nodes: a.nodes,
        }
    }
}

/// Nodes by mask, those that do not occur left out.
pub fn mask_counts(map: &TwistStrainMap) -> Vec<MaskCount> {
    let count = |mask: Mask| MaskCount {
        value: mask as u8,
        name: mask.name().to_owned(),
        nodes: map.count(mask),
    };
    let all = Mask::ALL.into_iter().map(count);
    all.filter(|c| c.nodes > 0).collect()
}

/// Mean and spread of every quantity.
pub fn quantities(map: &TwistStrainMap) -> Vec<QuantityResult> {
    let degree = 1f64.to_degrees();
    let [e1, e2] = &map.strain;
    let [l1, l2, l3] = &map.wavelengths;
    let [ux, uy] = &map.displacement;
    let all: [(&str, &str, &Plane, f64); 11] = [
        ("twist", "°", &map.twist, degree),
        ("strain", "%", &map.magnitude, 100.0),
        ("strain vector 1", "%", e1, 100.0),
        ("strain vector 2", "%", e2, 100.0),
        ("lattice angle", "°", &map.lattice_angle, degree),
        ("wavelength 1", "nm", l1, 1.0),
        ("wavelength 2", "nm", l2, 1.0),
        ("wavelength 3", "nm", l3, 1.0),
        ("orientation", "°", &map.orientation, degree),
        ("displacement x", "nm", ux, 1.0),
        ("displacement y", "nm", uy, 1.0),
    ];
    let trends = Trends::new(map);
    all.into_iter()
        .filter_map(|(name, unit, plane, factor)| {
            let found = map.spread(plane)?;
            let trend = trends.as_ref().and_then(|t| t.of(plane));
            let of_bends = match name {
                "twist" => map.rms_of_bends(0),
                "strain vector 1" => map.rms_of_bends(1),
                "strain vector 2" => map.rms_of_bends(2),
                _ => None,
            };
            Some(QuantityResult {
                bends: of_bends.map(|sigma| factor * sigma),
                trend: trend.map(|t| TrendResult::new(&t, factor)),
                ..QuantityResult::new(name, unit, &found, factor)
            })
        })
        .collect()
}
