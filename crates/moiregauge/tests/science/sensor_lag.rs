//! Simulated frames whose position sensors lag behind the tip: what is measured stays right, and the lag is told.

use moiregauge::campaign::analyse;
use moiregauge::caveat::Caveat;
use moiregauge::meaning::Source;
use moiregauge::scan::{MeasuredScan, measure_scan};
use moiregauge::settings::Settings;
use moiregauge::simulate::{Simulation, Simulator};
use spmfile::{LineDirection, Samples, Scan};

fn set(seed: u64) -> Simulation {
    let mut set = Simulation {
        seed,
        ..Simulation::default()
    };
    set.sample.lattice_angle_deg = 137.5 * seed as f64;
    set.sample.strain_axis_deg = 77.0 * seed as f64;
    set.raster.scans = 4;
    set.raster.pixels = [96, 96];
    set.raster.nominal_size_nm = [90.0; 2];
    set.raster.rounding = 0.0;
    if seed % 2 == 1 {
        set.raster.rotation_deg = 90.0;
    }
    set
}

/// What sensors of the first order with the time constant `lag_s` show: at constant speed they are late by `V T`, and
/// after the turn-around they were ahead by as much.
fn lagging(mut scan: Scan, lag_s: f64) -> Scan {
    let rate = scan.line_rate_hz.unwrap();
    for channel in &mut scan.channels {
        if !channel.name.ends_with("sensor") {
            continue;
        }
        let (columns, scale) = (channel.columns, channel.scale);
        let pixel_s = 0.5 / rate / (columns - 1) as f64;
        let values = channel.values();
        let sum: f64 = values
            .chunks_exact(columns)
            .map(|line| line[columns - 1] - line[0])
            .sum();
        let step = sum / (channel.rows * (columns - 1)) as f64;
        let retrace = channel.line_direction == Some(LineDirection::Retrace);
        let counts = values.iter().enumerate().map(|(i, value)| {
            let column = i % columns;
            let (since, speed) = if retrace {
                (columns - 1 - column, -step / pixel_s)
            } else {
                (column, step / pixel_s)
            };
            let passed = (-(since as f64) * pixel_s / lag_s).exp();
            let late = speed * lag_s * (1.0 - 2.0 * passed);
            ((value - late) / scale).round() as i32
        });
        channel.samples = Samples::I32(counts.collect());
    }
    scan
}

fn measured(set: &Simulation, lag_s: Option<f64>) -> Vec<MeasuredScan> {
    let simulator = Simulator::new(set.clone()).unwrap();
    let frames = (0..simulator.frames()).map(|i| {
        let scan = simulator.frame(i);
        let scan = match lag_s {
            Some(lag) => lagging(scan, lag),
            None => scan,
        };
        measure_scan(&Simulator::file_name(i), &scan, &Settings::default(), None).unwrap()
    });
    frames.collect()
}

fn told(scans: &[MeasuredScan]) -> Vec<String> {
    let caveats = scans.iter().flat_map(|s| &s.caveats);
    caveats
        .filter(|c| c.code() == "sensor-lag")
        .map(Caveat::message)
        .collect()
}

/// Twist and both components of strain within 4 σ of noise, drift and sensors, for lags from a fifth of a pixel to some
/// pixels; what makes the pixels notably too short is told, with its time constant.
#[test]
fn sensors_that_lag_are_no_bias() {
    let settings = Settings {
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    };
    for (seed, lag_ms) in [(0, 0.3), (1, 1.0), (2, 2.0), (3, 2.0), (4, 3.0), (5, 4.0)] {
        let set = set(seed);
        let scans = measured(&set, Some(1e-3 * lag_ms));
        let messages = told(&scans).join("\n");
        if lag_ms >= 1.0 {
            assert_eq!(told(&scans).len(), 8, "{lag_ms} ms: {messages}");
            let constant = messages.split("a time constant of ").nth(1).unwrap();
            let constant: f64 = constant.split(' ').next().unwrap().parse().unwrap();
            // A bend of 0.3 nm under a noise of 0.2 nm in 96 lines is less sharp than one of some nanometres.
            let within = if lag_ms > 1.5 { 0.1 } else { 0.4 };
            assert!((constant / lag_ms - 1.0).abs() < within, "{messages}");
        }
        let analysis = analyse(scans, &settings);
        let mean = analysis.sets[0].mean.clone().unwrap();
        let found = mean.twist_strain;
        let simulator = Simulator::new(set.clone()).unwrap();
        let axis = 2.0 * simulator.truth().strain_axis_lab_deg.to_radians();
        let strain = 0.01 * set.sample.strain_percent;
        let misses = [
            found.twist - set.sample.twist_deg.to_radians(),
            found.strain_vector.x - strain * axis.cos(),
            found.strain_vector.y - strain * axis.sin(),
        ];
        let statistical = mean.budget.sum(Source::is_statistical).covariance;
        let places = [0, 2, 3];
        for (miss, place) in misses.iter().zip(places) {
            let pull = miss / statistical[(place, place)].sqrt();
            assert!(pull.abs() < 4.0, "{lag_ms} ms, {place}: {pull} σ");
        }
    }
}

/// Sensors without a lag, with noise, creep of the window and without noise, are not suspected.
#[test]
fn sensors_without_lag_are_not_suspected() {
    for seed in 0..12 {
        let mut set = set(seed);
        set.raster.scans = 2;
        set.raster.pixels = [64, 64];
        set.noise.sensor_nm = [0.0, 0.05, 0.2, 1.0][seed as usize % 4];
        set.window.creep_nm_per_min = [1.0, -2.0];
        let scans = measured(&set, None);
        assert!(told(&scans).is_empty(), "{seed}: {:?}", told(&scans));
        let lines = scans.iter().flat_map(|s| &s.lines);
        for line in lines {
            let sigma = line.geometry.covariance[(0, 0)].max(line.geometry.covariance[(1, 1)]);
            assert!(
                sigma.sqrt() <= 0.01 * set.noise.sensor_nm + 1e-6,
                "{seed}: {sigma}"
            );
        }
    }
}
