//! One set: drift, and every scan before and after correction.

use heterostrain::lattice::{Lattice, Waves};
use heterostrain::strain::{TwistStrain, draws};
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;
use spmfile::FrameDirection;

use crate::campaign::analysis::{Drift, DriftFit, ScanAnalysis, SetAnalysis, SetMean};
use crate::campaign::group::Group;
use crate::campaign::set::about::{about_checks, about_mean, about_readings, about_residual};
use crate::campaign::set::headers::{about_dates, about_headers};
use crate::campaign::set::moire::moire;
use crate::campaign::set::scan::{plain_mean, scan_analysis};
use crate::campaign::set::solved::Solved;
use crate::campaign::set::{joint, moire, published};
use crate::caveat::Caveat;
use crate::caveat::drifting::DriftDoubt;
use crate::caveat::sets::SetDoubt;
use crate::drift::joint::solve::JointFit;
use crate::drift::linear::{Observation, at_known_drift, common_lattice, solve};
use crate::drift::monte_carlo;
use crate::drift::paper::successive_drift;
use crate::drift::shares::Statistical;
use crate::meaning::budget::Budget;
use crate::meaning::readings::Readings;
use crate::meaning::strengths::WaveStrengths;
use crate::numbers::chi2::enlargement;
use crate::numbers::rng::normals;
use crate::numbers::spread::mean_and_spread;
use crate::scan::measured::MeasuredScan;
use crate::settings::knobs::{GivenDrift, Settings};
use crate::spectrum::method::Method;

/// nm/min → nm/s.
const PER_MINUTE: f64 = 1.0 / 60.0;

/// Everything about one set but its illustration; the settings name the waves of the lattice. `first_index` numbers its scans for the draws.
/// Scans that are left out by rule are marked in the group.
pub(crate) fn analyse_set(
    group: &mut Group,
    reference: &Matrix2<f64>,
    settings: &Settings,
    strengths: &WaveStrengths,
    first_index: u64,
    caveats: &mut Vec<Caveat>,
) -> SetAnalysis {
    let observations: Vec<Vec<Observation>> = group
        .scans
        .iter()
        .map(|scan| observations(scan, reference))
        .collect();
    let joint = settings.method.is_joint() && settings.drift.is_none();
    if joint && settings.exclude_outliers {
        leave_out(group, &observations, reference, settings, caveats);
    }
    let kept: Vec<usize> = (0..group.scans.len())
        .filter(|&i| group.scans[i].excluded.is_none())
        .collect();
    let used: Vec<&MeasuredScan> = kept.iter().map(|&i| &group.scans[i]).collect();
    let all: Vec<Observation> = kept
        .iter()
        .flat_map(|&i| &observations[i])
        .copied()
        .collect();
    let (solved, fit) = match drift((&group.name, &used), &all, settings, caveats) {
        Some(linear) if joint => {
            let (solved, fit) = refined(&group.name, linear, &used, reference, settings, caveats);
            (Some(solved), fit)
        }
        linear => (linear, None),
    };
    let mut scans: Vec<ScanAnalysis> = group
        .scans
        .iter()
        .zip(&observations)
        .filter_map(|(scan, seen)| {
            let drift = solved.as_ref().map(|s| {
                let own = fit.as_ref().and_then(|fit| joint::velocity_of(fit, scan));
                own.unwrap_or((s.drift.velocity, s.drift.covariance))
            });
            let found = scan_analysis(scan, seen, reference, drift, settings)?;
            Some(joint::with_motion(found, fit.as_ref(), scan))
        })
        .collect();
    let checks = fit.as_ref().map(|fit| {
        let left_out = fit.leave_one_out();
        let residuals = joint::residuals(&left_out);
        for (one, residual) in left_out.iter().zip(residuals) {
            let file = &used[one.scan].file;
            if let Some(scan) = scans.iter_mut().find(|s| s.file == *file) {
                scan.residual = Some(residual);
                about_residual(file, &residual, settings, caveats);
            }
        }
        joint::checks(fit, &left_out, &used, (&group.name, settings))
    });
    draw(&mut scans, settings, first_index);
    if let (Method::Paper, Some(solved)) = (settings.method, &solved) {
        let drift = (solved.drift.velocity, solved.drift.covariance);
        let measured = (group.scans.as_slice(), observations.as_slice());
        published::draw_all(&mut scans, measured, drift, settings, first_index);
    }
    let of_set = || scans.iter().filter(|s| s.excluded.is_none());
    let uncorrected = without_drift(&all, &scans, kept.len(), settings, strengths);
    let mean = solved.as_ref().and_then(|s| {
        let of = |s: &ScanAnalysis| (s.twist_strain, s.drift_corrected.unwrap_or(s.sensor));
        set_mean(
            ((s.lattice, s.chi2, s.freedom), s.enlargement),
            &s.statistical,
            of_set().map(of),
            settings,
            strengths,
        )
    });
    let drift = solved.map(|s| s.drift);
    about_mean(&group.name, mean.as_ref(), caveats);
    let shown = mean.as_ref().or(uncorrected.as_ref());
    if let Some(m) = shown {
        caveats.extend(about_readings(&group.name, m, settings));
    }
    moire::doubts(&group.name, shown, &scans, settings, caveats);
    about_checks(
        &group.name,
        (checks.as_ref(), drift.as_ref(), mean.as_ref()),
        kept.len(),
        caveats,
    );
    SetAnalysis {
        name: group.name.clone(),
        slow_axis: group.slow_axis,
        line_rate_hz: group.line_rate_hz,
        channel: group.channel.clone(),
        forward_backward: forward_backward(&of_set().collect::<Vec<_>>(), settings),
        scans,
        drift,
        mean,
        uncorrected,
        checks,
        illustration: None,
    }
}

