//! Every knob of a simulation. The defaults are the conditions of arXiv 2406.08681.

use heterostrain::material::{Bilayer, Material};
use heterostrain::strain::{Stacking, StrainConvention};
use serde::{Deserialize, Serialize};

use crate::simulate::error::SimulateError;
use crate::simulate::feature::SampleFeature;

/// One set of frames of one sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Simulation {
    /// Name of the set, and of its folder.
    pub name: String,
    /// Seed of all noise.
    pub seed: u64,
    /// The layers and their contrast.
    pub sample: Sample,
    /// Motion of the sample in the frame of the sensors.
    pub drift: Drift,
    /// How the tip is led over the sample.
    pub raster: Raster,
    /// Where the scanner really goes.
    pub window: Window,
    /// What the detectors add.
    pub noise: Noise,
    /// What the sample and the instrument have besides a perfect lattice.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub features: Vec<SampleFeature>,
}

/// What the pattern is.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Pattern {
    /// The moiré of the two layers.
    #[default]
    Moire,
    /// The atomic lattice of layer 1, the reference.
    Layer1,
    /// The atomic lattice of layer 2, stretched and turned.
    Layer2,
}

/// Two layers and the contrast of their moiré, or of the atoms of one of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sample {
    /// What is seen.
    #[serde(default)]
    pub pattern: Pattern,
    /// The layers: both, or layer 2 where there is a `substrate`.
    pub material: Material,
    /// Layer 1, where it is another one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub substrate: Option<Material>,
    /// Form of the strain equation in which twist and strain are meant.
    pub strain_convention: StrainConvention,
    /// θ, degrees.
    pub twist_deg: f64,
    /// ε, per cent.
    pub strain_percent: f64,
    /// φ, axis of ε counted from layer 1, degrees counter-clockwise.
    pub strain_axis_deg: f64,
    /// Strain of layer 2 that is the same in all directions, on top of the uniaxial one, per cent.
    pub biaxial_percent: f64,
    /// α, orientation of the reciprocal vectors of layer 1, degrees.
    pub lattice_angle_deg: f64,
    /// Amplitude of each of the three first harmonics, degrees of phase.
    pub contrast_deg: f64,
    /// s in 0…1: harmonics of the order |h| have the amplitude `s^(|h|²−1)`, |h|² = 1, 3, 4, 7, 9, as
    /// have Gaussian spots. 0 is three cosines.
    pub sharpness: f64,
    /// Random spread of the first harmonics: relative in amplitude, rad in phase.
    pub irregularity: f64,
    /// Seed of that spread; the same sample in several sets has the same one.
    pub seed: u64,
    /// A spot of the moiré, nm.
    pub origin_nm: [f64; 2],
}

/// `d(t) = D t + ½ A t²`, t from the start of the clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Drift {
    /// D along x and y, nm/min.
    pub velocity_nm_per_min: [f64; 2],
    /// A along x and y, nm/min².
    pub acceleration_nm_per_min2: [f64; 2],
}

/// Which line is recorded first in the first frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FirstDirection {
    /// The bottom line.
    Up,
    /// The top line.
    Down,
}

/// How the tip is led over the sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Raster {
    /// Number of frames.
    pub scans: usize,
    /// Samples in a line, lines in a frame.
    pub pixels: [usize; 2],
    /// Lines per second, trace and retrace together.
    pub line_rate_hz: f64,
    /// Overscan: the fraction by which the fast motion exceeds the frame.
    pub rounding: f64,
    /// Direction of the fast axis, degrees counter-clockwise from x; 90 is fast along y with the
    /// lines following each other towards −x.
    pub rotation_deg: f64,
    /// Direction of the first frame.
    pub first_direction: FirstDirection,
    /// Whether the direction alternates from frame to frame.
    pub alternating: bool,
    /// Size the user asked for, first to last pixel along the fast and the slow axis, nm.
    pub nominal_size_nm: [f64; 2],
    /// Start of the first frame, s on the clock of the drift.
    pub start_s: f64,
    /// Pause between frames, s.
    pub gap_s: f64,
    /// Whether the retrace is recorded.
    pub retrace: bool,
    /// Whether the position sensors are recorded.
    pub sensors: bool,
}

