//! One set: drift, and every scan before and after correction.

use heterostrain::lattice::{Lattice, Waves};
use heterostrain::strain::{TwistStrain, draws};
use nalgebra::{Matrix2, Matrix4, Vector2};
use rayon::prelude::*;
use spmfile::FrameDirection;

use crate::campaign::Checks;
use crate::campaign::analysis::{Drift, DriftFit, ScanAnalysis, SetAnalysis, SetMean};
use crate::campaign::group::Group;
use crate::campaign::set::about::{about_checks, about_mean, about_readings, about_residual};
use crate::campaign::set::common::common;
use crate::campaign::set::faint::too_faint;
use crate::campaign::set::headers::{about_dates, about_headers};
use crate::campaign::set::moire::moire;
use crate::campaign::set::scan::{plain_mean, scan_analysis};
use crate::campaign::set::shells::of_other_shell;
use crate::campaign::set::solved::Solved;
use crate::campaign::set::{joint, moire, published};
use crate::caveat::Caveat;
use crate::caveat::drifting::DriftDoubt;
use crate::caveat::sets::SetDoubt;
use crate::drift::joint::solve::JointFit;
use crate::drift::linear::{DriftSolution, Observation, at_known_drift, common_lattice, solve};
use crate::drift::monte_carlo;
use crate::drift::paper::successive_drift;
use crate::drift::shares::Statistical;
use crate::meaning::budget::Budget;
use crate::meaning::readings::Readings;
use crate::meaning::strengths::WaveStrengths;
use crate::numbers::chi2::enlargement;
use crate::numbers::interrupt;
use crate::numbers::rng::normals;
use crate::numbers::spread::mean_and_spread;
use crate::scan::measured::{MeasuredLine, MeasuredScan};
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
    let in_all = group.scans.iter();
    let seen: Vec<_> = in_all.map(|scan| observations(scan, reference)).collect();
    let joint = settings.method.is_joint() && settings.drift.is_none();
    if joint && settings.exclude_outliers {
        leave_out(group, &seen, reference, settings, caveats);
    }
    let kept = kept(group);
    let used: Vec<&MeasuredScan> = kept.iter().map(|&i| &group.scans[i]).collect();
    let all: Vec<Observation> = kept.iter().flat_map(|&i| &seen[i]).copied().collect();
    let name = &group.name;
    let (solved, fit) = match drift(name, &used, &all, settings, caveats) {
        Some(linear) if joint => {
            let (solved, fit) = refined(name, linear, &used, reference, settings, caveats);
            (Some(solved), fit)
        }
        linear => (linear, None),
    };
    let of_set = solved.as_ref().map(|solved| &solved.drift);
    let of_scan = |(scan, seen): (&MeasuredScan, &Vec<Observation>)| {
        scan_at_drift(scan, seen, reference, of_set, fit.as_ref(), settings)
    };
    let pairs = group.scans.iter().zip(&seen);
    let mut scans: Vec<ScanAnalysis> = pairs.filter_map(of_scan).collect();
    let checks = fit
        .as_ref()
        .map(|fit| checked(fit, &mut scans, &used, name, settings, caveats));
    draw(&mut scans, settings, first_index);
    if let (Method::Paper, Some(drift)) = (settings.method, of_set) {
        let measured = &group.scans;
        published::draw_all(&mut scans, measured, &seen, drift, settings, first_index);
    }
    let pitch = pitch_error(&used);
    // What is told by hand is known to be there.
    let doubt = no_result(group, &used).filter(|_| !settings.by_hand.says_which());
    let (mut uncorrected, mut mean) = (None, None);
    if let Some(doubt) = doubt {
        caveats.push(Caveat::new(doubt, name));
    } else {
        let shared = common(&used, reference);
        let alone = kept.len() == 1;
        uncorrected = without_drift(&all, &scans, alone, &shared, &pitch, settings, strengths);
        mean = solved
            .as_ref()
            .and_then(|solved| at_drift(solved, &scans, &shared, &pitch, settings, strengths));
    }
    let set = SetAnalysis {
        name: name.clone(),
        slow_axis: group.slow_axis,
        line_rate_hz: group.line_rate_hz,
        channel: group.channel.clone(),
        forward_backward: forward_backward(&scans, settings),
        scans,
        drift: solved.map(|s| s.drift),
        mean,
        uncorrected,
        checks,
        illustration: None,
    };
    about_set(&set, kept.len(), settings, caveats);
    set
}

