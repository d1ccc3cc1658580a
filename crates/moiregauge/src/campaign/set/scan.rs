//! One scan of a set, before and after its drift is taken off.

use heterostrain::Estimate;
use heterostrain::lattice::{Lattice, Nm, Pair, Px, labelled_like};
use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::campaign::analysis::{LineAnalysis, ScanAnalysis};
use crate::campaign::motion::{Drift, Motion};
use crate::campaign::set::moire::moire;
use crate::campaign::sightings::middle_of_frame;
use crate::drift::joint::found::JointFit;
use crate::drift::joint::path::DriftPath;
use crate::drift::linear::{Observation, common_lattice};
use crate::scan::measured::{MeasuredLine, MeasuredScan};
use crate::settings::knobs::Settings;

/// Scans, with what was `seen` of each, before and after their drift is taken off; without those that cannot be told.
pub(crate) fn scans_at_drift(
    scans: &[MeasuredScan],
    seen: &[Vec<Observation>],
    reference: &Matrix2<f64>,
    drift: Option<&Drift>,
    fit: Option<&JointFit>,
    settings: &Settings,
) -> Vec<ScanAnalysis> {
    let of_scan = |(scan, seen): (&MeasuredScan, &Vec<Observation>)| {
        scan_at_drift(scan, seen, reference, drift, fit, settings)
    };
    // They are long, and a vector that grows would hold twice as many.
    let mut found = Vec::with_capacity(seen.len());
    found.extend(scans.iter().zip(seen).filter_map(of_scan));
    found
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
        let own = fit.and_then(|fit| velocity_of(fit, scan));
        own.unwrap_or((mean.velocity, mean.covariance))
    });
    let found = scan_analysis(scan, seen, reference, drift, settings)?;
    Some(with_motion(found, fit, scan))
}

/// Without its motion, which the fit of its set tells.
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
    let nominal: Option<Vec<Lattice>> = scan
        .lines
        .iter()
        .map(|l| Some(labelled_like(&l.in_nominal_coordinates()?, reference)))
        .collect();
    let strain = |lattice: &Lattice| moire(lattice, settings);
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
        frame_direction: scan.frame_direction,
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
        drift: drift.filter(|_| drift_corrected.is_some()).map(|d| d.0),
        motion: None,
        drift_corrected,
        draws: Vec::new(),
        residual: None,
        excluded: scan.excluded.clone(),
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
        .map(|pixels| labelled_like(&pixels.in_nm(&line.geometry.pixel_to_nm), reference));
    LineAnalysis {
        line: line.line,
        pixels: labelled_pixels(line, seen),
        sensor: seen.lattice,
        comparison,
        shortcut_wavelengths: line.lattice.shortcut_wavelengths,
        pixel_to_nm: line.geometry.pixel_to_nm,
        origin: line.geometry.origin,
        displacement: line.displacement.clone(),
        from_sensors: line.geometry.from_sensors,
        periods: line.lattice.periods,
        signal_to_noise: line.lattice.signal_to_noise,
        evidence: line.lattice.evidence.clone(),
        patch: line.lattice.patch.clone(),
        change: line.lattice.change,
        on_ground: line.lattice.ground.is_some(),
        ruler: None,
    }
}

/// The vectors in pixels under the names that they have in sensor coordinates.
fn labelled_pixels(line: &MeasuredLine, seen: &Observation) -> Lattice<Px> {
    let pixels = &line.lattice.pixels;
    match line.geometry.pixel_to_nm.try_inverse() {
        Some(inverse) => labelled_like(pixels, &(inverse * seen.lattice.basis)),
        None => *pixels,
    }
}

/// Unweighted mean of independent lattices, or of their waves.
pub(crate) fn plain_mean<Space>(all: &[Pair<Space, Nm>]) -> Option<Pair<Space, Nm>> {
    let n = all.len() as f64;
    (n > 0.0).then(|| {
        Pair::new(
            all.iter().map(|l| l.basis).sum::<Matrix2<f64>>() / n,
            all.iter().map(|l| l.covariance).sum::<Matrix4<f64>>() / (n * n),
        )
    })
}

/// The drift of each scan, by the time of its middle.
fn velocity_of(fit: &JointFit, scan: &MeasuredScan) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    Some(fit.velocity_at(middle_of_frame(scan)?))
}

/// A scan with its time and the way of the sample: that of the fit, or without one that of a steady drift.
fn with_motion(found: ScanAnalysis, fit: Option<&JointFit>, scan: &MeasuredScan) -> ScanAnalysis {
    let of = |velocity| {
        let middle = middle_of_frame(scan)?;
        let steady = || DriftPath::steady(velocity, middle);
        Some(Motion {
            middle,
            path: fit.map_or_else(steady, JointFit::path),
        })
    };
    ScanAnalysis {
        motion: found.drift.and_then(of),
        ..found
    }
}