/// Where the scanner really goes; all of it is seen by the sensors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Window {
    /// True over nominal length along x and y.
    pub gain: [f64; 2],
    /// Angle by which the scanner's y axis leans towards x, mrad.
    pub shear_mrad: f64,
    /// Centre of the frame, nm.
    pub centre_nm: [f64; 2],
    /// Motion of the centre from frame to frame, nm/min.
    pub creep_nm_per_min: [f64; 2],
    /// Centre of frames upwards minus centre of frames downwards, nm.
    pub alternation_nm: [f64; 2],
}

/// What the detectors add, as standard deviations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Noise {
    /// Of each position reading, nm.
    pub sensor_nm: f64,
    /// Of each pixel, degrees of phase.
    pub pixel_deg: f64,
    /// Of each line, independent of the others, degrees of phase.
    pub line_deg: f64,
    /// Of lines with a 1/f spectrum, degrees of phase.
    pub flicker_deg: f64,
    /// Of the time from the end of a frame to the (whole) second in its header, s.
    pub clock_s: f64,
    /// Slope of the background over the whole frame along fast and slow axis, degrees of phase.
    pub plane_deg: [f64; 2],
}

impl Default for Simulation {
    fn default() -> Self {
        Self {
            name: "simulated".to_owned(),
            seed: 1,
            sample: Sample::default(),
            drift: Drift {
                velocity_nm_per_min: [0.50, -0.15],
                acceleration_nm_per_min2: [0.0; 2],
            },
            raster: Raster::default(),
            window: Window::default(),
            noise: Noise::default(),
            features: Vec::new(),
        }
    }
}

impl Default for Sample {
    fn default() -> Self {
        Self {
            pattern: Pattern::Moire,
            material: Material::graphene(),
            substrate: None,
            strain_convention: StrainConvention::RealSpace,
            twist_deg: 1.13,
            strain_percent: 0.12,
            strain_axis_deg: 25.0,
            biaxial_percent: 0.0,
            lattice_angle_deg: 12.0,
            contrast_deg: 1.0,
            sharpness: 0.3,
            irregularity: 0.0,
            seed: 1,
            origin_nm: [1.7, -2.9],
        }
    }
}

impl Default for Raster {
    fn default() -> Self {
        Self {
            scans: 10,
            pixels: [512, 512],
            line_rate_hz: 8.0,
            rounding: 0.05,
            rotation_deg: 0.0,
            first_direction: FirstDirection::Up,
            alternating: true,
            nominal_size_nm: [70.0, 70.0],
            start_s: 0.0,
            gap_s: 1.0,
            retrace: true,
            sensors: true,
        }
    }
}

impl Default for Window {
    fn default() -> Self {
        Self {
            // The paper's 70 nm frame measured 54.7 nm by 56.8 nm.
            gain: [54.7 / 70.0, 56.8 / 70.0],
            shear_mrad: 2.0,
            centre_nm: [0.0, 0.0],
            creep_nm_per_min: [0.08, 0.12],
            alternation_nm: [0.4, 0.3],
        }
    }
}

impl Default for Noise {
    fn default() -> Self {
        Self {
            sensor_nm: 0.2,
            pixel_deg: 0.5,
            line_deg: 0.15,
            flicker_deg: 0.1,
            clock_s: 0.5,
            plane_deg: [2.0, -1.0],
        }
    }
}

impl Sample {
    /// The two layers.
    pub fn bilayer(&self) -> Bilayer<'_> {
        Bilayer {
            reference: self.substrate.as_ref().unwrap_or(&self.material),
            stretched: &self.material,
            waves: None,
        }
    }

    /// How layer 2 lies on layer 1.
    pub fn stacking(&self) -> Stacking {
        Stacking {
            twist: self.twist_deg.to_radians(),
            lattice_angle: self.lattice_angle_deg.to_radians(),
            strain: self.strain_percent / 100.0,
            axis_lattice: self.strain_axis_deg.to_radians(),
            biaxial: self.biaxial_percent / 100.0,
        }
    }
}

