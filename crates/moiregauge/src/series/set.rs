//! One set: drift, and every scan before and after correction.

use nalgebra::{Matrix2, Matrix4, Vector2};
use rayon::prelude::*;
use spmfile::FrameDirection;

use super::group::Group;
use super::measure::{MeasuredLine, MeasuredScan};
use super::sightings::sightings;
use crate::analysis::{
    Axis, Drift, DriftFit, JointTerms, LineAnalysis, ScanAnalysis, SetAnalysis, SetMean,
};
use crate::budget::{Budget, Statistical};
use crate::caveat::Caveat;
use crate::drift::paper::{PaperScan, pairwise_drift};
use crate::drift::{Observation, at_known_drift, common_lattice, monte_carlo, solve};
use crate::estimate::Estimate;
use crate::geometry::mean_and_spread;
use crate::joint::{JointFit, fit};
use crate::lattice::LatticeVectors;
use crate::lattice::reciprocal::{labelled_like, real_from_reciprocal, reciprocal};
use crate::settings::{GivenDrift, Settings};
use crate::strain::{TwistStrain, draws, twist_strain};

/// nm/min → nm/s.
const PER_MINUTE: f64 = 1.0 / 60.0;
/// χ²/dof beyond which the scatter of the scans deserves a word.
const LARGE_CHI2: f64 = 2.0;

/// Everything about one set but its illustration. `first_index` numbers its scans for the draws.
pub(super) fn analyse_set(
    group: Group,
    reference: &Matrix2<f64>,
    settings: &Settings,
    first_index: u64,
    caveats: &mut Vec<Caveat>,
) -> SetAnalysis {
    let observations: Vec<Vec<Observation>> = group
        .scans
        .iter()
        .map(|scan| observations(scan, reference))
        .collect();
    let all: Vec<Observation> = observations.concat();
    let timed = group
        .scans
        .iter()
        .all(|s| s.lines.iter().all(|l| l.timing.is_some()));
    let mut solved = drift(&group, &all, timed, settings, caveats);
    if settings.method.is_joint() && settings.drift.is_none() {
        let scans: Vec<&MeasuredScan> = group.scans.iter().collect();
        solved = solved.map(|linear| jointly(linear, &scans, reference, settings));
    }
    let mut scans: Vec<ScanAnalysis> = group
        .scans
        .iter()
        .zip(&observations)
        .enumerate()
        .filter_map(|(i, (scan, seen))| {
            let drift = solved.as_ref().map(|s| {
                let own = s.velocities.get(i);
                own.copied()
                    .unwrap_or((s.drift.velocity, s.drift.covariance))
            });
            scan_analysis(scan, seen, reference, drift, settings)
        })
        .collect();
    let material = &settings.material;
    let convention = settings.strain_convention;
    scans.par_iter_mut().enumerate().for_each(|(i, scan)| {
        let lattice = scan.drift_corrected.as_ref().unwrap_or(&scan.sensor);
        let index = first_index + i as u64;
        scan.draws = draws(
            lattice,
            material,
            convention,
            settings.strain_draws,
            settings.seed,
            index,
        );
    });
    let uncorrected = common_lattice(&all, &Vector2::zeros(), &Matrix2::zeros())
        .ok()
        .and_then(|common| {
            let of = |s: &ScanAnalysis| (s.twist_strain_sensor, s.sensor);
            let [image, sensor] = at_known_drift(&all)?;
            let statistical = Statistical::without_drift(&image, &sensor);
            set_mean(common, &statistical, scans.iter().map(of), settings)
        });
    let mean = solved.as_ref().and_then(|s| {
        let of = |s: &ScanAnalysis| (s.twist_strain, s.drift_corrected.unwrap_or(s.sensor));
        set_mean(
            (s.lattice, s.chi2, s.freedom),
            &s.statistical,
            scans.iter().map(of),
            settings,
        )
    });
    let drift = solved.map(|s| s.drift);
    about_mean(&group.name, mean.as_ref(), caveats);
    SetAnalysis {
        name: group.name,
        slow_axis: group.slow_axis,
        line_rate_hz: group.line_rate_hz,
        channel: group.channel,
        forward_backward: forward_backward(&scans, settings),
        scans,
        drift,
        mean,
        uncorrected,
        illustration: None,
    }
}