/// Why the lattice of a set may be another one, so that the set has no result.
fn no_result(group: &Group, used: &[&MeasuredScan]) -> Option<SetDoubt> {
    let hidden = of_other_shell(group).map(|times| SetDoubt::ShellForLattice { times });
    let scans = used.len();
    let faint = || {
        too_faint(used).map(|signal_to_noise| SetDoubt::LatticeDoubtful {
            signal_to_noise,
            scans,
        })
    };
    hidden.or_else(faint)
}

/// What has to be said of a set of which `used` scans count.
fn about_set(set: &SetAnalysis, used: usize, settings: &Settings, caveats: &mut Vec<Caveat>) {
    about_mean(&set.name, set.mean.as_ref(), caveats);
    let shown = set.mean.as_ref().or(set.uncorrected.as_ref());
    if let Some(mean) = shown {
        caveats.extend(about_readings(&set.name, mean, settings));
    }
    moire::doubts(&set.name, shown, &set.scans, settings, caveats);
    about_checks(set, used, caveats);
}

/// The scans that are not left out, by their number.
fn kept(group: &Group) -> Vec<usize> {
    (0..group.scans.len())
        .filter(|&i| group.scans[i].excluded.is_none())
        .collect()
}

/// The scans that are not left out.
fn counted(scans: &[ScanAnalysis]) -> impl Iterator<Item = &ScanAnalysis> {
    scans.iter().filter(|s| s.excluded.is_none())
}

/// A scan before and after its drift is taken off: its own by the `fit` of the set, or else the mean one.
fn scan_at_drift(
    scan: &MeasuredScan,
    seen: &[Observation],
    reference: &Matrix2<f64>,
    drift: Option<&Drift>,
    fit: Option<&JointFit>,
    settings: &Settings,
) -> Option<ScanAnalysis> {
    let drift = drift.map(|mean| {
        let own = fit.and_then(|fit| joint::velocity_of(fit, scan));
        own.unwrap_or((mean.velocity, mean.covariance))
    });
    let found = scan_analysis(scan, seen, reference, drift, settings)?;
    Some(joint::with_motion(found, fit, scan))
}

/// The errors by the scatter of the `used` scans; tells each of `scans` how it lies against the others.
fn checked(
    fit: &JointFit,
    scans: &mut [ScanAnalysis],
    used: &[&MeasuredScan],
    name: &str,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) -> Checks {
    let left_out = fit.leave_one_out();
    let residuals = joint::residuals(&left_out);
    for (one, residual) in left_out.iter().zip(residuals) {
        let file = &used[one.scan].file;
        if let Some(scan) = scans.iter_mut().find(|s| s.file == *file) {
            scan.residual = Some(residual);
            about_residual(file, &residual, settings, caveats);
        }
    }
    joint::checks(fit, &left_out, used, name, settings)
}

/// What an error of the pitch does to the positions of these scans: all of a set have the same size and format.
fn pitch_error(used: &[&MeasuredScan]) -> Matrix2<f64> {
    let mut lines = used.iter().flat_map(|scan| &scan.lines);
    lines
        .next()
        .map_or_else(Matrix2::zeros, MeasuredLine::pitch_error)
}

/// The mean of the scans, their drift taken off; `shared` is the covariance that they have in common.
fn at_drift(
    solved: &Solved,
    scans: &[ScanAnalysis],
    shared: &Matrix4<f64>,
    pitch: &Matrix2<f64>,
    settings: &Settings,
    strengths: &WaveStrengths,
) -> Option<SetMean> {
    let of = |s: &ScanAnalysis| (s.twist_strain, s.drift_corrected.unwrap_or(s.sensor));
    let lattice = &solved.lattice;
    let statistical = Statistical {
        image: solved.statistical.image + shared,
        ..solved.statistical
    };
    set_mean(
        &Lattice::new(lattice.basis, lattice.covariance + shared),
        &statistical,
        pitch,
        Agreement {
            chi2_per_dof: solved.chi2 / solved.freedom as f64,
            enlargement: solved.enlargement,
        },
        counted(scans).map(of),
        settings,
        strengths,
    )
}