/// Frames larger than this hold more pixels than any instrument writes.
pub const MOST_PIXELS: usize = 16_384;

impl Simulation {
    /// Refuses what no instrument can do.
    pub(crate) fn check(&self) -> Result<(), SimulateError> {
        let Self {
            sample,
            drift,
            raster,
            window,
            noise,
            ..
        } = self;
        let [columns, rows] = raster.pixels;
        let possible = |n: usize| (2..=MOST_PIXELS).contains(&n);
        require(
            possible(columns) && possible(rows),
            "raster.pixels",
            "two numbers from 2 to 16384",
            &raster.pixels,
        )?;
        require(
            (1..=9999).contains(&raster.scans),
            "raster.scans",
            "1 to 9999 frames",
            &raster.scans,
        )?;
        let positive = [
            ("raster.line_rate_hz", raster.line_rate_hz),
            ("raster.nominal_size_nm", raster.nominal_size_nm[0]),
            ("raster.nominal_size_nm", raster.nominal_size_nm[1]),
            ("window.gain", window.gain[0]),
            ("window.gain", window.gain[1]),
        ];
        for (setting, value) in positive {
            require(
                (1e-9..=1e9).contains(&value),
                setting,
                "a number > 0, from 1e-9 to 1e9",
                &value,
            )?;
        }
        let not_negative = [
            ("raster.rounding", raster.rounding),
            ("raster.gap_s", raster.gap_s),
            ("raster.start_s", raster.start_s),
            ("sample.contrast_deg", sample.contrast_deg),
            ("sample.irregularity", sample.irregularity),
            ("noise.sensor_nm", noise.sensor_nm),
            ("noise.pixel_deg", noise.pixel_deg),
            ("noise.line_deg", noise.line_deg),
            ("noise.flicker_deg", noise.flicker_deg),
            ("noise.clock_s", noise.clock_s),
        ];
        for (setting, value) in not_negative {
            require(
                (0.0..=1e9).contains(&value),
                setting,
                "a number ≥ 0, up to 1e9",
                &value,
            )?;
        }
        require(
            (0.0..1.0).contains(&sample.sharpness),
            "sample.sharpness",
            "0 or more and less than 1",
            &sample.sharpness,
        )?;
        let pairs = [
            ("sample.origin_nm", sample.origin_nm),
            ("drift.velocity_nm_per_min", drift.velocity_nm_per_min),
            (
                "drift.acceleration_nm_per_min2",
                drift.acceleration_nm_per_min2,
            ),
            ("window.centre_nm", window.centre_nm),
            ("window.creep_nm_per_min", window.creep_nm_per_min),
            ("window.alternation_nm", window.alternation_nm),
            ("noise.plane_deg", noise.plane_deg),
            (
                "window.shear_mrad and raster.rotation_deg",
                [window.shear_mrad, raster.rotation_deg],
            ),
            (
                "sample.twist_deg and sample.strain_percent",
                [sample.twist_deg, sample.strain_percent],
            ),
            (
                "sample.strain_axis_deg and sample.lattice_angle_deg",
                [sample.strain_axis_deg, sample.lattice_angle_deg],
            ),
            ("sample.biaxial_percent", [sample.biaxial_percent, 0.0]),
        ];
        for (setting, pair) in pairs {
            require(
                pair.iter().all(|x| x.abs() <= 1e9),
                setting,
                "finite numbers, up to 1e9",
                &pair,
            )?;
        }
        self.features.iter().try_for_each(SampleFeature::check)
    }
}

fn require(
    condition: bool,
    setting: &'static str,
    expected: &'static str,
    found: &dyn std::fmt::Debug,
) -> Result<(), SimulateError> {
    if condition {
        return Ok(());
    }
    Err(SimulateError::Setting {
        setting,
        expected,
        found: format!("{found:?}"),
    })
}
