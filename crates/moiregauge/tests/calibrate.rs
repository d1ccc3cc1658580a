//! Simulated scanners with gain errors, mismatch and axes that are not at a right angle, calibrated on images of a
//! known lattice. Twisted by 60° two equal layers have a "moiré" with the lattice constant of the layers:
//! `λ = a/(2 sin 30°)`, an atomic lattice for the simulator.

use moiregauge::budget::Source;
use moiregauge::calibration::{Calibration, KnownLattice};
use moiregauge::series::{Calibrated, analyse, calibrate, measure_known, measure_scan};
use moiregauge::settings::{Grouping, Settings};
use moiregauge::simulate::{Simulation, Simulator};
use nalgebra::Matrix2;
use rayon::prelude::*;

/// Two frames, up and down, of an atomic lattice; no position sensors.
fn atoms(seed: u64) -> Simulation {
    let mut set = Simulation {
        seed,
        ..Simulation::default()
    };
    set.sample.twist_deg = 60.0;
    set.sample.strain_percent = 0.0;
    set.sample.sharpness = 0.1;
    set.sample.lattice_angle_deg = 137.5 * seed as f64;
    set.raster.scans = 2;
    set.raster.pixels = [96; 2];
    set.raster.nominal_size_nm = [4.0; 2];
    set.raster.sensors = false;
    // A scanner of its own for every seed, by multiples of irrational numbers.
    let spread = |k: f64| 2.0 * (k * (seed as f64 + 0.5)).fract() - 1.0;
    set.window.gain = [
        1.0 + 0.04 * spread(0.618_034),
        1.0 + 0.04 * spread(0.414_214),
    ];
    set.window.shear_mrad = 15.0 * spread(0.732_051);
    set.drift.velocity_nm_per_min = [0.3 * spread(0.236_068), 0.3 * spread(0.141_593)];
    set
}

/// Graphene's lattice as the simulator has it, known exactly.
fn exact() -> KnownLattice {
    KnownLattice::hexagonal("graphene", 0.246, 0.0, "the simulator")
}

fn calibrated(set: &Simulation, drift_sigma_nm_per_min: f64) -> Calibrated {
    let simulator = Simulator::new(set.clone()).unwrap();
    let known = exact();
    let cell = known.cell().unwrap();
    let scans = (0..simulator.frames())
        .map(|i| {
            let name = Simulator::file_name(i);
            measure_known(&name, &simulator.frame(i), &Settings::default(), &cell).unwrap()
        })
        .collect();
    calibrate(scans, &known, drift_sigma_nm_per_min / 60.0, Grouping::Auto).unwrap()
}

/// Per cent, per cent, mrad: the scanner leads the tip to S n in place of n, so that the true r is shown as
/// `S⁻¹ r`; without its turn that is `F = √(S⁻¹S⁻ᵀ)`, the root of a 2×2 matrix M being `(M + √det)/√(tr + 2√det)`.
fn truth(set: &Simulation) -> [f64; 3] {
    let [x, y] = set.window.gain;
    let (sine, cosine) = (set.window.shear_mrad / 1000.0).sin_cos();
    let inverse = Matrix2::new(x, y * sine, 0.0, y * cosine)
        .try_inverse()
        .unwrap();
    let square = inverse * inverse.transpose();
    let det = square.determinant().sqrt();
    let f = (square + Matrix2::identity() * det) / (square.trace() + 2.0 * det).sqrt();
    [
        100.0 * (f64::midpoint(f.m11, f.m22) - 1.0),
        100.0 * (f.m11 - f.m22),
        2000.0 * f.m12,
    ]
}

/// Errors over σ.
fn pulls(found: &Calibration, truth: [f64; 3]) -> [f64; 3] {
    let estimates = found.estimates();
    [0, 1, 2].map(|i| (estimates[i].value - truth[i]) / estimates[i].sigma)
}

