//! Predictions against simulated sets that are analysed from their pixels.

use moiregauge::campaign::analyse;
use moiregauge::plan::{Quantity, predict};
use moiregauge::scan::measure_scan;
use moiregauge::settings::Settings;
use moiregauge::simulate::{Simulation, Simulator};
use rayon::prelude::*;

/// Standard errors of drift (nm/s), twist (rad) and strain that the analysis states, root mean square over sets
/// with noise and orientation of their own. They are true: `docs/coverage.md`.
fn stated(conditions: &Simulation, settings: &Settings, sets: u64) -> [f64; 3] {
    let variances: Vec<[f64; 3]> = (0..sets)
        .into_par_iter()
        .map(|index| {
            let mut set = conditions.clone();
            set.seed = 1000 + index;
            set.sample.lattice_angle_deg += 137.507_764 * index as f64;
            let simulator = Simulator::new(set).unwrap();
            let scans = (0..simulator.frames())
                .map(|i| {
                    let name = Simulator::file_name(i);
                    measure_scan(&name, &simulator.frame(i), settings, None).unwrap()
                })
                .collect();
            let analysis = analyse(scans, settings);
            let found = &analysis.sets[0];
            let drift = found.drift.as_ref().unwrap().covariance;
            let strained = &found.mean.as_ref().unwrap().twist_strain;
            [
                drift.trace() / 2.0,
                strained.twist().sigma.powi(2),
                strained.strain().covariance.trace() / 2.0,
            ]
        })
        .collect();
    [0, 1, 2].map(|i| (variances.iter().map(|s| s[i]).sum::<f64>() / sets as f64).sqrt())
}

/// The predictions are the errors that the analysis of such scans states, within 10 %: white noise and noise of the lines,
/// position sensors or none. `docs/plan.md` holds them against the scatter of many more sets.
#[test]
fn predictions_are_the_errors_that_simulations_have() {
    let settings = Settings {
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    };
    let mut white = Simulation::default();
    white.raster.pixels = [64; 2];
    white.raster.scans = 4;
    white.noise.pixel_deg = 0.8;
    white.noise.clock_s = 0.52;
    (white.noise.line_deg, white.noise.flicker_deg) = (0.0, 0.0);
    let mut blind = white.clone();
    blind.raster.sensors = false;
    blind.raster.retrace = false;
    blind.window = moiregauge::simulate::Window {
        gain: [1.0; 2],
        shear_mrad: 0.0,
        ..white.window
    };
    let mut lines = white.clone();
    lines.noise.line_deg = 0.15;
    for (name, conditions) in [("white", white), ("blind", blind), ("lines", lines)] {
        let found = stated(&conditions, &settings, 40);
        let foreseen = predict(&[conditions], &settings, 40).unwrap();
        let predicted = [
            foreseen.drift_sigma(),
            foreseen.statistical(Quantity::Twist),
            foreseen.statistical(Quantity::Strain),
        ];
        for (i, what) in ["drift", "twist", "strain"].into_iter().enumerate() {
            let ratio = found[i] / predicted[i];
            println!("{name}: {what} {ratio:.3}");
            assert!((ratio - 1.0).abs() < 0.1, "{name}: {what} {ratio}");
        }
    }
}

/// Twice the scans are √2 better in the twist and 2√2 in a drift that phases tell; twice the size is twice as good
/// in the twist. The closed form of three cosines: `0.390 (a/L)(σ/A)/√N`.
#[test]
fn predictions_follow_the_closed_forms() {
    let settings = Settings {
        frame_time_sigma_s: 0.0,
        ..Settings::default()
    };
    let mut set = Simulation::default();
    set.raster.pixels = [256; 2];
    set.raster.retrace = false;
    set.raster.nominal_size_nm = [55.0; 2];
    set.raster.gap_s = 0.0;
    (set.window.gain, set.window.shear_mrad) = ([1.0; 2], 0.0);
    (set.sample.sharpness, set.sample.strain_percent) = (0.0, 0.0);
    set.drift.velocity_nm_per_min = [0.0; 2];
    (set.noise.pixel_deg, set.noise.sensor_nm) = (2.0, 0.0);
    (set.noise.line_deg, set.noise.flicker_deg) = (0.0, 0.0);
    let with = |scans: usize, size: f64| {
        let mut set = set.clone();
        set.raster.scans = scans;
        set.raster.nominal_size_nm = [55.0 * size; 2];
        predict(&[set], &settings, 1).unwrap()
    };
    let (ten, twenty, large) = (with(10, 1.0), with(20, 1.0), with(10, 2.0));
    let twist = |p: &moiregauge::plan::Prediction| p.statistical(Quantity::Twist);
    let closed = 0.390 * (0.246 / 55.0) * 2.0 / f64::sqrt(10.0 * 256.0 * 256.0);
    assert!((twist(&ten) / closed - 1.0).abs() < 0.01);
    assert!((twist(&ten) / twist(&twenty) / 2f64.sqrt() - 1.0).abs() < 0.01);
    assert!((twist(&ten) / twist(&large) / 2.0 - 1.0).abs() < 0.01);
    assert!(ten.linked);
    let drift = ten.drift_sigma() / twenty.drift_sigma();
    // Σ(t − t̄)² of n equal steps is n(n² − 1)/12.
    let expected = f64::sqrt(20.0 * 399.0 / (10.0 * 99.0));
    assert!((drift / expected - 1.0).abs() < 0.03, "{drift} {expected}");
}
