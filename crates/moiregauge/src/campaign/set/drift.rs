//! The drift of a set as a constant velocity: given, published, or the linear solution.

use heterostrain::lattice::Lattice;
use nalgebra::{Matrix2, Vector2};

use crate::campaign::motion::{Drift, DriftFit};
use crate::campaign::set::headers::about_dates;
use crate::campaign::set::published;
use crate::campaign::set::solved::Solved;
use crate::caveat::Caveat;
use crate::caveat::drifting::DriftDoubt;
use crate::drift::linear::{DriftSolution, Observation, at_known_drift, common_lattice, solve};
use crate::drift::monte_carlo;
use crate::drift::paper::successive_drift;
use crate::drift::shares::Statistical;
use crate::numbers::chi2::enlargement;
use crate::scan::measured::MeasuredScan;
use crate::settings::knobs::{GivenDrift, Settings};
use crate::spectrum::method::Method;

/// A drift outruns the scan if it does so beyond this many standard errors.
const OUTRUN_SIGMAS: f64 = 2.0;
/// A lattice whose vectors are not known to this share of themselves has no twist: what is linear in the errors is not any more.
const KNOWN_TO: f64 = 0.2;
/// nm/min → nm/s.
const PER_MINUTE: f64 = 1.0 / 60.0;

/// The drift and the lattice of the scans of a set; where they do not tell them, why not (no word without scans).
pub(crate) fn constant_drift(
    name: &str,
    scans: &[&MeasuredScan],
    all: &[Observation],
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) -> Result<Solved, Option<DriftDoubt>> {
    if scans.is_empty() {
        return Err(None);
    }
    if scans
        .iter()
        .any(|s| s.lines.iter().any(|l| l.timing.is_none()))
    {
        return Err(Some(DriftDoubt::NoTiming { assumed: None }));
    }
    caveats.extend(about_dates(name, scans));
    if let Some(given) = settings.drift {
        return given_drift(name, all, given, caveats).ok_or(None);
    }
    match solve(all) {
        Ok(solution) if settings.method != Method::Paper => {
            linear_drift(name, scans, all, &solution, settings).ok_or(None)
        }
        Ok(solution) => {
            let scans = published::paper_scans(scans, all);
            published::drift(name, &scans, all, &solution, settings)
                .map_err(|reason| Some(DriftDoubt::undetermined(reason)))
        }
        Err(error) => Err(Some(DriftDoubt::undetermined(error.to_string()))),
    }
}

/// The linear solution, its errors enlarged for scatter.
fn linear_drift(
    name: &str,
    scans: &[&MeasuredScan],
    all: &[Observation],
    solution: &DriftSolution,
    settings: &Settings,
) -> Option<Solved> {
    let scale = enlargement(solution.chi2, solution.degrees_of_freedom);
    let mut lattice = solution.lattice;
    lattice.covariance *= scale;
    let statistical = Statistical::at_known_drift(at_known_drift(all)?, scale, &lattice.covariance);
    let stream = format!("drift {name}");
    Some(Solved {
        drift: Drift {
            velocity: solution.velocity,
            covariance: solution.covariance * scale,
            given: false,
            fit: Some(DriftFit {
                rank: solution.rank,
                condition: solution.condition,
                chi2: solution.chi2,
                degrees_of_freedom: solution.degrees_of_freedom,
                paper_velocity: successive_drift(&published::paper_scans(scans, all)),
            }),
            monte_carlo: monte_carlo(all, settings.drift_draws, settings.seed, &stream),
            joint: None,
        },
        lattice,
        statistical,
        chi2: solution.chi2,
        freedom: solution.degrees_of_freedom,
        assumed: None,
        enlargement: scale,
    })
}

/// Drift over the speed of the slow scan where it is more than 1 beyond its errors: the sample outruns the tip, and each frame is a mirror image. No
/// instrument drifts like this; the lattice is another one than the scans were taken to show.
pub(crate) fn outruns(drift: &Drift, all: &[Observation]) -> Option<f64> {
    let beyond = |seen: &Observation| {
        let u = seen.time_gradient;
        let sigma = u.dot(&(drift.covariance * u)).max(0.0).sqrt();
        let share = u.dot(&drift.velocity).abs();
        (!drift.given && share - OUTRUN_SIGMAS * sigma > 1.0).then_some(share)
    };
    all.iter().filter_map(beyond).max_by(f64::total_cmp)
}