/// The scatter of a mean square over n normal deviates is √(2/n).
fn assert_honest(all: &[[f64; 3]], what: &str) {
    let n = all.len() as f64;
    for i in 0..3 {
        let square = all.iter().map(|p| p[i] * p[i]).sum::<f64>() / n;
        let tolerance = 4.0 * (2.0 / n).sqrt();
        assert!(
            (square - 1.0).abs() < tolerance,
            "{what} {i}: mean square pull {square}"
        );
        let within = all.iter().filter(|p| p[i].abs() < 1.0).count() as f64 / n;
        let tolerance = 4.0 * (0.683 * 0.317 / n).sqrt();
        assert!(
            (within - 0.683).abs() < tolerance,
            "{what} {i}: {within} within 1 σ"
        );
        let farthest = all.iter().map(|p| p[i].abs()).fold(0.0, f64::max);
        assert!(farthest < 4.0, "{what} {i}: {farthest} σ");
    }
    // 0.27 % of true errors lie beyond 3 σ: the number is Poisson's; three and a half of its standard errors.
    let expected = 0.0027 * 3.0 * n;
    let beyond = all.iter().flatten().filter(|p| p.abs() > 3.0).count() as f64;
    let most = expected + 3.5 * expected.sqrt();
    assert!(
        beyond <= most,
        "{what}: {beyond} beyond 3 σ, expected {expected}"
    );
}

/// One pair of frames tells the scanner as well as it says, drift and all: each number of the first ten scanners within
/// 3 σ, and as many of all hundred within 1 σ as there have to be.
#[test]
fn a_pair_of_frames_tells_the_scanner() {
    let all: Vec<[f64; 3]> = (0..100_u64)
        .into_par_iter()
        .map(|seed| {
            let set = atoms(seed);
            let found = calibrated(&set, 1.0);
            assert!(found.covariance_known && found.sets[0].drift.is_some());
            let codes: Vec<&str> = found.caveats.iter().map(|c| c.code.as_str()).collect();
            assert!(!codes.contains(&"drift-not-separated"), "{codes:?}");
            pulls(&found.calibration, truth(&set))
        })
        .collect();
    let few = &all[..10];
    assert!(few.iter().flatten().all(|p| p.abs() < 3.0), "{few:?}");
    assert_honest(&all, "pair");
}

/// One frame does not tell drift from gain, and says so; with drifts as the prior has them its errors are true,
/// and far larger than those of a pair.
#[test]
fn one_frame_does_not_tell_drift_from_gain() {
    let sigma = 0.1;
    let all: Vec<[f64; 3]> = (0..60_u64)
        .into_par_iter()
        .map(|seed| {
            let mut set = atoms(seed);
            set.raster.scans = 1;
            // Box and Muller's normal deviates.
            let part = |k: f64| (k * (seed as f64 + 0.5)).fract();
            let radius = sigma * (-2.0 * part(0.680_327).ln()).sqrt();
            let (sine, cosine) = (std::f64::consts::TAU * part(0.381_966)).sin_cos();
            set.drift.velocity_nm_per_min = [radius * cosine, radius * sine];
            let found = calibrated(&set, sigma);
            assert!(found.sets[0].drift.is_none());
            assert!(
                found
                    .caveats
                    .iter()
                    .any(|c| c.code == "drift-not-separated")
            );
            assert!(found.calibration.estimates()[1].sigma > 10.0 * found.statistical[1]);
            pulls(&found.calibration, truth(&set))
        })
        .collect();
    assert_honest(&all, "one frame");
}

