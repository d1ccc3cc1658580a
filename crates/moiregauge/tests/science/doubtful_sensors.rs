//! Position sensors that glitch, that lag through every turn, or that are not there: twist and strain stay
//! within its errors.
use moiregauge::campaign::{Analysis, analyse};
use moiregauge::caveat::Caveat;
use moiregauge::meaning::Source;
use moiregauge::scan::{MeasuredScan, measure_scan};
use moiregauge::settings::Settings;
use moiregauge::simulate::{SampleFeature, Simulation, Simulator, vary};
use spmfile::Scan;

fn settings() -> Settings {
    Settings {
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    }
}

/// Frames of a drawn sample, with what its sensors do.
fn set(sample: &str, seed: u64) -> Simulation {
    let mut set = Simulation {
        features: SampleFeature::parse(sample).unwrap(),
        ..Simulation::default()
    };
    set.raster.pixels = [128, 128];
    set.raster.scans = 4;
    vary(&mut set, seed);
    set
}

fn measured(set: &Simulation, change: impl Fn(Scan) -> Scan) -> Vec<MeasuredScan> {
    let simulator = Simulator::new(set.clone()).unwrap();
    let one = |i: usize| {
        let scan = change(simulator.frame(i));
        measure_scan(&Simulator::file_name(i), &scan, &settings(), None).unwrap()
    };
    (0..simulator.frames()).map(one).collect()
}

/// Error of the twist over its statistical σ, and that σ in degrees.
fn pull(set: &Simulation, analysis: &Analysis) -> (f64, f64) {
    let twist = analysis.sets[0].mean.as_ref().unwrap().twist();
    let miss = twist.value - set.sample.twist_deg.to_radians();
    (miss / twist.statistical, twist.statistical.to_degrees())
}

fn told<'a>(scans: &'a [MeasuredScan], code: &'a str) -> impl Iterator<Item = &'a Caveat> {
    let all = scans.iter().flat_map(|scan| &scan.caveats);
    all.filter(move |caveat| caveat.code() == code)
}

/// A per cent of samples that are off by a micrometre: errors as of the same sensors without, nearly, and honest.
#[test]
fn glitches_are_dropped() {
    let mut squares = 0.0;
    for seed in 1..=8 {
        let set = set("glitches:share=0.01,size=1000", seed);
        let mut sound = set.clone();
        sound.features.clear();
        let scans = measured(&set, |scan| scan);
        let messages: Vec<String> = told(&scans, "sensor-glitches")
            .map(Caveat::message)
            .collect();
        assert_eq!(messages.len(), 8, "{messages:?}");
        let (pull_now, sigma) = pull(&set, &analyse(scans, &settings()));
        let (_, before) = pull(&sound, &analyse(measured(&sound, |scan| scan), &settings()));
        assert!(sigma < 1.1 * before, "{seed}: {sigma} {before}");
        squares += pull_now * pull_now / 8.0;
    }
    // χ²(8)/8.
    assert!((0.2..2.5).contains(&squares), "{squares}");
}

/// A lag of any length between a tenth of a millisecond and a tenth of a line, with overscan: within the errors.
#[test]
fn lags_with_overscan_are_no_bias() {
    let mut squares = 0.0;
    let lags = [0.1, 0.5, 1.0, 2.0, 4.0, 6.0];
    for (lag, seed) in lags.iter().zip(11..) {
        let set = set(&format!("lag:time={lag}"), seed);
        let (pull, _) = pull(&set, &analyse(measured(&set, |scan| scan), &settings()));
        assert!(pull.abs() < 4.0, "{lag} ms: {pull} σ");
        squares += pull * pull / lags.len() as f64;
    }
    assert!(squares < 2.8, "{squares}");
}

/// Lags of a tenth to a quarter of a line, which no single line shows: seen from trace against retrace, with their time constant.
#[test]
fn slow_lags_are_seen_from_trace_against_retrace() {
    for (lag, seed) in [(8.0, 21), (12.0, 22), (16.0, 23)] {
        let set = set(&format!("lag:time={lag}"), seed);
        let scans = measured(&set, |scan| scan);
        let messages: Vec<String> = told(&scans, "sensor-lag").map(Caveat::message).collect();
        assert_eq!(messages.len(), 8, "{lag}: {messages:?}");
        for words in messages {
            let constant = words.split("a time constant of ").nth(1).unwrap();
            let constant: f64 = constant.split(' ').next().unwrap().parse().unwrap();
            assert!((constant / lag - 1.0).abs() < 0.1, "{lag}: {words}");
        }
        let analysis = analyse(scans, &settings());
        let (pull, sigma) = pull(&set, &analysis);
        assert!(
            pull.abs() < 4.0 && sigma < 0.02,
            "{lag} ms: {pull} of {sigma}"
        );
    }
}

/// The same frames without sensors, as a file whose size may span N pixels or N − 1: the doubt is a row of the budget, and
/// covers both. With sensors, and in formats that define their size, there is none.
#[test]
fn the_pitch_is_in_the_budget_without_sensors() {
    let mut set = set("clean", 3);
    // The window goes where it is told: nothing is wrong but the convention.
    set.raster.nominal_size_nm = [90.0, 90.0];
    set.window.gain = [1.0; 2];
    set.window.shear_mrad = 0.0;
    let through_a_file = |scan: Scan| {
        let bytes = spmfile::nanoscope::write(&scan).unwrap();
        spmfile::read(&bytes).unwrap()
    };
    let row = |analysis: &Analysis| {
        let mean = analysis.sets[0].mean.as_ref().unwrap();
        let covariance = mean.budget.of(Source::Pitch).covariance;
        (covariance[(0, 0)].sqrt(), mean.twist_strain.twist)
    };
    let with = analyse(measured(&set, through_a_file), &settings());
    assert_eq!(row(&with).0, 0.0);
    set.raster.sensors = false;
    let (sigma, twist) = row(&analyse(measured(&set, through_a_file), &settings()));
    let share = 1.0 / (std::f64::consts::SQRT_2 * 128.0);
    assert!((sigma / twist / share - 1.0).abs() < 0.02, "{sigma}");
    // Read by the other convention the twist changes by 1/N, √2 of that.
    let edges = |scan: Scan| {
        let mut scan = through_a_file(scan);
        for channel in &mut scan.channels {
            channel.span = spmfile::Span::PixelEdges;
        }
        scan
    };
    let (_, other) = row(&analyse(measured(&set, edges), &settings()));
    let change = (other - twist).abs() / sigma;
    assert!(
        (change / std::f64::consts::SQRT_2 - 1.0).abs() < 0.05,
        "{change}"
    );
    let gwyddion = |scan: Scan| Scan {
        format: "Gwyddion".to_owned(),
        ..through_a_file(scan)
    };
    assert_eq!(row(&analyse(measured(&set, gwyddion), &settings())).0, 0.0);
}