/// The share of a moiré vector that its error is, where a corrected lattice is not known to better than [`KNOWN_TO`].
pub(crate) fn unknown(lattice: &Lattice) -> Option<f64> {
    let of_vector = |i: usize| {
        let covariance = lattice.covariance.fixed_view::<2, 2>(2 * i, 2 * i);
        let largest = covariance.into_owned().symmetric_eigenvalues().max();
        largest.max(0.0).sqrt() / lattice.basis.column(i).norm()
    };
    let share = of_vector(0).max(of_vector(1));
    (share > KNOWN_TO).then_some(share)
}

fn given_drift(
    name: &str,
    all: &[Observation],
    given: GivenDrift,
    caveats: &mut Vec<Caveat>,
) -> Option<Solved> {
    let sigma = given.sigma_nm_per_min * PER_MINUTE;
    caveats.push(Caveat::new(DriftDoubt::Given, name));
    at_velocity(all, given.velocity(), Matrix2::identity() * sigma * sigma)
}

/// The lattice at a drift that is not measured.
pub(crate) fn at_velocity(
    all: &[Observation],
    velocity: Vector2<f64>,
    covariance: Matrix2<f64>,
) -> Option<Solved> {
    let (mut lattice, chi2, freedom) = common_lattice(all, &velocity, &covariance).ok()?;
    // Scatter enlarges the error of what was measured, not that of the drift.
    let (measured, _, _) = common_lattice(all, &velocity, &Matrix2::zeros()).ok()?;
    let scale = enlargement(chi2, freedom);
    lattice.covariance += measured.covariance * (scale - 1.0);
    let parts = at_known_drift(all)?;
    Some(Solved {
        drift: Drift {
            velocity,
            covariance,
            given: true,
            fit: None,
            monte_carlo: None,
            joint: None,
        },
        statistical: Statistical::at_known_drift(parts, scale, &lattice.covariance),
        lattice,
        chi2,
        freedom,
        assumed: None,
        enlargement: scale,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix4;

    /// Up and down at 1 nm/s: a drift along the slow axis outruns the tip, one along the fast axis does not, nor one that is hardly known.
    #[test]
    fn only_a_drift_along_the_slow_axis_outruns_the_scan() {
        let seen = [1.0, -1.0].map(|sense| Observation {
            lattice: Lattice::new(Matrix2::identity(), Matrix4::zeros()),
            time_gradient: Vector2::new(1e-3, sense),
            speed_error: [0.0; 2],
            sensor: Matrix4::zeros(),
        });
        let share = |velocity: [f64; 2], sigma: f64, given: bool| {
            let drift = Drift {
                velocity: Vector2::from(velocity),
                covariance: Matrix2::identity() * sigma * sigma,
                given,
                fit: None,
                monte_carlo: None,
                joint: None,
            };
            outruns(&drift, &seen)
        };
        let found = share([0.0, -1.5], 0.1, false).unwrap();
        assert!((found - 1.5).abs() < 1e-12, "{found}");
        assert_eq!(share([1.5, 0.0], 0.1, false), None);
        assert_eq!(share([0.0, 0.9], 0.01, false), None);
        assert_eq!(share([0.0, 1.5], 0.4, false), None);
        assert_eq!(share([0.0, 1.5], 0.1, true), None);
    }

    /// A vector of 10 nm along x, its error of 2.2 nm along y: 22 % of itself are open.
    #[test]
    fn a_vector_that_is_hardly_known_is_told() {
        let known = |sigma: f64| {
            let mut covariance = Matrix4::zeros();
            covariance[(1, 1)] = sigma * sigma;
            unknown(&Lattice::new(Matrix2::identity() * 10.0, covariance))
        };
        assert_eq!(known(1.9), None);
        assert!((known(2.2).unwrap() - 0.22).abs() < 1e-12);
    }
}