/// The moiré of the same scanner comes out right with its calibration and wrong without; what is not known of
/// the scanner is in the budget.
#[test]
fn a_calibration_takes_the_scanner_out_of_twist_and_strain() {
    let mut atomic = atoms(7);
    atomic.window.gain = [0.97, 1.012];
    atomic.window.shear_mrad = 6.0;
    let calibration = calibrated(&atomic, 1.0).calibration;
    let mut moire = Simulation::default();
    moire.raster.pixels = [128; 2];
    moire.raster.scans = 4;
    moire.raster.nominal_size_nm = [60.0; 2];
    moire.raster.sensors = false;
    moire.window = atomic.window;
    let simulator = Simulator::new(moire.clone()).unwrap();
    let axis = 2.0 * simulator.truth().strain_axis_lab_deg.to_radians();
    let strain = [axis.cos(), axis.sin()].map(|part| 0.12 * part);
    let mean = |scanner: Option<&Calibration>| {
        let settings = Settings {
            scanner: scanner.cloned(),
            drift_draws: 0,
            strain_draws: 0,
            ..Settings::default()
        };
        let scans = (0..4)
            .map(|i| {
                let name = Simulator::file_name(i);
                measure_scan(&name, &simulator.frame(i), &settings, None).unwrap()
            })
            .collect();
        let analysis = analyse(scans, &settings);
        let mean = analysis.sets[0].mean.clone().unwrap();
        let found = mean.twist_strain;
        let errors = [
            found.twist.to_degrees() - moire.sample.twist_deg,
            100.0 * found.strain_vector.x - strain[0],
            100.0 * found.strain_vector.y - strain[1],
        ];
        let codes: Vec<String> = analysis.caveats.into_iter().map(|c| c.code).collect();
        (errors, mean.budget, codes)
    };
    let (without, priors, codes) = mean(None);
    // θ s and θ g/(1 + ν), with s = −0.9 % and g = 4.2 %.
    assert!(
        (without[0].abs() / 0.0102 - 1.0).abs() < 0.15,
        "{without:?}"
    );
    let size = without[1].hypot(without[2]);
    let expected = 100.0 * 1.13_f64.to_radians() * 0.0428_f64.hypot(0.006) / 1.16;
    assert!((size / expected - 1.0).abs() < 0.05, "{size} {expected}");
    assert!(codes.iter().any(|c| c == "no-position-sensors"));

    let (with, budget, codes) = mean(Some(&calibration));
    let statistical = budget.statistical.whole();
    assert!(statistical.iter().all(|v| v.is_finite()));
    let sigma = budget
        .sum(|s| s.is_statistical() || calibrates(s))
        .covariance;
    // A rotation of the scanner is not known: it turns the strain by no more than the shear, 6 mrad.
    let turned = 0.12 * 0.006;
    assert!(
        with[0].abs() < 3.0 * sigma[(0, 0)].sqrt().to_degrees(),
        "{with:?}"
    );
    for i in [1, 2] {
        let limit = 3.0 * 100.0 * sigma[(i + 1, i + 1)].sqrt() + turned;
        assert!(with[i].abs() < limit, "{with:?} {limit}");
    }
    assert!(
        codes.iter().all(|c| c != "no-position-sensors"),
        "{codes:?}"
    );
    assert!(
        codes.iter().any(|c| c == "calibration-extrapolated"),
        "{codes:?}"
    );
    for source in [Source::Gain, Source::Mismatch, Source::Orthogonality] {
        let (before, after) = (priors.of(source).wavelengths, budget.of(source).wavelengths);
        assert!(
            after[0] > 0.0 && after[0] < 0.1 * before[0],
            "{source:?} {after:?} {before:?}"
        );
    }
    // Of an error that gain and mismatch share, only what the map makes of it counts: dL = −F⁻¹ dF L.
    let mut along_x = calibration.clone();
    along_x.covariance = [[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 0.0]];
    let (_, budget, _) = mean(Some(&along_x));
    let lattice_like = budget.sum(calibrates).wavelengths;
    let rows = [Source::Gain, Source::Mismatch, Source::Orthogonality];
    let rows: Vec<f64> = rows.iter().map(|s| budget.of(*s).wavelengths[0]).collect();
    assert!((rows[0] / lattice_like[0] - 1.0).abs() < 1e-9, "{rows:?}");
}

fn calibrates(source: Source) -> bool {
    matches!(
        source,
        Source::Gain | Source::Mismatch | Source::Orthogonality
    )
}