/// The mean of the `used` scans as if nothing drifted, with the errors that drift adds left out.
fn without_drift(
    all: &[Observation],
    scans: &[ScanAnalysis],
    used: usize,
    settings: &Settings,
    strengths: &WaveStrengths,
) -> Option<SetMean> {
    let common = common_lattice(all, &Vector2::zeros(), &Matrix2::zeros()).ok()?;
    let [image, sensor] = at_known_drift(all)?;
    let statistical = Statistical::without_drift(&image, &sensor);
    // The scatter of several scans is that of their drift; that of the two lines of one is not.
    let (_, chi2, freedom) = common;
    let scale = if used == 1 {
        enlargement(chi2, freedom)
    } else {
        1.0
    };
    let (common, statistical) = moire::enlarged(common, &statistical, scale);
    let of_set = scans.iter().filter(|s| s.excluded.is_none());
    let of = |s: &ScanAnalysis| (s.twist_strain_sensor, s.sensor);
    set_mean(
        (common, scale),
        &statistical,
        of_set.map(of),
        settings,
        strengths,
    )
}

/// Draws twist and strain of every scan.
fn draw(scans: &mut [ScanAnalysis], settings: &Settings, first_index: u64) {
    scans.par_iter_mut().enumerate().for_each(|(i, scan)| {
        let lattice = scan.drift_corrected.as_ref().unwrap_or(&scan.sensor);
        if moire(lattice, settings).is_none() {
            return;
        }
        scan.draws = draws(
            lattice,
            settings.bilayer(),
            settings.strain_convention,
            settings.strain_draws,
            normals(settings.seed, "strain", first_index + i as u64),
        );
    });
}

/// The linear solution refined by the joint fit, with doubts about headers that contradict it.
fn refined(
    name: &str,
    linear: Solved,
    used: &[&MeasuredScan],
    reference: &Matrix2<f64>,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) -> (Solved, Option<JointFit>) {
    let (lattice, velocity) = (linear.lattice, linear.drift.velocity);
    let (solved, fit) = joint::jointly(linear, used, reference, settings);
    let doubts = fit
        .as_ref()
        .and_then(|fit| about_headers(name, used, reference, &lattice, &velocity, fit, settings));
    caveats.extend(doubts);
    (solved, fit)
}

/// Marks the scans that do not fit the others.
fn leave_out(
    group: &mut Group,
    observations: &[Vec<Observation>],
    reference: &Matrix2<f64>,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) {
    let kept: Vec<usize> = (0..group.scans.len())
        .filter(|&i| group.scans[i].excluded.is_none())
        .collect();
    let scans: Vec<&MeasuredScan> = kept.iter().map(|&i| &group.scans[i]).collect();
    let seen: Vec<&[Observation]> = kept.iter().map(|&i| observations[i].as_slice()).collect();
    for i in joint::outliers(&scans, &seen, reference, settings) {
        let scan = &mut group.scans[kept[i]];
        let reason = "it does not fit the others (leave-one-out χ², p < 0.001 divided by the number \
                      of scans)";
        scan.excluded = Some(reason.to_owned());
        caveats.push(Caveat::new(
            SetDoubt::ScanLeftOut {
                reason: reason.to_owned(),
            },
            &scan.file,
        ));
    }
}

fn observations(scan: &MeasuredScan, reference: &Matrix2<f64>) -> Vec<Observation> {
    scan.lines
        .iter()
        .map(|line| line.observation(reference))
        .collect()
}

