//! Frame sizes and line rates, and the smallest number of scans that will do for each.

use moiregauge::plan::{FOUND, Prediction, Quantity, predict};
use moiregauge::settings::Settings;
use moiregauge::simulate::Simulation;
use rayon::prelude::*;

use super::wishes::Wishes;

/// Frame sizes, as multiples of that of the conditions.
const SIZES: [f64; 5] = [0.7, 1.0, 1.4, 2.0, 2.8];
/// Line rates, likewise.
const RATES: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
/// Numbers of scans: up and down in turn.
const SCANS: [usize; 11] = [2, 4, 6, 8, 10, 12, 16, 20, 24, 32, 40];
/// Orientations of the lattice over which variances are averaged.
const ORIENTATIONS: usize = 4;
/// Fewer periods across a frame, or pixels per period, are not planned for.
const FEWEST_PERIODS: f64 = 4.0;
const FEWEST_PIXELS: f64 = 5.0;

/// What the instrument can do.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Largest side of a frame, nm.
    pub(super) size_nm: f64,
    /// Largest line rate, Hz.
    pub(super) rate_hz: f64,
    /// The noise of a pixel does not depend on the line rate.
    pub(super) noise_per_pixel: bool,
}

/// One way of doing it.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// The scans, as conditions of a simulation.
    pub(super) set: Simulation,
    /// What they will tell.
    pub(super) prediction: Prediction,
    /// Whether the wishes are met, as far as scans can.
    pub(super) met: bool,
}

impl Plan {
    /// From the first line to the last, s.
    pub(super) fn duration_s(&self) -> f64 {
        let raster = &self.set.raster;
        let frame = raster.pixels[1] as f64 / raster.line_rate_hz;
        raster.scans as f64 * (frame + raster.gap_s) - raster.gap_s
    }

    /// Sides of a frame, nm.
    pub(super) fn size_nm(&self) -> [f64; 2] {
        let (size, gain) = (self.set.raster.nominal_size_nm, self.set.window.gain);
        [size[0] * gain[0], size[1] * gain[1]]
    }
}

/// The best plan first: those that meet the wishes, by their duration; then the others.
pub(super) fn plans(
    conditions: &Simulation,
    settings: &Settings,
    wishes: &Wishes,
    limits: &Limits,
) -> Vec<Plan> {
    let longest = (0..2)
        .map(|i| conditions.raster.nominal_size_nm[i] * conditions.window.gain[i])
        .fold(0.0, f64::max);
    let within = |value: f64, limit: f64| value <= limit * (1.0 + 1e-9);
    let frames: Vec<(f64, f64)> = SIZES
        .into_iter()
        .filter(|s| within(s * longest, limits.size_nm))
        .flat_map(|s| RATES.map(|r| (s, r)))
        .filter(|(_, r)| within(r * conditions.raster.line_rate_hz, limits.rate_hz))
        .collect();
    let mut plans: Vec<Plan> = frames
        .par_iter()
        .filter_map(|&(size, rate)| {
            let mut set = conditions.clone();
            set.raster.nominal_size_nm = set.raster.nominal_size_nm.map(|s| s * size);
            set.raster.line_rate_hz *= rate;
            set.raster.alternating = true;
            if !limits.noise_per_pixel {
                set.noise.pixel_deg *= rate.sqrt();
            }
            fewest_scans(&set, settings, wishes)
        })
        .collect();
    plans.sort_by(|a, b| {
        let times = a.duration_s().total_cmp(&b.duration_s());
        let error = |p: &Plan| p.prediction.statistical(Quantity::Twist);
        b.met.cmp(&a.met).then(if a.met {
            times
        } else {
            error(a).total_cmp(&error(b))
        })
    });
    plans
}

/// The smallest number of scans that meets the wishes, or the largest there is.
fn fewest_scans(set: &Simulation, settings: &Settings, wishes: &Wishes) -> Option<Plan> {
    let with = |scans: usize| {
        let mut set = set.clone();
        set.raster.scans = scans;
        let prediction = predict(&[set.clone()], settings, ORIENTATIONS)?;
        let met = meets(&prediction, wishes);
        Some(Plan {
            set,
            prediction,
            met,
        })
    };
    let first = with(SCANS[0])?;
    let period_pixels = {
        let [columns, rows] = set.raster.pixels;
        columns.min(rows) as f64 / first.prediction.periods
    };
    let visible = first.prediction.signal_to_noise >= FOUND
        && first.prediction.periods >= FEWEST_PERIODS
        && period_pixels >= FEWEST_PIXELS;
    if !visible {
        return None;
    }
    if first.met {
        return Some(first);
    }
    let mut best = with(SCANS[SCANS.len() - 1])?;
    let (mut low, mut high) = (0, SCANS.len() - 1);
    while best.met && high - low > 1 {
        let middle = usize::midpoint(low, high);
        let plan = with(SCANS[middle])?;
        if plan.met {
            (best, high) = (plan, middle);
        } else {
            low = middle;
        }
    }
    Some(best)
}

/// Whether the errors are those wanted; where what no scan shows exceeds a wish by itself, the statistical
/// error has to be as small.
fn meets(prediction: &Prediction, wishes: &Wishes) -> bool {
    let small = |quantity: Quantity, wish: Option<f64>| {
        wish.is_none_or(|wish| {
            let total = prediction.sigma(quantity, |_| true);
            total <= wish
                || (beyond(prediction, quantity, wish) && prediction.statistical(quantity) <= wish)
        })
    };
    let drift = wishes
        .drift_nm_per_min
        .is_none_or(|wish| 60.0 * prediction.drift_sigma() <= wish);
    drift
        && small(Quantity::Twist, wishes.twist_deg.map(f64::to_radians))
        && small(Quantity::Strain, wishes.strain_percent.map(|p| p / 100.0))
}

/// Whether what no scan shows is more than the wish (rad, or strain).
pub(super) fn beyond(prediction: &Prediction, quantity: Quantity, wish: f64) -> bool {
    prediction.sigma(quantity, |s| !s.is_statistical()) >= wish
}
