//! Drift and draws of a set as published (`drift::paper`, `strain::paper`).

use heterostrain::strain::published_draws;
use nalgebra::{Matrix2, Vector2};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::campaign::analysis::ScanAnalysis;
use crate::campaign::motion::{Drift, DriftFit};
use crate::campaign::set::solved::Solved;
use crate::drift::linear::{DriftSolution, Observation, at_known_drift, common_lattice};
use crate::drift::paper::{PaperScan, normal_vector, successive_draws, successive_drift};
use crate::drift::shares::Statistical;
use crate::frame::axis::Axis;
use crate::numbers::{interrupt, rng};
use crate::scan::measured::{MeasuredLine, MeasuredScan};
use crate::settings::knobs::Settings;

/// The scans as the published estimate wants them: six peaks, signed velocities in laboratory axes.
pub(crate) fn paper_scans(scans: &[&MeasuredScan], all: &[Observation]) -> Vec<PaperScan> {
    let lines = scans.iter().flat_map(|s| &s.lines);
    lines
        .zip(all)
        .filter_map(|(l, o)| paper_scan(l, o))
        .collect()
}

fn paper_scan(line: &MeasuredLine, seen: &Observation) -> Option<PaperScan> {
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
    let (peaks, peak_covariance) = peaks(line, seen);
    Some(PaperScan {
        peaks,
        peak_covariance,
        slow_axis,
        fast_velocity,
        slow_velocity,
        velocity_sigmas: line
            .speeds
            .map(|v| if v.sigma > 0.0 { v.sigma } else { 0.0 }),
        line: line.line,
    })
}

/// The six peaks in the order of the lattice's names, nm: as published where the image was measured so, otherwise
/// those of the lattice, with the mean error of its two vectors.
fn peaks(line: &MeasuredLine, seen: &Observation) -> ([Vector2<f64>; 6], Matrix2<f64>) {
    let names = PaperScan::six(&seen.lattice.basis);
    let Some(published) = &line.lattice.published else {
        let c = &seen.lattice.covariance;
        let mean = c.fixed_view::<2, 2>(0, 0) + c.fixed_view::<2, 2>(2, 2);
        return (names, mean / 2.0);
    };
    let to_nm = line.geometry.pixel_to_nm;
    let three = published.vectors.map(|v| to_nm * v);
    let all = three.iter().flat_map(|v| [*v, -v]);
    let peaks = names.map(|name| {
        let nearest = all
            .clone()
            .min_by(|a, b| (a - name).norm().total_cmp(&(b - name).norm()));
        nearest.unwrap_or(name)
    });
    (peaks, to_nm * published.covariance * to_nm.transpose())
}

/// The published drift of a set, and the common lattice at that drift. Nothing is enlarged for scatter. An error says why there is none.
pub(crate) fn drift(
    name: &str,
    scans: &[PaperScan],
    all: &[Observation],
    linear: &DriftSolution,
    settings: &Settings,
) -> Result<Solved, String> {
    let no_minimum = "the published comparison of successive scans has no minimum. Either no two successive scans have \
                      the same line direction, or the scans contradict each other";
    let minimum = successive_drift(scans).ok_or(no_minimum)?;
    let stream = format!("drift {name}");
    let draws = successive_draws(scans, settings.drift_draws, settings.seed, &stream);
    let (velocity, covariance) = draws
        .as_ref()
        .map_or((minimum, linear.covariance), |d| (d.mean, d.covariance));
    let (lattice, chi2, freedom) =
        common_lattice(all, &velocity, &covariance).map_err(|error| error.to_string())?;
    let parts = at_known_drift(all).ok_or("the lattices of the scans have no usable errors")?;
    Ok(Solved {
        drift: Drift {
            velocity,
            covariance,
            given: false,
            fit: Some(DriftFit {
                rank: linear.rank,
                condition: linear.condition,
                chi2,
                degrees_of_freedom: freedom,
                paper_velocity: Some(minimum),
            }),
            monte_carlo: draws,
            joint: None,
        },
        statistical: Statistical::at_known_drift(parts, 1.0, &lattice.covariance),
        lattice,
        chi2,
        freedom,
        assumed: None,
        enlargement: 1.0,
    })
}

/// Draws twist and strain of every scan: peaks, tip velocities and a drift of its own for each draw, and the 48
/// equations. `first_index` numbers the scans.
pub(crate) fn draw_all(
    scans: &mut [ScanAnalysis],
    measured: &[MeasuredScan],
    observations: &[Vec<Observation>],
    drift: &Drift,
    settings: &Settings,
    first_index: u64,
) {
    scans.par_iter_mut().enumerate().for_each(|(i, scan)| {
        let Some(k) = measured.iter().position(|m| m.file == scan.file) else {
            return;
        };
        let lines = paper_scans(&[&measured[k]], &observations[k]);
        if let Some(lattice) = &scan.drift_corrected {
            let mut rng = rng::stream(settings.seed, "strain", first_index + i as u64);
            let drawn = (0..settings.strain_draws).filter_map(|_| {
                interrupt::check();
                mean_peaks(&lines, drift, &mut rng)
            });
            let convention = settings.strain_convention;
            scan.draws = published_draws(lattice, settings.bilayer(), convention, drawn);
        }
    });
}

/// The corrected peaks of one draw, the mean of trace and retrace, nm.
fn mean_peaks(
    lines: &[PaperScan],
    drift: &Drift,
    rng: &mut ChaCha8Rng,
) -> Option<[Vector2<f64>; 6]> {
    let velocity = drift.velocity + normal_vector(&drift.covariance, rng);
    let mut mean = [Vector2::zeros(); 6];
    for line in lines {
        let corrected = line.drawn(rng).corrected(&velocity)?;
        for (sum, peak) in mean.iter_mut().zip(corrected) {
            *sum += peak / lines.len() as f64;
        }
    }
    (!lines.is_empty()).then_some(mean)
}
