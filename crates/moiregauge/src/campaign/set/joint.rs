//! The joint fit of the scans of a set, and which of them do not fit.

use heterostrain::lattice::{Lattice, Waves, labelled_like, reciprocal};
use heterostrain::strain::twist_strain;
use nalgebra::{Matrix2, Vector2};
use spmfile::FrameDirection;

use crate::campaign::analysis::ScanAnalysis;
use crate::campaign::means::{Checks, Residual, Scatter};
use crate::campaign::motion::{Drift, JointTerms};
use crate::campaign::set::headers::about_headers;
use crate::campaign::set::solved::Solved;
use crate::campaign::sightings::sightings;
use crate::caveat::Caveat;
use crate::caveat::sets::SetDoubt;
use crate::drift::joint::checks::{LeftOut, Resampled};
use crate::drift::joint::choose::fit;
use crate::drift::joint::found::JointFit;
use crate::drift::linear::{Observation, solve};
use crate::drift::shares::Statistical;
use crate::numbers::chi2::{enlargement, tail};
use crate::numbers::spread::mean_and_spread;
use crate::scan::measured::MeasuredScan;
use crate::settings::knobs::Settings;

/// A scan stands out if chance makes its χ² less often than this, divided by the number of scans: one good set in a
/// thousand has such a one.
const OUTLYING: f64 = 1e-3;
/// Fewer scans than this have nobody to tell which of them is odd: of three any one may be. See docs/constants.md.
const FEWEST: usize = 4;
/// Pairs of up and down scans from which a bootstrap says something: three have ten different draws only.
const FEWEST_PAIRS: usize = 4;

/// The linear solution refined by the joint fit, with doubts about headers that contradict it.
pub(crate) fn refined(
    name: &str,
    linear: Solved,
    used: &[&MeasuredScan],
    reference: &Matrix2<f64>,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) -> (Solved, Option<JointFit>) {
    let (lattice, velocity) = (linear.lattice, linear.drift.velocity);
    let (solved, fit) = jointly(linear, used, reference, settings);
    let doubts = fit
        .as_ref()
        .and_then(|fit| about_headers(name, used, reference, &lattice, &velocity, fit, settings));
    caveats.extend(doubts);
    (solved, fit)
}

/// Refines the linear solution of a set with the phases of its scans; keeps it where they do not help.
/// Also returns the fit.
fn jointly(
    linear: Solved,
    scans: &[&MeasuredScan],
    reference: &Matrix2<f64>,
    settings: &Settings,
) -> (Solved, Option<JointFit>) {
    let (lattice, velocity) = (&linear.lattice, &linear.drift.velocity);
    let found = joint_fit(scans, reference, lattice, velocity, settings)
        .and_then(|fit| Some((lattice_of(&fit, reference)?, fit)));
    let Some(((lattice, statistical), fit)) = found else {
        return (linear, None);
    };
    let solved = Solved {
        drift: Drift {
            velocity: fit.velocity,
            covariance: fit.velocity_covariance,
            joint: Some(terms(&fit)),
            ..linear.drift
        },
        lattice,
        statistical,
        chi2: fit.chi2,
        freedom: fit.degrees_of_freedom,
        assumed: None,
        enlargement: enlargement(fit.chi2, fit.degrees_of_freedom),
    };
    (solved, Some(fit))
}

/// The joint fit of some scans, numbered as they are given, from a lattice and a drift nearby; `None` without timing.
pub(crate) fn joint_fit(
    scans: &[&MeasuredScan],
    reference: &Matrix2<f64>,
    lattice: &Lattice,
    velocity: &Vector2<f64>,
    settings: &Settings,
) -> Option<JointFit> {
    let sightings = sightings(scans, reference)?;
    let waves = labelled_like(&lattice.waves()?, &reciprocal(reference)?);
    let time_sigma = settings.frame_time_sigma_s;
    fit(&sightings, &waves.basis, velocity, time_sigma)
}

