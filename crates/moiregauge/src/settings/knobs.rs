//! Every knob of an analysis, with its default.

use heterostrain::material::{Bilayer, Material};
use heterostrain::strain::{KnownOrientation, StrainConvention, TwistSense};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::frame::background::Background;
use crate::frame::grid_errors::Bends;
use crate::settings::by_hand::ByHand;
use crate::spectrum::method::Method;

/// Which line directions are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Lines {
    /// Trace only.
    Trace,
    /// Retrace only.
    Retrace,
    /// Both, where both are present.
    Both,
}

/// How files become sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Grouping {
    /// By slow axis, line rate, size and channel.
    Auto,
    /// As `auto`, and files of different folders never share a set.
    Folder,
    /// Every file is a set of its own.
    File,
}

/// Which layer's atoms are the ruler of a frame that shows them beside the moiré.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
pub enum RulerLayer {
    /// Whichever the frames show, where that makes the total uncertainty of the twist smaller.
    #[default]
    #[serde(rename = "auto")]
    Auto,
    /// None: the scanner measures the moiré.
    #[serde(rename = "off")]
    Off,
    /// Layer 1, the reference.
    #[serde(rename = "1")]
    First,
    /// Layer 2.
    #[serde(rename = "2")]
    Second,
}

/// A drift velocity known beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GivenDrift {
    /// Along x, nm/min.
    pub x_nm_per_min: f64,
    /// Along y, nm/min.
    pub y_nm_per_min: f64,
    /// Standard uncertainty of each component, nm/min.
    #[serde(default)]
    pub sigma_nm_per_min: f64,
}

impl GivenDrift {
    /// The velocity of the sample, nm/s.
    pub fn velocity(&self) -> nalgebra::Vector2<f64> {
        nalgebra::Vector2::new(self.x_nm_per_min, self.y_nm_per_min) / 60.0
    }
}

/// How well the position sensors (or the scanner, where there are none) are calibrated: standard
/// uncertainties, which every scan shares. The defaults are common values; a calibration of your own scanner is better.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Calibration {
    /// Gain error that x and y have in common, per cent.
    pub gain_percent: f64,
    /// Difference of the gains of x and y, per cent.
    pub mismatch_percent: f64,
    /// Deviation of the axes from a right angle, mrad.
    pub orthogonality_mrad: f64,
    /// By how much a position sensor bends against a straight line, per cent of the range that it goes through in the frame.
    pub sensor_bend_percent: f64,
    /// The same of a scanner that no sensor recorded: hysteresis bends lines by a per cent.
    pub scanner_bend_percent: f64,
}

impl Default for Calibration {
    fn default() -> Self {
        Self {
            gain_percent: 1.0,
            mismatch_percent: 0.5,
            orthogonality_mrad: 5.0,
            sensor_bend_percent: 0.1,
            scanner_bend_percent: 1.0,
        }
    }
}

/// The layers of one of several moirés.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MoireLayers {
    /// Both layers, or the upper one (layer 2) where there is a `substrate`.
    pub material: Material,
    /// The lower layer (layer 1, the reference) where it is another one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub substrate: Option<Material>,
    /// The layer of this moiré whose atoms the frames show; `None`: as for all of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ruler: Option<RulerLayer>,
}

impl MoireLayers {
    /// Of one material, or of two.
    pub fn new(material: Material, substrate: Option<Material>) -> Self {
        Self {
            material,
            substrate,
            ruler: None,
        }
    }
}

