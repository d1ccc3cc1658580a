//! Scans of a known lattice → the calibration of the scanner.
//!
//! In: scans measured like any others ([`crate::scan::measure::measure_known`]), the cell they have to show. Out: common
//! gain, mismatch and deviation from a right angle with their covariance.
//!
//! Scans are grouped into sets as for a moiré. Up and down frames of a set give the lattice free of drift by
//! the same linear least squares; its vectors against the known cell are the distortion ([`shown`]). Sets
//! share the scanner and not the orientation of the sample, so that what is averaged is the distortion.
//! Frames of one direction do not tell drift from gain: they are taken as they are, and a prior of the drift
//! enlarges the errors along what it does, `t_j D` for the vector j that takes the time `t_j`.
//!
//! Phases of the frames are not used: at atomic distances nobody can tell by how many cells a sample has
//! moved between two frames.

use heterostrain::Estimate;
use heterostrain::lattice::Lattice;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use spmfile::{FrameDirection, LineDirection};

use crate::calibration::curvature::SeenBySet;
use crate::calibration::{Calibration, Coordinates, Curvature, KnownLattice, Shown, shown};
use crate::campaign::alike::{Alike, alike};
use crate::campaign::calibrate_doubts::{
    CalibrateError, about_differences, about_drift, about_name, about_plausibility, about_scatter,
};
use crate::campaign::curvature::seen_by_set;
use crate::campaign::group::{Group, groups};
use crate::campaign::identity::once;
use crate::caveat::drifting::DriftDoubt;
use crate::caveat::lattices::LatticeDoubt;
use crate::caveat::positions::PositionDoubt;
use crate::caveat::{Caveat, Doubt};
use crate::drift::linear::{Observation, common_lattice, solve};
use crate::frame::axis::Axis;
use crate::frame::geometry::Timing;
use crate::numbers::chi2::enlargement;
use crate::scan::measured::{MeasuredLine, MeasuredScan};
use crate::settings::knobs::Grouping;

/// Lattices of frames of one direction that differ by more than this share are of different things. Chosen by eye.
const SAME: f64 = 0.35;
/// Frames up and down that a constant drift does not make of one another to this share are not used. Half and twice as
/// much change no result of docs/constants.md.
const LARGEST_MISFIT: f64 = 0.05;
/// A drift of this share of the speed of the slow axis deserves a word. Chosen by eye.
const LARGE_DRIFT: f64 = 0.2;

/// What scans of a known lattice say about the scanner.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// The calibration.
    pub calibration: Calibration,
    /// Whether its covariance is known; `false` where frames of one direction have no line rate.
    pub covariance_known: bool,
    /// Standard uncertainties of gain, mismatch (per cent) and deviation from a right angle (mrad) from noise and
    /// scatter alone, without the prior of the drift and the known lattice.
    pub statistical: [f64; 3],
    /// The sets, in order of time.
    pub sets: Vec<CalibratedSet>,
    /// χ² of the sets against the mean, and its degrees of freedom.
    pub chi2: f64,
    /// Degrees of freedom of `chi2`.
    pub degrees_of_freedom: usize,
    /// Doubts.
    pub caveats: Vec<Caveat>,
}

/// What one set says.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CalibratedSet {
    /// Its name.
    pub name: String,
    /// The channel.
    pub channel: String,
    /// Its files.
    pub files: Vec<String>,
    /// The laboratory axis along which lines follow each other.
    pub slow_axis: Axis,
    /// The lattice as it is shown, free of drift as far as that is known, nm.
    pub lattice: Lattice,
    /// Gain, mismatch (per cent) and deviation from a right angle (mrad), errors without that of the known
    /// lattice.
    pub estimates: [Estimate; 3],
    /// Orientation of the known cell's first vector, rad.
    pub orientation: Estimate,
    /// Drift velocity in true lengths, nm/s, where frames of both directions tell it: value and σ along x and y.
    pub drift: Option<[Estimate; 2]>,
    /// Whether it was used: frames of one direction are not, where there is better.
    pub used: bool,
}