/// The lattice of a joint fit (nm) and where its covariance comes from.
pub(crate) fn lattice_of(
    fit: &JointFit,
    reference: &Matrix2<f64>,
) -> Option<(Lattice, Statistical)> {
    let real = |covariance| {
        let waves = Waves::new(fit.waves.basis, covariance);
        Some(labelled_like(&waves.lattice()?, reference))
    };
    let parts = fit.statistical()?;
    let statistical = Statistical {
        image: real(parts.image)?.covariance,
        drift: real(parts.drift)?.covariance,
        sensor: real(parts.sensor)?.covariance,
    };
    Some((real(fit.waves.covariance)?, statistical))
}

/// What a joint fit has beside a constant drift.
pub(crate) fn terms(fit: &JointFit) -> JointTerms {
    JointTerms {
        phases: fit.terms.phases,
        acceleration: fit.acceleration,
        settling_s: fit.terms.settling,
        fast_gain: fit.fast_gain,
        instability_nm: fit.instability_nm,
        tested: fit.tested.clone(),
    }
}

/// The errors by the scatter of the `used` scans; tells each of `scans` how it lies against the others.
pub(crate) fn checked(
    fit: &JointFit,
    scans: &mut [ScanAnalysis],
    used: &[&MeasuredScan],
    name: &str,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) -> Checks {
    let left_out = fit.leave_one_out();
    let residuals = residuals(&left_out);
    for (one, residual) in left_out.iter().zip(residuals) {
        let file = &used[one.scan].file;
        if let Some(scan) = scans.iter_mut().find(|s| s.file == *file) {
            scan.residual = Some(residual);
            about_residual(file, &residual, settings, caveats);
        }
    }
    checks(fit, &left_out, used, name, settings)
}

/// How each scan lies against the others.
fn residuals(left_out: &[LeftOut]) -> Vec<Residual> {
    let share = OUTLYING / left_out.len() as f64;
    left_out
        .iter()
        .map(|one| {
            let (rest, freedom) = one.rest;
            let scale = (rest / freedom.max(1) as f64).max(1.0);
            let p_value = tail(one.chi2 / scale, one.degrees_of_freedom);
            Residual {
                chi2: one.chi2,
                degrees_of_freedom: one.degrees_of_freedom,
                p_value,
                displacement: one.displacement,
                outlying: left_out.len() >= FEWEST && p_value < share,
            }
        })
        .collect()
}

/// Says which scan does not fit.
fn about_residual(file: &str, residual: &Residual, settings: &Settings, caveats: &mut Vec<Caveat>) {
    if !residual.outlying {
        return;
    }
    caveats.push(Caveat::new(
        SetDoubt::OutlyingScan {
            chi_squared: residual.chi2,
            degrees_of_freedom: residual.degrees_of_freedom,
            p_value: residual.p_value,
            displacement: residual.displacement.map(|d| d.norm()),
            by_rule: settings.exclude_outliers,
        },
        file,
    ));
}

/// Leaves out scans that do not fit the others: one after the other, worst first, no more than a
/// fifth of them. Returns their indices.
pub(crate) fn outliers(
    scans: &[&MeasuredScan],
    observations: &[&[Observation]],
    reference: &Matrix2<f64>,
    settings: &Settings,
) -> Vec<usize> {
    let mut kept: Vec<usize> = (0..scans.len()).collect();
    let mut out = Vec::new();
    while out.len() < scans.len() / 5 {
        let all: Vec<Observation> = kept
            .iter()
            .flat_map(|&i| observations[i])
            .copied()
            .collect();
        let of: Vec<&MeasuredScan> = kept.iter().map(|&i| scans[i]).collect();
        let Ok(linear) = solve(&all) else { break };
        let (lattice, velocity) = (&linear.lattice, &linear.velocity);
        let Some(fit) = joint_fit(&of, reference, lattice, velocity, settings) else {
            break;
        };
        let left_out = fit.leave_one_out();
        let found = residuals(&left_out);
        let worst = (0..found.len())
            .filter(|&i| found[i].outlying)
            .min_by(|&a, &b| found[a].p_value.total_cmp(&found[b].p_value));
        let Some(worst) = worst else { break };
        out.push(kept.remove(left_out[worst].scan));
    }
    out
}