/// Every knob of an analysis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Channel that shows the moiré; `None`: the first of the usual ones that is present.
    pub channel: Option<String>,
    /// Which of several images of the channel in one file, counted from 1; `None`: the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image: Option<usize>,
    /// Line directions to use.
    pub line: Lines,
    /// Estimator of the lattice vectors.
    pub method: Method,
    /// What is subtracted beforehand.
    pub background: Background,
    /// Choices made by hand: which lattice to measure, and where it is.
    #[serde(skip_serializing_if = "ByHand::is_nothing")]
    pub by_hand: ByHand,
    /// Which grain to use of scans that show several, as their sets are named: `grain 1` is number 1; `None`: each is a set of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grain: Option<usize>,
    /// The layers: both, or the upper one (layer 2) where there is a `substrate`.
    pub material: Material,
    /// How many moirés every image shows; each is fitted after the others are subtracted.
    pub moires: usize,
    /// The lower layer (layer 1, the reference) where it is another one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub substrate: Option<Material>,
    /// The layers of each moiré, the largest cell first, where not all moirés are of the same; they take the place of
    /// `material` and `substrate`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub moire_layers: Vec<MoireLayers>,
    /// Whether the user chose the layers; otherwise a caveat says that they were assumed.
    pub layers_chosen: bool,
    /// The orientation of one of the layers, if it is known: tells isotropic strain from twist.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lattice_angle: Option<KnownOrientation>,
    /// The orientation of the other layer, if it is known as well: tells the sense of the twist of equal layers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lattice_angle_2: Option<KnownOrientation>,
    /// The sense of the twist, if it is known: an orientation of one of two equal layers leaves it open.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub twist_sense: Option<TwistSense>,
    /// Two wave vectors of the moiré, x and y in rad/nm, that belong to the reciprocal vectors of the atoms at 0° and
    /// (hexagonal layers) 120°; about will do. The lattice of a strained moiré has other pairs that can be meant;
    /// without this, image and orientation choose where they can, and else the least strain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moire_waves: Option<[[f64; 2]; 2]>,
    /// Form of the strain equation.
    pub strain_convention: StrainConvention,
    /// How files become sets.
    pub grouping: Grouping,
    /// Standard uncertainty of the time of a frame, s: headers hold whole seconds (0.29 s) and are
    /// written some time after the end of the frame.
    pub frame_time_sigma_s: f64,
    /// Scans that are shown but not used: names of files, `*` stands for any characters.
    pub exclude: Vec<String>,
    /// Whether scans that do not fit the others are left out by themselves: one after the other,
    /// worst first, while the leave-one-out χ² of a scan has p < 0.001/n; never more than a fifth.
    pub exclude_outliers: bool,
    /// Use only the region that all scans of a set have in common.
    pub overlap: bool,
    /// A drift known beforehand; `None`: measure it.
    pub drift: Option<GivenDrift>,
    /// Standard deviation of each component of the drift where scans do not tell it and `drift` is not given, nm/min, for the uncertainty
    /// budget. The default is what an instrument at rest drifts; where a frame is so slow that this would be more than a quarter of the
    /// speed at which its lines advance, that quarter is taken.
    pub drift_prior_nm_per_min: f64,
    /// How well the scanner is calibrated, for the uncertainty budget.
    pub calibration: Calibration,
    /// A measured calibration of the scanner: positions are corrected with it, and its covariance takes the
    /// place of `calibration` in the budget.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scanner: Option<crate::calibration::Calibration>,
    /// Standard deviation of the isotropic heterostrain that the layers may have beside the uniaxial
    /// one, per cent, for the uncertainty budget. The moiré does not show it. The default is a guess, of
    /// the size of small uniaxial strains; up to 0.06 % the twist stays within 0.001°.
    pub isotropic_strain_percent: f64,
    /// The layer whose atoms the frames show beside the moiré and which measures them in place of the scanner. Of several moirés, which need not have this
    /// layer in common, only where it is said.
    pub ruler: RulerLayer,
    /// Standard deviation of the strain that this layer itself may have, along x and along y, per cent, for the uncertainty budget.
    pub ruler_strain_percent: f64,
    /// Standard deviation of the change of the gain along x and along y between the frames of `ruler_from` and the scans, per cent, for the
    /// uncertainty budget. The default is that of open piezo tubes whose frames differ by a twentieth of their range: their sensitivity
    /// grows with the voltage, by some 10 % from the smallest to the full range.
    pub ruler_magnification_percent: f64,
    /// Monte Carlo draws for the drift.
    pub drift_draws: usize,
    /// Monte Carlo draws for twist and strain, per scan.
    pub strain_draws: usize,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Settings {
    /// The shares of their ranges by which x and y may be bent: what a calibration of the sensors leaves, or what is assumed.
    pub(crate) fn bends(&self, bends: &Bends) -> Vector2<f64> {
        let assumed = &self.calibration;
        let percent = if bends.from_sensors {
            assumed.sensor_bend_percent
        } else {
            assumed.scanner_bend_percent
        };
        let measured = self.scanner.as_ref().filter(|_| bends.from_sensors);
        measured
            .and_then(|scanner| scanner.curvature.as_ref())
            .map_or(Vector2::repeat(percent / 100.0), |c| c.shares(bends.range))
    }

    /// The settings for the moiré `index` (0 has the largest cell): `material` and `substrate` are its own.
    #[must_use]
    pub fn of_moire(&self, index: usize) -> Self {
        let mut own = self.clone();
        if let Some(layers) = self.moire_layers.get(index) {
            own.material.clone_from(&layers.material);
            own.substrate.clone_from(&layers.substrate);
            own.ruler = layers.ruler.unwrap_or(self.ruler);
        }
        own
    }

    /// Whether nobody chose the layers: they are the default, and nothing says that they are meant.
    pub fn layers_are_assumed(&self) -> bool {
        let defaults = self.substrate.is_none() && self.moire_layers.is_empty();
        !self.layers_chosen && defaults && self.material == Material::graphene()
    }

    /// These settings with the method of arXiv:2406.08681 and all that belongs to it: its form of the strain equation,
    /// and images cropped to the region that all scans share.
    #[must_use]
    pub fn as_published(self) -> Self {
        Self {
            method: Method::Paper,
            strain_convention: StrainConvention::KSpace,
            overlap: true,
            ..self
        }
    }

    /// The layers whose atoms are looked for beside the moiré, which they hide: the upper one first, which most images show.
    pub fn ruler_layers(&self) -> Vec<&Material> {
        let reads_it =
            self.method == Method::Lattice && self.strain_convention == StrainConvention::RealSpace;
        if !reads_it {
            return Vec::new();
        }
        let one = [(self.ruler, &self.material, self.substrate.as_ref())];
        let each = self.moire_layers.iter().map(|own| {
            let ruler = own.ruler.unwrap_or(self.ruler);
            (ruler, &own.material, own.substrate.as_ref())
        });
        let mut all: Vec<_> = each.collect();
        if all.is_empty() {
            all.extend(one);
        }
        // What one moiré has is in the whole frame.
        let is_told = |ruler: RulerLayer| matches!(ruler, RulerLayer::First | RulerLayer::Second);
        if all.iter().any(|(ruler, ..)| is_told(*ruler)) {
            all.retain(|(ruler, ..)| is_told(*ruler));
        }
        let mut layers: Vec<&Material> = Vec::new();
        for (ruler, upper, lower) in all {
            let lower = lower.unwrap_or(upper);
            let own = match ruler {
                RulerLayer::First => vec![lower],
                RulerLayer::Second => vec![upper],
                _ => vec![upper, lower],
            };
            for layer in own {
                if !layers.contains(&layer) {
                    layers.push(layer);
                }
            }
        }
        layers
    }

    /// The two layers: `material` on itself or on the `substrate`.
    pub fn bilayer(&self) -> Bilayer<'_> {
        Bilayer {
            reference: self.substrate.as_ref().unwrap_or(&self.material),
            stretched: &self.material,
            waves: self
                .moire_waves
                .map(|[a, b]| nalgebra::Matrix2::new(a[0], b[0], a[1], b[1])),
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            channel: None,
            image: None,
            line: Lines::Both,
            method: Method::Lattice,
            background: Background::Plane,
            by_hand: ByHand::default(),
            grain: None,
            material: Material::graphene(),
            moires: 1,
            substrate: None,
            moire_layers: Vec::new(),
            layers_chosen: false,
            lattice_angle: None,
            lattice_angle_2: None,
            twist_sense: None,
            moire_waves: None,
            strain_convention: StrainConvention::RealSpace,
            grouping: Grouping::Auto,
            frame_time_sigma_s: 0.6,
            exclude: Vec::new(),
            exclude_outliers: false,
            overlap: false,
            drift: None,
            drift_prior_nm_per_min: 1.0,
            calibration: Calibration::default(),
            scanner: None,
            isotropic_strain_percent: 0.05,
            ruler: RulerLayer::Auto,
            ruler_strain_percent: 0.1,
            ruler_magnification_percent: 0.5,
            drift_draws: 10_000,
            strain_draws: 1_000,
            seed: 1,
        }
    }
}