/// The drift of a set and the lattice that goes with it.
struct Solved {
    drift: Drift,
    lattice: LatticeVectors,
    statistical: Statistical,
    chi2: f64,
    freedom: usize,
    /// The drift during each scan, where it is not the same for all.
    velocities: Vec<(Vector2<f64>, Matrix2<f64>)>,
}

/// Refines the linear solution of a set with the phases of its scans; keeps it where they do not help.
fn jointly(
    linear: Solved,
    scans: &[&MeasuredScan],
    reference: &Matrix2<f64>,
    settings: &Settings,
) -> Solved {
    let start = (&linear.lattice, &linear.drift.velocity);
    let Some((fit, times)) = joint_fit(scans, reference, start, settings) else {
        return linear;
    };
    let Some((lattice, statistical)) = lattice_of(&fit, reference) else {
        return linear;
    };
    Solved {
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
        velocities: times.iter().map(|t| fit.velocity_at(*t)).collect(),
    }
}

/// The joint fit of some scans and the times of their middles; `None` without timing.
pub(super) fn joint_fit(
    scans: &[&MeasuredScan],
    reference: &Matrix2<f64>,
    (lattice, velocity): (&LatticeVectors, &Vector2<f64>),
    settings: &Settings,
) -> Option<(JointFit, Vec<f64>)> {
    let sightings = sightings(scans, reference)?;
    let waves = labelled_like(&real_from_reciprocal(lattice)?, &reciprocal(reference)?);
    let fitted = fit(
        &sightings,
        (&waves.basis, velocity),
        settings.frame_time_sigma_s,
    )?;
    let times = (0..scans.len())
        .filter_map(|i| sightings.iter().find(|s| s.scan == i))
        .map(|s| s.time)
        .collect();
    Some((fitted, times))
}

/// The lattice of a joint fit (nm) and where its covariance comes from.
pub(super) fn lattice_of(
    fit: &JointFit,
    reference: &Matrix2<f64>,
) -> Option<(LatticeVectors, Statistical)> {
    let real = |covariance| {
        let waves = LatticeVectors {
            covariance,
            ..fit.waves
        };
        Some(labelled_like(&real_from_reciprocal(&waves)?, reference))
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
pub(super) fn terms(fit: &JointFit) -> JointTerms {
    JointTerms {
        phases: fit.terms.phases,
        acceleration: fit.acceleration,
        settling_s: fit.terms.settling,
        fast_gain: fit.fast_gain,
        instability_nm: fit.instability_nm,
    }
}

fn observations(scan: &MeasuredScan, reference: &Matrix2<f64>) -> Vec<Observation> {
    scan.lines
        .iter()
        .map(|line| line.observation(reference))
        .collect()
}

fn drift(
    group: &Group,
    all: &[Observation],
    timed: bool,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) -> Option<Solved> {
    if !timed {
        caveats.push(Caveat::new(
            "no-timing",
            &group.name,
            "not every file tells its line rate and frame direction: nothing is corrected for drift",
        ));
        return None;
    }
    if let Some(given) = settings.drift {
        return given_drift(group, all, given, caveats);
    }
    match solve(all) {
        Ok(solution) => {
            let scale = excess(solution.chi2, solution.degrees_of_freedom);
            let mut lattice = solution.lattice;
            lattice.covariance *= scale;
            let statistical =
                Statistical::at_known_drift(at_known_drift(all)?, scale, &lattice.covariance);
            let seed = settings.seed;
            let name = format!("drift {}", group.name);
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
                        paper_velocity: pairwise_drift(&paper_scans(group, all)),
                    }),
                    monte_carlo: monte_carlo(all, settings.drift_draws, seed, &name),
                    joint: None,
                },
                lattice,
                statistical,
                chi2: solution.chi2,
                freedom: solution.degrees_of_freedom,
                velocities: Vec::new(),
            })
        }
        Err(error) => {
            caveats.push(Caveat::new(
                "drift-undetermined",
                &group.name,
                error.to_string(),
            ));
            None
        }
    }
}

fn given_drift(
    group: &Group,
    all: &[Observation],
    given: GivenDrift,
    caveats: &mut Vec<Caveat>,
) -> Option<Solved> {
    let velocity = Vector2::new(given.x_nm_per_min, given.y_nm_per_min) * PER_MINUTE;
    let sigma = given.sigma_nm_per_min * PER_MINUTE;
    let covariance = Matrix2::identity() * sigma * sigma;
    caveats.push(Caveat::new(
        "drift-given",
        &group.name,
        "the drift was given by the user and not measured; it is as right as the conditions are the same",
    ));
    let (mut lattice, chi2, freedom) = common_lattice(all, &velocity, &covariance).ok()?;
    // Scatter enlarges what the scans say, not what the user said of the drift.
    let (measured, _, _) = common_lattice(all, &velocity, &Matrix2::zeros()).ok()?;
    let scale = excess(chi2, freedom);
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
        velocities: Vec::new(),
    })
}