pub(crate) fn drift(
    (name, scans): (&str, &[&MeasuredScan]),
    all: &[Observation],
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) -> Option<Solved> {
    if scans.is_empty() {
        return None;
    }
    if scans
        .iter()
        .any(|s| s.lines.iter().any(|l| l.timing.is_none()))
    {
        caveats.push(Caveat::new(DriftDoubt::NoTiming, name));
        return None;
    }
    caveats.extend(about_dates(name, scans));
    if let Some(given) = settings.drift {
        return given_drift(name, all, given, caveats);
    }
    match solve(all) {
        Ok(solution) if settings.method == Method::Paper => {
            let scans = published::paper_scans(scans, all);
            published::drift((name, &scans), all, &solution, settings, caveats)
        }
        Ok(solution) => {
            let scale = enlargement(solution.chi2, solution.degrees_of_freedom);
            let mut lattice = solution.lattice;
            lattice.covariance *= scale;
            let statistical =
                Statistical::at_known_drift(at_known_drift(all)?, scale, &lattice.covariance);
            let seed = settings.seed;
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
                    monte_carlo: monte_carlo(all, settings.drift_draws, seed, &stream),
                    joint: None,
                },
                lattice,
                statistical,
                chi2: solution.chi2,
                freedom: solution.degrees_of_freedom,
                enlargement: scale,
            })
        }
        Err(error) => {
            let reason = error.to_string();
            caveats.push(Caveat::new(DriftDoubt::Undetermined { reason }, name));
            None
        }
    }
}

fn given_drift(
    name: &str,
    all: &[Observation],
    given: GivenDrift,
    caveats: &mut Vec<Caveat>,
) -> Option<Solved> {
    let velocity = given.velocity();
    let sigma = given.sigma_nm_per_min * PER_MINUTE;
    let covariance = Matrix2::identity() * sigma * sigma;
    caveats.push(Caveat::new(DriftDoubt::Given, name));
    let (mut lattice, chi2, freedom) = common_lattice(all, &velocity, &covariance).ok()?;
    // Scatter enlarges what the scans say, not what the user said of the drift.
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
        enlargement: scale,
    })
}

/// Twist and strain of the common lattice, and how the scans scatter about it.
fn set_mean(
    ((lattice, chi2, freedom), enlargement): ((Lattice, f64, usize), f64),
    statistical: &Statistical,
    scans: impl Iterator<Item = (Option<TwistStrain>, Lattice)>,
    settings: &Settings,
    strengths: &WaveStrengths,
) -> Option<SetMean> {
    let twist_strain = moire(&lattice, settings)?;
    let (singles, lattices): (Vec<_>, Vec<_>) = scans.unzip();
    let singles: Vec<TwistStrain> = singles.into_iter().flatten().collect();
    let twists: Vec<f64> = singles.iter().map(|s| s.twist).collect();
    let component = |i: usize| {
        let values: Vec<f64> = singles.iter().map(|s| s.strain_vector[i]).collect();
        mean_and_spread(&values).sigma
    };
    let within = lattices.iter().all(|l| {
        (0..3).all(|i| {
            let ratio = l.wavelength(i).value / lattice.wavelength(i).value;
            (ratio - 1.0).abs() <= 0.01
        })
    });
    let budget = Budget::new(&lattice, &twist_strain, statistical, settings);
    Some(SetMean {
        readings: Readings::new(&lattice, &twist_strain, &budget, strengths, settings),
        budget,
        lattice,
        twist_strain,
        twist_scatter: mean_and_spread(&twists).sigma,
        strain_scatter: component(0).hypot(component(1)) / std::f64::consts::SQRT_2,
        chi2_per_dof: chi2 / freedom as f64,
        enlargement,
        within_one_percent: within,
    })
}

/// Twist and strain of the mean reciprocal lattice of up and down scans, sensor coordinates.
///
/// With opposite time gradients the mean is free of constant drift exactly: a check that needs no
/// drift estimate.
fn forward_backward(scans: &[&ScanAnalysis], settings: &Settings) -> Option<TwistStrain> {
    let mean = |direction: FrameDirection| {
        let reciprocal: Vec<Waves> = scans
            .iter()
            .filter(|s| s.frame_direction == Some(direction))
            .filter_map(|s| s.sensor.waves())
            .collect();
        plain_mean(&reciprocal)
    };
    let both = [mean(FrameDirection::Up)?, mean(FrameDirection::Down)?];
    let lattice = plain_mean(&both)?.lattice()?;
    // Back and forth turns the labelling by 60°, which twist and strain do not see.
    moire(&lattice, settings)
}
