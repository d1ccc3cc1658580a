//! Frames that do not tell the drift: twist and strain have a total all the same, with the drift as a prior.

use moiregauge::campaign::{Analysis, SetMean, analyse};
use moiregauge::meaning::Source;
use moiregauge::scan::measure_scan;
use moiregauge::settings::Settings;
use moiregauge::simulate::{Simulation, Simulator};
use spmfile::Scan;

fn quick(prior: f64) -> Settings {
    Settings {
        drift_draws: 0,
        strain_draws: 0,
        drift_prior_nm_per_min: prior,
        ..Settings::default()
    }
}

/// Frames of a set of two, up and down, with a small drift.
fn frames(seed: u64) -> Vec<Scan> {
    let mut set = Simulation {
        seed,
        ..Simulation::default()
    };
    set.raster.pixels = [96, 96];
    set.raster.scans = 2;
    let simulator = Simulator::new(set).unwrap();
    (0..2).map(|i| simulator.frame(i)).collect()
}

fn analysed(frames: &[Scan], prior: f64) -> Analysis {
    let named = frames.iter().enumerate();
    let measured = named
        .map(|(i, scan)| measure_scan(&format!("scan.{i}"), scan, &quick(prior), None).unwrap());
    analyse(measured.collect(), &quick(prior))
}

fn mean(found: &Analysis) -> &SetMean {
    found.sets[0].mean.as_ref().unwrap()
}

/// What the drift makes of L₁, nm.
fn of_drift(mean: &SetMean) -> f64 {
    mean.budget.of(Source::Drift).wavelengths[0].sqrt()
}

fn message(found: &Analysis, code: &str) -> String {
    let mut all = found.caveats.iter().filter(|c| c.code() == code);
    all.next().unwrap().message()
}

/// A vector R of a frame whose lines advance by V along y is longer by `D·R/|R| × R_y/V`: `σ_D |R_y|/V` for a drift of `σ_D` each way. The
/// prior is no more than V/4.
#[test]
fn one_frame_has_a_total() {
    let frames = frames(1);
    let alone = &frames[..1];
    let found = analysed(alone, 1.0);
    let mean = mean(&found);
    let scan = &found.sets[0].scans[0];
    assert_eq!(mean.lattice.basis, scan.sensor.basis);
    assert!(found.sets[0].drift.is_none() && found.sets[0].with_drift().is_none());
    let speed = scan.slow_velocity.value;
    let height = mean.lattice.vector(0).y.abs();
    let expected = height / speed / 60.0;
    assert!((of_drift(mean) / expected - 1.0).abs() < 1e-2, "{expected}");
    let [half, most] = [0.5, 1e5].map(|prior| of_drift(self::mean(&analysed(alone, prior))));
    assert!((half / expected - 0.5).abs() < 1e-2, "{half}");
    assert!((most / height - 0.25).abs() < 1e-2, "{most}");
    let total = mean.twist().total;
    let without = mean.budget.sum(|s| s != Source::Drift).covariance[(0, 0)].sqrt();
    assert!(total > without && mean.budget.drift_assumed);
    let words = message(&found, "drift-undetermined");
    for part in [
        "0 ± 1.0 nm/min",
        "total error of the twist",
        "leave about ±",
    ] {
        assert!(words.contains(part), "{words}");
    }
    assert!(found.combined.is_some());
}

/// Frames of one direction share their drift: two of them leave it as open as one.
#[test]
fn frames_of_one_direction_do_not_average_the_drift() {
    let frames = frames(2);
    let one = analysed(&frames[..1], 1.0);
    let mut other = Simulation {
        seed: 77,
        ..Simulation::default()
    };
    other.raster.pixels = [96, 96];
    other.raster.scans = 1;
    let two = Simulator::new(other).unwrap().frame(0);
    let two = analysed(&[frames[0].clone(), two], 1.0);
    assert_eq!(two.sets.len(), 1);
    let ratio = of_drift(mean(&two)) / of_drift(mean(&one));
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
}

/// Without a rate the slow speed is that of 1.2 Hz, which is between 0.5 and 10 Hz; a rate alone tells it without its sense.
#[test]
fn a_frame_without_times_has_a_total() {
    let frames = frames(3);
    let told = of_drift(mean(&analysed(&frames[..1], 1.0)));
    let mut scan = frames[0].clone();
    let rate = scan.line_rate_hz.unwrap();
    scan.frame_direction = None;
    let unknown = analysed(&[scan.clone()], 1.0);
    assert!((of_drift(mean(&unknown)) / told - 1.0).abs() < 0.02);
    (scan.line_rate_hz, scan.line_times_s) = (None, None);
    let unknown = analysed(&[scan], 1.0);
    let found = of_drift(mean(&unknown));
    assert!(
        (found / told / (rate / 1.225) - 1.0).abs() < 0.02,
        "{found} {told} {rate}"
    );
    assert!(mean(&unknown).assumed.unwrap().no_rate);
    assert!(message(&unknown, "no-timing").contains("a line rate between 0.5 and 10 Hz"));
}

/// Frames up and down measure the drift: no prior is in their results.
#[test]
fn a_measured_drift_needs_no_prior() {
    let frames = frames(4);
    let [small, large] = [0.1, 10.0].map(|prior| analysed(&frames, prior));
    let twist = |found: &Analysis| (mean(found).twist().value, mean(found).twist().total);
    assert_eq!(twist(&small), twist(&large));
    assert!(small.sets[0].with_drift().is_some());
}