/// The mean of the scans as if nothing drifted, with the errors that drift adds left out; `alone`: there is one scan.
fn without_drift(
    all: &[Observation],
    scans: &[ScanAnalysis],
    alone: bool,
    shared: &Matrix4<f64>,
    pitch: &Matrix2<f64>,
    settings: &Settings,
    strengths: &WaveStrengths,
) -> Option<SetMean> {
    let (lattice, chi2, freedom) =
        common_lattice(all, &Vector2::zeros(), &Matrix2::zeros()).ok()?;
    let [image, sensor] = at_known_drift(all)?;
    // The scatter of several scans is that of their drift; that of the two lines of one is not.
    let scale = if alone {
        enlargement(chi2, freedom)
    } else {
        1.0
    };
    let lattice = Lattice::new(lattice.basis, lattice.covariance * scale + shared);
    let statistical = Statistical::without_drift(&(image * scale + shared), &(sensor * scale));
    let of = |s: &ScanAnalysis| (s.twist_strain_sensor, s.sensor);
    set_mean(
        &lattice,
        &statistical,
        pitch,
        Agreement {
            chi2_per_dof: chi2 / freedom as f64,
            enlargement: scale,
        },
        counted(scans).map(of),
        settings,
        strengths,
    )
}

/// Draws twist and strain of every scan.
fn draw(scans: &mut [ScanAnalysis], settings: &Settings, first_index: u64) {
    scans.par_iter_mut().enumerate().for_each(|(i, scan)| {
        interrupt::check();
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
    let kept = kept(group);
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
    name: &str,
    scans: &[&MeasuredScan],
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
            published::drift(name, &scans, all, &solution, settings, caveats)
        }
        Ok(solution) => linear_drift(name, scans, all, &solution, settings),
        Err(error) => {
            let reason = error.to_string();
            caveats.push(Caveat::new(DriftDoubt::Undetermined { reason }, name));
            None
        }
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
        enlargement: scale,
    })
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

/// How well scans agree with their common lattice.
#[derive(Clone, Copy)]
struct Agreement {
    chi2_per_dof: f64,
    /// By how much their scatter enlarged all variances.
    enlargement: f64,
}

/// Twist and strain of the common lattice, and how the scans scatter about it.
fn set_mean(
    lattice: &Lattice,
    statistical: &Statistical,
    pitch: &Matrix2<f64>,
    agreement: Agreement,
    scans: impl Iterator<Item = (Option<TwistStrain>, Lattice)>,
    settings: &Settings,
    strengths: &WaveStrengths,
) -> Option<SetMean> {
    let twist_strain = moire(lattice, settings)?;
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
    let budget = Budget::with_pitch(lattice, &twist_strain, statistical, pitch, settings);
    Some(SetMean {
        readings: Readings::new(lattice, &twist_strain, &budget, strengths, settings),
        budget,
        lattice: *lattice,
        twist_strain,
        twist_scatter: mean_and_spread(&twists).sigma,
        strain_scatter: component(0).hypot(component(1)) / std::f64::consts::SQRT_2,
        chi2_per_dof: agreement.chi2_per_dof,
        enlargement: agreement.enlargement,
        within_one_percent: within,
    })
}

/// Twist and strain of the mean reciprocal lattice of up and down scans, sensor coordinates.
///
/// With opposite time gradients the mean is free of constant drift exactly: a check that needs no
/// drift estimate.
fn forward_backward(scans: &[ScanAnalysis], settings: &Settings) -> Option<TwistStrain> {
    let mean = |direction: FrameDirection| {
        let reciprocal: Vec<Waves> = counted(scans)
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