/// One set on the way.
struct Seen {
    group: Group,
    /// One for each line.
    observations: Vec<Observation>,
    lattice: Lattice,
    /// With the prior of the drift where it is needed.
    found: Shown,
    /// Without.
    bare: Shown,
    /// Velocity as it is shown, nm/s, and its covariance.
    drift: Option<(Vector2<f64>, Matrix2<f64>)>,
    /// The prior of the drift could be applied, or was not needed.
    known: bool,
}

/// The calibration of the scanner that scans of a lattice `known` tell; `drift_sigma` (nm/s) is the
/// standard deviation of each component of a drift that the frames cannot tell.
///
/// # Errors
/// [`CalibrateError`]: nothing to measure, sensors and nominal coordinates mixed, or lattices that are not valid.
pub fn calibrate(
    scans: Vec<MeasuredScan>,
    known: &KnownLattice,
    drift_sigma: f64,
    grouping: Grouping,
) -> Result<Calibrated, CalibrateError> {
    let cell = known
        .cell()
        .filter(|_| known.problem().is_none())
        .ok_or(CalibrateError::Cell)?;
    let (scans, mut caveats) = once(scans);
    let coordinates = coordinates_of(&scans)?;
    let sizes_nm = without_repeats(scans.iter().filter_map(|s| s.size_nm));
    let line_rates_hz = without_repeats(scans.iter().filter_map(|s| s.line_rate_hz));
    let mut sets = Vec::new();
    for group in groups(scans, grouping) {
        let told = group.caveats().into_iter();
        caveats.extend(told.filter(|c| !is_expected(&c.doubt)));
        sets.push(see(group, &cell, drift_sigma, &mut caveats)?);
    }
    let separated = sets.iter().any(|s| s.drift.is_some());
    let used = |s: &Seen| s.drift.is_some() || !separated;
    let chosen: Vec<&Shown> = sets.iter().filter(|s| used(s)).map(|s| &s.found).collect();
    let bare: Vec<&Shown> = sets.iter().filter(|s| used(s)).map(|s| &s.bare).collect();
    let (values, covariance, chi2) =
        mean(&chosen).ok_or_else(|| CalibrateError::Lattice("all sets".to_owned()))?;
    let freedom = 3 * (chosen.len() - 1);
    let scale = enlargement(chi2, freedom);
    let statistical = mean(&bare).map_or(covariance, |(_, c, _)| c) * scale;
    about_differences(chi2, freedom, &mut caveats);
    // A wrong constant of the known lattice is a wrong size of everything.
    let size = Vector3::new(1.0 + values[0], values[1], values[2]) * (known.sigma_percent / 100.0);
    let covariance = covariance * scale + size * size.transpose();
    let covariance_known = sets.iter().filter(|s| used(s)).all(|s| s.known);
    let in_units = Calibration::new(&values, &statistical, coordinates).estimates();
    let of_sensors = |s: &&Seen| used(s) && coordinates == Coordinates::Sensors;
    let bends: Vec<SeenBySet> = (sets.iter().filter(of_sensors))
        .map(|s| {
            let unknown = Matrix2::identity() * drift_sigma * drift_sigma;
            let drift = s.drift.unwrap_or((Vector2::zeros(), unknown));
            seen_by_set(&s.group.scans, &s.observations, &drift)
        })
        .collect();
    let calibration = Calibration {
        curvature: Curvature::of(&bends),
        sizes_nm,
        line_rates_hz,
        ..Calibration::new(&values, &covariance, coordinates)
    };
    about_plausibility(&calibration, covariance_known, &mut caveats);
    let map = calibration
        .map()
        .ok_or_else(|| CalibrateError::Lattice("all sets".to_owned()))?;
    Ok(Calibrated {
        covariance_known,
        statistical: in_units.map(|e| e.sigma),
        chi2,
        degrees_of_freedom: freedom,
        sets: sets
            .into_iter()
            .map(|s| summary(used(&s), s, &map, coordinates))
            .collect(),
        calibration,
        caveats,
    })
}

