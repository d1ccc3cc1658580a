//! Frame sizes and line rates, and the smallest number of scans that will do for each.

use moiregauge::numbers::interrupt;
use moiregauge::plan::{FOUND, Prediction, Quantity, predict};
use moiregauge::settings::Settings;
use moiregauge::simulate::Simulation;
use rayon::prelude::*;

use super::found::{Plan, Plans, beyond};
use super::request::{PlanError, PlanRequest, Wishes};
use crate::job::Job;

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

/// For several frame sizes and line rates the smallest number of alternating scans that gives the wanted errors.
///
/// # Errors
/// [`PlanError`].
///
/// ```
/// use moiregauge_pipeline::Job;
/// use moiregauge_pipeline::plan::{PlanRequest, Wishes, plan};
///
/// let wishes = Wishes { drift_nm_per_min: Some(0.1), ..Wishes::default() };
/// let request = PlanRequest { wishes, ..PlanRequest::default() };
/// let best = &plan(&request, &Job::quiet(None)?)?.plans[0];
/// assert!(best.met && best.drift_sigma_nm_per_min < 0.1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn plan(request: &PlanRequest, job: &Job) -> Result<Plans, PlanError> {
    request.check()?;
    let request = request.completed();
    let mut found = job.run(|| candidates(&request))?;
    found.sort_by(|(a, a_error), (b, b_error)| {
        let times = a.duration_s.total_cmp(&b.duration_s);
        b.met.cmp(&a.met).then(if a.met {
            times
        } else {
            a_error.total_cmp(b_error)
        })
    });
    let plans: Vec<Plan> = found.into_iter().map(|(plan, _)| plan).collect();
    if plans.is_empty() {
        return Err(PlanError::NoFrame);
    }
    Ok(Plans {
        conditions: request.conditions,
        settings: request.settings,
        wishes: request.wishes,
        plans,
    })
}

/// A plan for each size and rate that would do, with the statistical error of the twist, rad.
fn candidates(request: &PlanRequest) -> Vec<(Plan, f64)> {
    let (conditions, wishes) = (&request.conditions, &request.wishes);
    let raster = &conditions.raster;
    let longest = (0..2)
        .map(|i| raster.nominal_size_nm[i] * conditions.window.gain[i])
        .fold(0.0, f64::max);
    let largest = request.max_size_nm.unwrap_or(2.0 * longest);
    let fastest = request.max_rate_hz.unwrap_or(2.0 * raster.line_rate_hz);
    let within = |value: f64, limit: f64| value <= limit * (1.0 + 1e-9);
    let frames: Vec<(f64, f64)> = SIZES
        .into_iter()
        .filter(|s| within(s * longest, largest))
        .flat_map(|s| RATES.map(|r| (s, r)))
        .filter(|(_, r)| within(r * raster.line_rate_hz, fastest))
        .collect();
    let of_frame = |&(size, rate): &(f64, f64)| {
        interrupt::check();
        let mut set = conditions.clone();
        set.raster.nominal_size_nm = set.raster.nominal_size_nm.map(|s| s * size);
        set.raster.line_rate_hz *= rate;
        set.raster.alternating = true;
        if !request.noise_per_pixel {
            set.noise.pixel_deg *= rate.sqrt();
        }
        let found = fewest_scans(&set, &request.settings, wishes)?;
        let error = found.prediction.statistical(Quantity::Twist);
        let plan = Plan::new(found.set, &found.prediction, found.met, wishes);
        Some((plan, error))
    };
    frames.par_iter().filter_map(of_frame).collect()
}

/// A number of scans, and what they will tell.
struct Candidate {
    set: Simulation,
    prediction: Prediction,
    met: bool,
}

/// The smallest number of scans that meets the wishes, or the largest there is.
fn fewest_scans(set: &Simulation, settings: &Settings, wishes: &Wishes) -> Option<Candidate> {
    let with = |scans: usize| {
        let mut set = set.clone();
        set.raster.scans = scans;
        let prediction = predict(&[set.clone()], settings, ORIENTATIONS)?;
        let met = meets(&prediction, wishes);
        Some(Candidate {
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