/// Errors from the scatter of the scans.
pub(crate) fn checks(
    fit: &JointFit,
    left_out: &[LeftOut],
    scans: &[&MeasuredScan],
    name: &str,
    settings: &Settings,
) -> Checks {
    let n = left_out.len() as f64;
    let leave_one_out = (left_out.len() >= FEWEST)
        .then(|| {
            let all: Vec<Resampled> = left_out.iter().map(|l| l.without).collect();
            scatter(fit, &all, settings, &|values| {
                mean_and_spread(values).sigma * (n - 1.0) / n.sqrt()
            })
        })
        .flatten();
    let pairs = pairs(scans);
    let draws = settings.strain_draws;
    let bootstrap = (pairs.len() >= FEWEST_PAIRS && draws >= 100)
        .then(|| {
            let m = pairs.len() as f64;
            let name = format!("bootstrap {name}");
            let all = fit.bootstrap(&pairs, draws, settings.seed, &name);
            scatter(fit, &all, settings, &|values| {
                half_width(values) * (m / (m - 1.0)).sqrt()
            })
        })
        .flatten();
    Checks {
        leave_one_out,
        bootstrap,
    }
}

/// Up and down scans in pairs, in order of time, within their sets; what is left over stands alone.
fn pairs(scans: &[&MeasuredScan]) -> Vec<Vec<usize>> {
    let mut pairs: Vec<Vec<usize>> = Vec::new();
    for (i, scan) in scans.iter().enumerate() {
        let fits = |other: &&MeasuredScan| {
            let opposite = matches!(
                (other.frame_direction, scan.frame_direction),
                (Some(FrameDirection::Up), Some(FrameDirection::Down))
                    | (Some(FrameDirection::Down), Some(FrameDirection::Up))
            );
            let axis = |s: &MeasuredScan| s.lines.first().map(|l| l.geometry.slow_axis());
            opposite && axis(other) == axis(scan)
        };
        match pairs.last_mut() {
            Some(last) if last.len() == 1 && fits(&scans[last[0]]) => last.push(i),
            _ => pairs.push(vec![i]),
        }
    }
    pairs
}

/// The spread of drift, twist and strain over results.
fn scatter(
    fit: &JointFit,
    all: &[Resampled],
    settings: &Settings,
    spread: &dyn Fn(&[f64]) -> f64,
) -> Option<Scatter> {
    let strains: Vec<_> = all
        .iter()
        .filter_map(|one| {
            let waves = Waves::new(one.waves, fit.waves.covariance);
            let lattice = waves.lattice()?;
            twist_strain(&lattice, settings.bilayer(), settings.strain_convention).ok()
        })
        .collect();
    if strains.len() < 2 {
        return None;
    }
    let of_drift = |i: usize| spread(&all.iter().map(|one| one.velocity[i]).collect::<Vec<_>>());
    let of_strain = |i: usize| {
        let values: Vec<f64> = strains.iter().map(|s| s.strain_vector[i]).collect();
        spread(&values)
    };
    Some(Scatter {
        drift: [of_drift(0), of_drift(1)],
        twist: spread(&strains.iter().map(|s| s.twist).collect::<Vec<_>>()),
        strain: [of_strain(0), of_strain(1)],
    })
}

/// Half the width of the middle 68.27 %: the σ of a normal distribution, deaf to a few wild draws.
fn half_width(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
    (at(0.841_345) - at(0.158_655)) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half widths of a normal distribution, from its quantiles.
    #[test]
    fn half_width_of_even_quantiles() {
        let values: Vec<f64> = (0..=1000).map(f64::from).collect();
        assert!((half_width(&values) - 341.5).abs() <= 1.0);
    }
}