/// Values in their order, each once where it follows itself.
fn without_repeats<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut all: Vec<T> = values.collect();
    all.dedup();
    all
}

/// The coordinates that all scans are in.
fn coordinates_of(scans: &[MeasuredScan]) -> Result<Coordinates, CalibrateError> {
    let mut lines = scans.iter().flat_map(|s| &s.lines);
    let first = lines.next().ok_or(CalibrateError::Nothing)?;
    let first = first.geometry.from_sensors;
    if lines.any(|line| line.geometry.from_sensors != first) {
        return Err(CalibrateError::Mixed);
    }
    Ok(if first {
        Coordinates::Sensors
    } else {
        Coordinates::Nominal
    })
}

/// Whether a caveat of a scan does not concern a calibration: that of nominal coordinates is what is looked for, and atoms
/// show other waves beside their lattice.
fn is_expected(doubt: &Doubt) -> bool {
    matches!(
        doubt,
        Doubt::Positions(PositionDoubt::NoPositionSensors { .. })
            | Doubt::Lattice(LatticeDoubt::SecondLattice { .. })
    )
}

/// The lattice of one set and its distortion.
fn see(
    group: Group,
    cell: &Matrix2<f64>,
    drift_sigma: f64,
    caveats: &mut Vec<Caveat>,
) -> Result<Seen, CalibrateError> {
    let name = group.name.clone();
    let unusable = || CalibrateError::Lattice(name.clone());
    let lines = || group.scans.iter().flat_map(|s| &s.lines);
    let found = alike(lines(), cell).ok_or(CalibrateError::Nothing)?;
    about_one_drift(&name, &found, caveats)?;
    let observations = found.observations;
    let timed = lines().all(|l| l.timing.is_some());
    if timed && let Ok(solution) = solve(&observations) {
        let scale = enlargement(solution.chi2, solution.degrees_of_freedom);
        about_scatter(&name, solution.chi2, solution.degrees_of_freedom, caveats);
        let mut lattice = solution.lattice;
        lattice.covariance *= scale;
        let found = shown(&lattice, cell).ok_or_else(unusable)?;
        about_name(&name, &found, caveats);
        return Ok(Seen {
            lattice,
            bare: found,
            found,
            drift: Some((solution.velocity, solution.covariance * scale)),
            known: true,
            observations,
            group,
        });
    }
    with_prior(group, observations, cell, drift_sigma, caveats)
}

/// The lattice of a set whose frames do not tell the drift, with the prior of the drift.
fn with_prior(
    group: Group,
    observations: Vec<Observation>,
    cell: &Matrix2<f64>,
    drift_sigma: f64,
    caveats: &mut Vec<Caveat>,
) -> Result<Seen, CalibrateError> {
    let name = group.name.clone();
    let unusable = || CalibrateError::Lattice(name.clone());
    // The time that passes between two points is that of the slow axis; its sign does not matter for what a
    // drift of unknown direction does.
    let gradients: Vec<Option<Vector2<f64>>> = group
        .scans
        .iter()
        .flat_map(|s| s.lines.iter().map(move |l| gradient(s, l)))
        .collect();
    let known = gradients.iter().all(Option::is_some);
    let timed: Vec<Observation> = observations
        .iter()
        .zip(&gradients)
        .map(|(o, u)| Observation {
            time_gradient: u.unwrap_or_else(Vector2::zeros),
            ..*o
        })
        .collect();
    let none = Vector2::zeros();
    let prior = Matrix2::identity() * drift_sigma * drift_sigma;
    let (bare, chi2, freedom) =
        common_lattice(&timed, &none, &Matrix2::zeros()).map_err(|_| unusable())?;
    let (drifting, _, _) = common_lattice(&timed, &none, &prior).map_err(|_| unusable())?;
    let scale = enlargement(chi2, freedom);
    about_scatter(&name, chi2, freedom, caveats);
    let lattice = Lattice::new(
        drifting.basis,
        drifting.covariance + bare.covariance * (scale - 1.0),
    );
    let bare = Lattice::new(bare.basis, bare.covariance * scale);
    let found = shown(&lattice, cell).ok_or_else(unusable)?;
    about_name(&name, &found, caveats);
    about_drift(
        &name,
        gradients.first().copied().flatten(),
        drift_sigma,
        caveats,
    );
    Ok(Seen {
        lattice,
        found,
        bare: shown(&bare, cell).ok_or_else(unusable)?,
        drift: None,
        known,
        observations,
        group,
    })
}