/// By how much the variances have to grow for the scatter to be what they say; never shrinks them.
fn excess(chi2: f64, freedom: usize) -> f64 {
    if freedom == 0 {
        return 1.0;
    }
    (chi2 / freedom as f64).max(1.0)
}

/// The scans as the published estimate wants them: signed velocities in laboratory axes.
fn paper_scans(group: &Group, all: &[Observation]) -> Vec<PaperScan> {
    let lines = group.scans.iter().flat_map(|s| &s.lines);
    lines
        .zip(all)
        .filter_map(|(line, seen)| {
            let tau = line.timing?.per_pixel;
            let (fast, slow) = (
                line.geometry.fast_step() / tau.x,
                line.geometry.slow_step() / tau.y,
            );
            // A set made by hand may hold scans of both slow axes.
            let slow_axis = line.geometry.slow_axis();
            let (fast_velocity, slow_velocity) = match slow_axis {
                Axis::X => (fast.y, slow.x),
                Axis::Y => (fast.x, slow.y),
            };
            Some(PaperScan {
                lattice: seen.lattice,
                slow_axis,
                fast_velocity,
                slow_velocity,
            })
        })
        .collect()
}

fn scan_analysis(
    scan: &MeasuredScan,
    seen: &[Observation],
    reference: &Matrix2<f64>,
    drift: Option<(Vector2<f64>, Matrix2<f64>)>,
    settings: &Settings,
) -> Option<ScanAnalysis> {
    let (sensor, _, _) = common_lattice(seen, &Vector2::zeros(), &Matrix2::zeros()).ok()?;
    let drift_corrected = drift
        .and_then(|(velocity, covariance)| common_lattice(seen, &velocity, &covariance).ok())
        .map(|(lattice, _, _)| lattice);
    let nominal: Option<Vec<LatticeVectors>> = scan
        .lines
        .iter()
        .map(|l| Some(labelled_like(&l.in_nominal_coordinates()?, reference)))
        .collect();
    let strain = |lattice: &LatticeVectors| {
        twist_strain(lattice, &settings.material, settings.strain_convention).ok()
    };
    let first = scan.lines.first()?;
    let mean = |f: &dyn Fn(&MeasuredLine) -> Estimate| {
        let all: Vec<Estimate> = scan.lines.iter().map(f).collect();
        let n = all.len() as f64;
        Estimate::new(
            all.iter().map(|e| e.value).sum::<f64>() / n,
            (all.iter().map(|e| e.sigma.powi(2)).sum::<f64>() / n).sqrt(),
        )
    };
    Some(ScanAnalysis {
        file: scan.file.clone(),
        acquired: scan.acquired,
        frame_direction: scan.frame_direction.unwrap_or(FrameDirection::Up),
        lines: scan
            .lines
            .iter()
            .zip(seen)
            .map(|(line, seen)| line_analysis(line, seen, reference))
            .collect(),
        window_centre: first.geometry.centre(),
        window_extent: first.geometry.extent(),
        fast_velocity: mean(&|l| l.speeds[0]),
        slow_velocity: mean(&|l| l.speeds[1]),
        nominal: nominal.and_then(|all| plain_mean(&all)),
        twist_strain_sensor: strain(&sensor),
        twist_strain: drift_corrected.as_ref().and_then(strain),
        sensor,
        drift_corrected,
        draws: Vec::new(),
    })
}

fn line_analysis(
    line: &MeasuredLine,
    seen: &Observation,
    reference: &Matrix2<f64>,
) -> LineAnalysis {
    let comparison = line
        .lattice
        .comparison
        .map(|pixels| labelled_like(&pixels.mapped(&line.geometry.pixel_to_nm), reference));
    LineAnalysis {
        line: line.line,
        pixels: labelled_pixels(line, seen),
        sensor: seen.lattice,
        comparison,
        shortcut_wavelengths: line.lattice.shortcut_wavelengths,
        pixel_to_nm: line.geometry.pixel_to_nm,
        origin: line.geometry.origin,
        from_sensors: line.geometry.from_sensors,
        periods: line.lattice.periods,
        signal_to_noise: line.lattice.signal_to_noise,
    }
}

