//! Plans, what they will tell, and what limits them.

use moiregauge::meaning::Source;
use moiregauge::plan::{Prediction, Quantity};
use moiregauge::settings::Settings;
use moiregauge::simulate::Simulation;
use serde::{Serialize, Serializer};

use super::request::Wishes;

/// Exact times of frames that make a smaller drift error than this share limit it.
const CLEARLY: f64 = 0.7;

/// Plans for the same wishes.
#[derive(Clone, Debug, Serialize)]
pub struct Plans {
    /// Instrument and sample.
    pub conditions: Simulation,
    /// What was known of scanner and layers.
    pub settings: Settings,
    /// What was wanted.
    pub wishes: Wishes,
    /// The best first: those that meet the wishes, by their duration; then the others.
    pub plans: Vec<Plan>,
}

/// One way of doing it.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// The scans, as conditions of a simulation.
    pub set: Simulation,
    /// Whether the wishes are met, as far as scans can.
    pub met: bool,
    /// From the first line to the last.
    pub duration_s: f64,
    /// Sides of a frame.
    pub size_nm: [f64; 2],
    /// Standard error of each component of the drift, nm/min.
    pub drift_sigma_nm_per_min: f64,
    /// Of the twist, degrees.
    pub twist_sigma_deg: Expected,
    /// Of each component of the strain vector, per cent.
    pub strain_sigma_percent: Expected,
    /// Whether phases of successive frames can be linked; otherwise the drift comes from wave vectors alone.
    pub linked: bool,
    /// What makes most of the error that is nearest to its wish, or farthest beyond it.
    pub limited_by: Option<Limit>,
    /// Wishes that no number of scans fulfils.
    pub out_of_reach: Vec<OutOfReach>,
}

/// A standard error before measuring.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Expected {
    /// By noise of images and sensors, and by drift.
    pub statistical: f64,
    /// With calibration and model.
    pub total: f64,
}

/// A wish that no number of scans fulfils.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OutOfReach {
    /// Whether it is the twist (degrees); otherwise the strain (per cent).
    pub is_twist: bool,
    /// The wish.
    pub wish: f64,
    /// What calibration and model alone make.
    pub floor: f64,
    /// What makes most of that.
    pub largest: Limit,
    /// The standard error by it alone.
    pub largest_sigma: f64,
}

/// What makes most of an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Limit {
    /// A part of the budget.
    Of(Source),
    /// Frames that cannot be linked by phases.
    Unlinked,
    /// Times of the frames.
    FrameTimes,
}

impl Serialize for Limit {
    /// Its name.
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(match self {
            Self::Of(Source::Image) => "image-noise",
            Self::Of(Source::Drift) => "drift",
            Self::Of(Source::Sensor) => "sensor-noise",
            Self::Of(Source::Gain) => "gain",
            Self::Of(Source::Mismatch) => "mismatch",
            Self::Of(Source::Orthogonality) => "orthogonality",
            Self::Of(Source::Pitch) => "pitch",
            Self::Of(Source::Shape) => "grid-shape",
            Self::Of(Source::LatticeConstant) => "lattice-constant",
            Self::Of(Source::StrainedLayer) => "strained-layer",
            Self::Of(Source::IsotropicStrain) => "isotropic-strain",
            Self::Of(Source::PoissonRatio) => "poisson-ratio",
            Self::Of(Source::RulerStrain) => "ruler-strain",
            Self::Unlinked => "unlinked",
            Self::FrameTimes => "frame-times",
        })
    }
}

impl Plan {
    pub(super) fn new(set: Simulation, p: &Prediction, met: bool, wishes: &Wishes) -> Self {
        let raster = &set.raster;
        let frame = raster.pixels[1] as f64 / raster.line_rate_hz;
        let (size, gain) = (raster.nominal_size_nm, set.window.gain);
        let expected = |quantity: Quantity, unit: f64| Expected {
            statistical: unit * p.statistical(quantity),
            total: unit * p.sigma(quantity, |_| true),
        };
        Self {
            duration_s: raster.scans as f64 * (frame + raster.gap_s) - raster.gap_s,
            size_nm: [size[0] * gain[0], size[1] * gain[1]],
            drift_sigma_nm_per_min: 60.0 * p.drift_sigma(),
            twist_sigma_deg: expected(Quantity::Twist, 1f64.to_degrees()),
            strain_sigma_percent: expected(Quantity::Strain, 100.0),
            linked: p.linked,
            limited_by: limit(p, wishes),
            out_of_reach: out_of_reach(p, wishes),
            set,
            met,
        }
    }
}

/// Whether what no scan shows is more than the wish (rad, or strain).
pub(super) fn beyond(prediction: &Prediction, quantity: Quantity, wish: f64) -> bool {
    prediction.sigma(quantity, |s| !s.is_statistical()) >= wish
}

fn limit(p: &Prediction, wishes: &Wishes) -> Option<Limit> {
    let of = |quantity: Quantity, wish: f64| {
        let largest = Limit::Of(p.largest(quantity));
        (p.sigma(quantity, |_| true) / wish, largest)
    };
    let twist = wishes.twist_deg.map(f64::to_radians);
    let twist = twist.map(|wish| of(Quantity::Twist, wish));
    let strain = wishes.strain_percent.map(|wish| {
        let (share, largest) = of(Quantity::Strain, 1.0);
        (100.0 * share / wish, largest)
    });
    let drift = wishes.drift_nm_per_min;
    let drift = drift.map(|wish| (60.0 * p.drift_sigma() / wish, of_drift(p)));
    let all = [twist, strain, drift].into_iter().flatten();
    all.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, name)| name)
}

/// Exact times would make a clearly smaller error, or phases would.
fn of_drift(p: &Prediction) -> Limit {
    if !p.linked {
        Limit::Unlinked
    } else if p.drift_sigma_with_clock() < CLEARLY * p.drift_sigma() {
        Limit::FrameTimes
    } else {
        Limit::Of(Source::Image)
    }
}

fn out_of_reach(p: &Prediction, wishes: &Wishes) -> Vec<OutOfReach> {
    let wanted = [
        (Quantity::Twist, wishes.twist_deg, 1f64.to_degrees()),
        (Quantity::Strain, wishes.strain_percent, 100.0),
    ];
    let of = |(quantity, wish, unit): (Quantity, Option<f64>, f64)| {
        let wish = wish.filter(|wish| beyond(p, quantity, wish / unit))?;
        let by = |source: Source| unit * p.sigma(quantity, |s| s == source);
        let largest = Source::ALL
            .into_iter()
            .filter(|source| !source.is_statistical())
            .max_by(|a, b| by(*a).total_cmp(&by(*b)))?;
        Some(OutOfReach {
            is_twist: quantity == Quantity::Twist,
            wish,
            floor: unit * p.sigma(quantity, |s| !s.is_statistical()),
            largest: Limit::Of(largest),
            largest_sigma: by(largest),
        })
    };
    wanted.into_iter().filter_map(of).collect()
}
