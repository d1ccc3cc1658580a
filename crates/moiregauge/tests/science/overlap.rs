//! Scans of which only a part is used: where it lay, and when it was recorded.

use moiregauge::campaign::analyse;
use moiregauge::scan::{MeasuredScan, Window, common_window, measure_scan};
use moiregauge::settings::Settings;
use moiregauge::simulate::{Simulation, Simulator};
use spmfile::{Block, FrameDirection, Scan, crop};

/// Six small frames, up and down in turn, of a sample that drifts fast.
fn frames() -> (Simulation, Vec<Scan>) {
    let mut simulation = Simulation {
        seed: 3,
        ..Simulation::default()
    };
    simulation.raster.pixels = [128, 160];
    simulation.raster.scans = 6;
    simulation.drift.velocity_nm_per_min = [3.0, -2.0];
    let simulator = Simulator::new(simulation.clone()).unwrap();
    let frames = (0..simulator.frames()).map(|i| simulator.frame(i));
    let frames = frames.collect();
    (simulation, frames)
}

fn settings() -> Settings {
    Settings {
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    }
}

/// The bottom 100 of 160 lines are used: 60 lines come after them on the way up, none on the way down. A
/// frame time that is wrong by half of that displaces the frames by 0.2 nm against each other, which the
/// phases see; drift and χ² are those of the truth only with the right times.
#[test]
fn the_time_of_a_part_is_its_own() {
    let (simulation, frames) = frames();
    let settings = settings();
    let mut part = frames[0].clone();
    let block = Block {
        column: 0,
        row: 0,
        columns: 128,
        rows: 100,
    };
    crop(&mut part, block).unwrap();
    let window = common_window(&[Window::of(&part, &settings).unwrap()]).unwrap();
    let measured: Vec<MeasuredScan> = frames
        .iter()
        .enumerate()
        .map(|(i, scan)| measure_scan(&format!("{i}"), scan, &settings, Some(&window)).unwrap())
        .collect();
    for scan in &measured {
        for line in &scan.lines {
            assert_eq!(line.frame_columns, 128);
            let rows = line.geometry.size[1];
            // The window of the scanner wanders by a few lines.
            assert!(rows.abs_diff(100) < 16, "{rows} lines");
            let expected = match scan.frame_direction {
                Some(FrameDirection::Up) => 60,
                _ => 0,
            };
            assert!(
                line.lines_after.abs_diff(expected) < 16,
                "{}",
                line.lines_after
            );
        }
    }
    let analysis = analyse(measured, &settings);
    assert_eq!(
        analysis.sets.len(),
        1,
        "frames of one set, a sample more or less wide"
    );
    let set = &analysis.sets[0];
    let drift = set.drift.as_ref().unwrap();
    assert!(drift.joint.as_ref().unwrap().phases, "phases are linked");
    let truth = simulation.drift.velocity_nm_per_min;
    for (i, truth) in truth.into_iter().enumerate() {
        let sigma = drift.covariance[(i, i)].sqrt() * 60.0;
        let error = drift.velocity[i] * 60.0 - truth;
        assert!(error.abs() < 4.0 * sigma, "{error} ± {sigma}");
    }
    assert!(
        drift.joint.as_ref().unwrap().instability_nm < 0.02,
        "{drift:?}"
    );
}