/// The vectors in pixels under the names that they have in sensor coordinates.
fn labelled_pixels(line: &MeasuredLine, seen: &Observation) -> LatticeVectors {
    let pixels = &line.lattice.pixels;
    match line.geometry.pixel_to_nm.try_inverse() {
        Some(inverse) => labelled_like(pixels, &(inverse * seen.lattice.basis)),
        None => *pixels,
    }
}

/// Unweighted mean of independent lattices.
fn plain_mean(all: &[LatticeVectors]) -> Option<LatticeVectors> {
    let n = all.len() as f64;
    (n > 0.0).then(|| LatticeVectors {
        basis: all.iter().map(|l| l.basis).sum::<Matrix2<f64>>() / n,
        covariance: all.iter().map(|l| l.covariance).sum::<Matrix4<f64>>() / (n * n),
    })
}

/// Twist and strain of the common lattice, and how the scans scatter about it.
fn set_mean(
    (lattice, chi2, freedom): (LatticeVectors, f64, usize),
    statistical: &Statistical,
    scans: impl Iterator<Item = (Option<TwistStrain>, LatticeVectors)>,
    settings: &Settings,
) -> Option<SetMean> {
    let twist_strain =
        twist_strain(&lattice, &settings.material, settings.strain_convention).ok()?;
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
    Some(SetMean {
        budget: Budget::new(&lattice, &twist_strain, statistical, settings),
        lattice,
        twist_strain,
        twist_scatter: mean_and_spread(&twists).sigma,
        strain_scatter: component(0).hypot(component(1)) / std::f64::consts::SQRT_2,
        chi2_per_dof: chi2 / freedom as f64,
        within_one_percent: within,
    })
}

/// Twist and strain of the mean reciprocal lattice of up and down scans, sensor coordinates.
///
/// With opposite time gradients the mean is free of constant drift exactly: a check that needs no
/// drift estimate.
fn forward_backward(scans: &[ScanAnalysis], settings: &Settings) -> Option<TwistStrain> {
    let mean = |direction: FrameDirection| {
        let reciprocal: Vec<LatticeVectors> = scans
            .iter()
            .filter(|s| s.frame_direction == direction)
            .filter_map(|s| real_from_reciprocal(&s.sensor))
            .collect();
        plain_mean(&reciprocal)
    };
    let both = [mean(FrameDirection::Up)?, mean(FrameDirection::Down)?];
    let lattice = real_from_reciprocal(&plain_mean(&both)?)?;
    // Back and forth turns the labelling by 60°, which twist and strain do not see.
    twist_strain(&lattice, &settings.material, settings.strain_convention).ok()
}

fn about_mean(name: &str, mean: Option<&SetMean>, caveats: &mut Vec<Caveat>) {
    let Some(mean) = mean else { return };
    if mean.chi2_per_dof > LARGE_CHI2 {
        caveats.push(Caveat::new(
            "scatter",
            name,
            format!(
                "the scans scatter {:.1} times more than their errors say (χ²/dof = {:.1}): drift that \
                 changes, an inhomogeneous lattice or sensor errors; errors of the set are enlarged to match",
                mean.chi2_per_dof.sqrt(),
                mean.chi2_per_dof
            ),
        ));
    }
    if !mean.within_one_percent {
        caveats.push(Caveat::new(
            "outside-one-percent",
            name,
            "a wavelength of a single scan differs by more than 1 % from that of the set",
        ));
    }
    let found = &mean.twist_strain;
    let in_all = mean.budget.applied_to(found);
    if found.axis_lab().is_none() {
        caveats.push(Caveat::new(
            "strain-not-significant",
            name,
            format!(
                "the heterostrain is not significant (p = {:.2}); it is below {:.4} % with 95 % \
                 confidence and has no axis",
                found.strain_p_value(),
                found.strain_upper_limit_95() * 100.0
            ),
        ));
    } else if in_all.axis_lab().is_none() {
        caveats.push(Caveat::new(
            "strain-within-calibration",
            name,
            format!(
                "the heterostrain stands out of the noise of the scans but not of the calibration of the \
                 scanner (p = {:.2}): with everything in the budget it is below {:.4} % with 95 % \
                 confidence; scans of the sample turned by 90° would tell",
                in_all.strain_p_value(),
                in_all.strain_upper_limit_95() * 100.0
            ),
        ));
    }
}