/// Whether one drift explains the frames: an error where none does, a word where it is large.
fn about_one_drift(
    name: &str,
    found: &Alike,
    caveats: &mut Vec<Caveat>,
) -> Result<(), CalibrateError> {
    let along = found.observations[0].time_gradient;
    for sense in [1.0, -1.0] {
        let of_sense = |o: &&Observation| sense * o.time_gradient.dot(&along) >= 0.0;
        let mut same = found.observations.iter().filter(of_sense);
        let Some(first) = same.next().map(|o| o.lattice.basis) else {
            continue;
        };
        if same.any(|o| (o.lattice.basis - first).norm() > SAME * first.norm()) {
            return Err(CalibrateError::Lattice(name.to_owned()));
        }
    }
    if found.misfit > LARGEST_MISFIT {
        return Err(CalibrateError::Drift {
            set: name.to_owned(),
            misfit_percent: 100.0 * found.misfit,
        });
    }
    if found.drift > LARGE_DRIFT {
        caveats.push(Caveat::new(DriftDoubt::Large { share: found.drift }, name));
    }
    Ok(())
}

/// The time gradient of a line, s/nm; with a line rate alone, that of a frame upwards.
fn gradient(scan: &MeasuredScan, line: &MeasuredLine) -> Option<Vector2<f64>> {
    let up = || {
        let columns = line.geometry.size[0];
        let rate = scan.line_rate_hz?;
        Timing::new(columns, rate, 0.0, FrameDirection::Up, LineDirection::Trace)
    };
    line.geometry.time_gradient(&line.timing.or_else(up)?)
}

/// Mean of the distortions, weighted by their covariances, that covariance, and χ².
fn mean(all: &[&Shown]) -> Option<(Vector3<f64>, Matrix3<f64>, f64)> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    // A noiseless simulation has no covariance to weigh by.
    let weight = |one: &Shown| (one.covariance + Matrix3::identity() * 1e-18).try_inverse();
    for one in all {
        let w = weight(one)?;
        normal += w;
        right += w * one.values;
    }
    let covariance = normal.try_inverse()?;
    let values = covariance * right;
    let mut chi2 = 0.0;
    for one in all {
        let miss = one.values - values;
        chi2 += (miss.transpose() * weight(one)? * miss)[0];
    }
    Some((values, covariance, chi2))
}

fn summary(used: bool, seen: Seen, map: &Matrix2<f64>, coordinates: Coordinates) -> CalibratedSet {
    let Seen {
        group,
        lattice,
        found,
        drift,
        ..
    } = seen;
    CalibratedSet {
        name: group.name,
        channel: group.channel,
        files: group.scans.iter().map(|s| s.file.clone()).collect(),
        slow_axis: group.slow_axis,
        lattice,
        estimates: Calibration::new(&found.values, &found.covariance, coordinates).estimates(),
        orientation: found.orientation,
        drift: drift.map(|(velocity, covariance)| {
            let (velocity, covariance) = (map * velocity, map * covariance * map.transpose());
            [0, 1].map(|i| Estimate::from_variance(velocity[i], covariance[(i, i)]))
        }),
        used,
    }
}
