//! A drift that nothing tells, as a prior: none, more or less.
//!
//! A drift D tilts and stretches a lattice by `D uᵀ`, with u the time gradient: 1 over the slow speed along the slow axis. The
//! prior is of the sample and the same for every frame, so what it leaves open of a lattice is inversely proportional to the
//! slow speed: 1 nm/min is 2 % of a frame whose lines advance by 50 nm/min, and 0.1 % at 1000 nm/min. A frame that takes so
//! long that the prior would distort it by more than [`MOST`] shows no lattice by which anybody would have chosen it; there
//! the prior is that share of the slow speed.
//!
//! Without a line rate the slow speed is that of a usual one; without a frame direction the sense is open, and all frames
//! count as scanned in the same one, so that they do not make the error smaller.

use nalgebra::{Matrix2, Vector2};

use crate::campaign::means::{SetLattice, SetMean};
use crate::campaign::set::drift::at_velocity;
use crate::campaign::set::solved::Solved;
use crate::caveat::drifting::{AssumedDrift, DriftShare};
use crate::drift::linear::Observation;
use crate::meaning::budget::Source;
use crate::scan::measured::{MeasuredLine, MeasuredScan};
use crate::settings::knobs::Settings;

/// Lines per second that an unknown rate counts as: 1 over the root mean square of the time of a line, for rates between 0.5
/// and 10 Hz of which no octave is likelier than another, `⟨1/f²⟩ = (f₁⁻² − f₂⁻²)/(2 ln f₂/f₁)`.
const USUAL_RATE: f64 = 1.225;
/// The largest share of the slow speed that the prior is taken for: what [`crate::campaign::samples`] reckons with.
const MOST: f64 = 0.25;
/// nm/min → nm/s.
const PER_MINUTE: f64 = 1.0 / 60.0;

impl DriftShare {
    /// In the twist of a mean (°).
    pub(crate) fn of_mean(mean: &SetMean) -> Option<Self> {
        let degrees = |variance: f64| variance.sqrt().to_degrees();
        let without = mean.budget.sum(|source| source != Source::Drift);
        Some(Self {
            assumed: mean.assumed?,
            of: "twist",
            unit: "°",
            total: degrees(mean.budget.total().covariance[(0, 0)]),
            without: degrees(without.covariance[(0, 0)]),
        })
    }

    /// In the first length of a lattice (nm).
    pub(crate) fn of_lattice(found: &SetLattice) -> Option<Self> {
        Some(Self {
            assumed: found.assumed?,
            of: "length of L₁",
            unit: " nm",
            total: found.wavelengths[0].total,
            without: found.without_drift,
        })
    }
}

/// The lattice of the scans at no drift with the error of the prior.
pub(crate) fn assumed(
    scans: &[&MeasuredScan],
    all: &[Observation],
    settings: &Settings,
) -> Option<Solved> {
    let lines = scans
        .iter()
        .flat_map(|scan| scan.lines.iter().map(|line| (line, scan.line_rate_hz)));
    let timed: Vec<Observation> = all
        .iter()
        .zip(lines)
        .map(|(seen, (line, rate))| Observation {
            time_gradient: match line.timing {
                Some(_) => seen.time_gradient,
                None => usual_gradient(line, rate),
            },
            ..*seen
        })
        .collect();
    let steepest = timed.iter().map(|seen| seen.time_gradient.norm());
    let steepest = steepest.fold(f64::MIN_POSITIVE, f64::max);
    let sigma = (settings.drift_prior_nm_per_min * PER_MINUTE).min(MOST / steepest);
    let covariance = Matrix2::identity() * sigma * sigma;
    let timeless = |scan: &&&MeasuredScan| scan.lines.iter().any(|line| line.timing.is_none());
    let mut without = scans.iter().filter(timeless);
    let no_rate = without.any(|scan| scan.line_rate_hz.is_none());
    Some(Solved {
        assumed: Some(AssumedDrift { sigma, no_rate }),
        ..at_velocity(&timed, Vector2::zeros(), covariance)?
    })
}

/// The time gradient of lines whose time is not known, upwards.
fn usual_gradient(line: &MeasuredLine, rate: Option<f64>) -> Vector2<f64> {
    let step = line.geometry.slow_step();
    step / (step.norm_squared() * rate.unwrap_or(USUAL_RATE))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of 1/f² over rates whose logarithm is even between 0.5 and 10 Hz, summed up.
    #[test]
    fn the_usual_rate_is_that_of_its_range() {
        let steps = 100_000;
        let square = |i: i32| {
            let place = (f64::from(i) + 0.5) / f64::from(steps);
            (0.5 * 20_f64.powf(place)).powi(-2)
        };
        let mean = (0..steps).map(square).sum::<f64>() / f64::from(steps);
        assert!((USUAL_RATE * mean.sqrt() - 1.0).abs() < 1e-3, "{mean}");
    }
}
