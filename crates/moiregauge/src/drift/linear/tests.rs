//! The drift model against its definition, the published matrices and the closed-form σ table.

use nalgebra::{Matrix2, Matrix4, Vector2};
use rand_distr::{Distribution, StandardNormal};
use spmfile::{FrameDirection, LineDirection};

use super::*;
use crate::drift::monte_carlo;
use crate::drift::paper::{
    PaperScan, matrix, successive_draws, successive_drift, successive_objective,
};
use crate::frame::axis::Axis;
use crate::frame::geometry::{Geometry, Timing};
use crate::numbers::rng::stream;

const NM_PER_MIN: f64 = 1.0 / 60.0;

fn frame(n: usize, slow: Axis, shear: f64) -> Geometry {
    let rotation = match slow {
        Axis::Y => 0.0,
        Axis::X => std::f64::consts::FRAC_PI_2,
    };
    let mut g = Geometry::nominal([n, n], 54.7, 56.8, rotation, Vector2::zeros()).unwrap();
    g.pixel_to_nm = Matrix2::new(1.0, shear, 0.0, 1.0) * g.pixel_to_nm;
    g
}

fn gradient(slow: Axis, shear: f64, rate: f64, up: bool, trace: bool) -> Vector2<f64> {
    let frame_direction = if up {
        FrameDirection::Up
    } else {
        FrameDirection::Down
    };
    let line = if trace {
        LineDirection::Trace
    } else {
        LineDirection::Retrace
    };
    let timing = Timing::new(512, rate, 0.0, frame_direction, line).unwrap();
    frame(512, slow, shear).time_gradient(&timing).unwrap()
}

fn lattice() -> Matrix2<f64> {
    Matrix2::new(12.5, 6.25, 0.0, 12.5 * 0.75f64.sqrt())
}

/// What a scan with time gradient `u` observes of `truth` under drift: the fixed point of
/// `r = R + (u·r) D`, iterated rather than inverted.
fn observed(truth: &Matrix2<f64>, u: &Vector2<f64>, drift: &Vector2<f64>) -> Matrix2<f64> {
    let mut seen = *truth;
    for _ in 0..200 {
        seen = truth + drift * (seen.transpose() * u).transpose();
    }
    seen
}

fn observation(basis: Matrix2<f64>, u: Vector2<f64>, sigma: f64) -> Observation {
    Observation {
        lattice: Lattice::new(basis, Matrix4::identity() * sigma * sigma),
        time_gradient: u,
        speed_error: [0.0; 2],
        sensor: Matrix4::zeros(),
    }
}

/// Round trip: drift and lattice come back exactly for all eight combinations of slow axis, slow
/// and fast direction, each paired with its opposite slow direction, on a sheared frame.
#[test]
fn drift_round_trip_for_all_directions() {
    let drift = Vector2::new(12.0, -7.0) * NM_PER_MIN; // twenty times the usual
    for slow in [Axis::X, Axis::Y] {
        for trace in [true, false] {
            for first in [true, false] {
                let scans: Vec<Observation> = [first, !first]
                    .map(|up| gradient(slow, 0.03, 8.0, up, trace))
                    .map(|u| observation(observed(&lattice(), &u, &drift), u, 0.01))
                    .to_vec();
                let solution = solve(&scans).unwrap();
                assert!(
                    (solution.velocity - drift).norm() < 1e-9,
                    "{slow:?} {trace} {first}"
                );
                assert!((solution.lattice.basis - lattice()).norm() < 1e-7);
                assert!(solution.chi2 < 1e-9 && solution.rank == 6);
                let corrected = scans[0].corrected(&drift, &Matrix2::zeros());
                assert!((corrected.basis - lattice()).norm() < 1e-9);
            }
        }
    }
}

/// The reference matrices of the specification (section 8): slow x, 8 Hz, D = (0.48, −0.14) nm/min,
/// exact; the published ones differ by the missing element `D_slow/V_fast` ≈ 9·10⁻⁶ and nothing else.
#[test]
fn exact_and_published_matrices() {
    let drift = Vector2::new(0.48, -0.14) * NM_PER_MIN;
    let (lx, ly, f, n) = (54.7, 56.8, 8.0, 512.0);
    let (vf, vs) = (2.0 * ly * f, lx * f / n);
    for (sign, expected) in [
        (
            1.0,
            [
                [1.009_448_561_91, 8.885_97e-6],
                [-0.002_755_830_56, 0.999_997_408_26],
            ],
        ),
        (
            -1.0,
            [
                [0.990_726_677_21, 8.721_16e-6],
                [0.002_704_719_15, 0.999_997_456_33],
            ],
        ),
    ] {
        let u = Vector2::new(sign / vs, 1.0 / vf);
        let exact = observed(&Matrix2::identity(), &u, &drift);
        let scan = PaperScan {
            slow_axis: Axis::X,
            ..paper_scan(&lattice(), &Vector2::new(1.0 / vf, sign / vs), 0.0)
        };
        let published = matrix(&scan, &drift);
        for (i, row) in expected.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                // The specification prints eleven decimals.
                assert!((exact[(i, j)] - value).abs() < 2e-11, "{exact}");
                let missing = if (i, j) == (0, 1) { *value } else { 0.0 };
                assert!(
                    (published[(i, j)] + missing - value).abs() < 1e-7,
                    "{published}"
                );
            }
        }
    }
}

/// Up/down mean of the reciprocal matrices is free of constant drift where u is exactly opposite.
#[test]
fn forward_backward_identity() {
    let drift = Vector2::new(0.48, -0.14) * NM_PER_MIN;
    let reciprocal = |m: &Matrix2<f64>| m.try_inverse().unwrap().transpose();
    let up = gradient(Axis::Y, 0.02, 8.0, true, true);
    let mean = |down: Vector2<f64>| {
        let up = reciprocal(&observed(&lattice(), &up, &drift));
        let down = reciprocal(&observed(&lattice(), &down, &drift));
        ((up + down) / 2.0 - reciprocal(&lattice())).norm() / reciprocal(&lattice()).norm()
    };
    assert!(mean(-up) < 1e-14);
    // The fast motion does not turn round: what remains is D/V_fast, 10⁻⁵.
    let real = mean(gradient(Axis::Y, 0.02, 8.0, false, true));
    assert!(real > 1e-8 && real < 2e-5, "{real}");
}

/// The table of `σ_D` of the specification (section 2): λ = 12.5 nm, 512 lines of 55 nm, σ = 1.5/√3 px.
/// The table's three peaks per scan are independent; two basis vectors with R₃ built in say the same.
#[test]
fn drift_error_follows_the_table() {
    let sigma = 1.5 / 3.0f64.sqrt() * 55.0 / 511.0;
    // Least squares over three independent peaks with a closure: cov = σ²/3 (2 I, I; I, 2 I).
    let mut covariance = Matrix4::identity() * 2.0 / 3.0;
    for i in 0..2 {
        covariance[(i, 2 + i)] = 1.0 / 3.0;
        covariance[(2 + i, i)] = 1.0 / 3.0;
    }
    let scan = |slow, rate, up| {
        let u = gradient(slow, 0.0, rate, up, true);
        Observation {
            lattice: Lattice::new(lattice(), covariance * sigma * sigma),
            time_gradient: u,
            speed_error: [0.0; 2],
            sensor: Matrix4::zeros(),
        }
    };
    let sigma_of = |scans: &[Observation]| {
        let s = solve(scans).unwrap();
        (s.covariance.trace() / 2.0).sqrt() / NM_PER_MIN
    };
    let alternating = |n: usize, rate| -> Vec<Observation> {
        (0..n).map(|i| scan(Axis::Y, rate, i % 2 == 0)).collect()
    };
    let xy = [Axis::X, Axis::X, Axis::Y, Axis::Y];
    let four: Vec<_> = xy
        .iter()
        .enumerate()
        .map(|(i, a)| scan(*a, 8.0, i % 2 == 0))
        .collect();
    for (scans, expected) in [
        (alternating(2, 8.0), 0.22),
        (
            vec![scan(Axis::Y, 8.0, true), scan(Axis::Y, 4.0, true)],
            0.45,
        ),
        (
            vec![scan(Axis::X, 8.0, true), scan(Axis::Y, 8.0, true)],
            0.32,
        ),
        (four, 0.16),
        (alternating(10, 8.0), 0.100),
        (alternating(6, 4.0), 0.064),
    ] {
        let found = sigma_of(&scans);
        // The table has two digits; its frame is 54.7 × 56.8 nm here, which is 2 % of 55 nm.
        assert!(
            (found / expected - 1.0).abs() < 0.05,
            "{found} for {expected}"
        );
    }
}

/// One direction only, or trace and retrace of one scan, do not determine the drift.
#[test]
fn undetermined_drift_is_refused() {
    let scan = |up, trace| observation(lattice(), gradient(Axis::Y, 0.0, 8.0, up, trace), 0.1);
    for scans in [
        vec![scan(true, true)],
        vec![scan(true, true); 10],
        vec![scan(true, true), scan(true, false)],
    ] {
        assert!(matches!(
            solve(&scans),
            Err(DriftError::Undetermined { .. })
        ));
    }
}

/// Scans with noise: the error of the drift is that stated, in the linear solution and in the Monte
/// Carlo distribution, which has its mean at the solution; the published estimate agrees with ours
/// where the errors are equal.
#[test]
fn errors_monte_carlo_and_the_published_estimate() {
    let drift = Vector2::new(0.5, -0.15) * NM_PER_MIN;
    let sigma = 0.05;
    let (mut pulls, trials) = (0.0, 400);
    for trial in 0..trials {
        let mut rng = stream(3, "test", trial);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let scans: Vec<Observation> = (0..10)
            .map(|i| {
                let u = gradient(Axis::Y, 0.0, 8.0, i % 2 == 0, true);
                let noise = Matrix2::from_fn(|_, _| sigma * normal());
                observation(observed(&lattice(), &u, &drift) + noise, u, sigma)
            })
            .collect();
        let solution = solve(&scans).unwrap();
        let miss = solution.velocity - drift;
        pulls += (miss.transpose() * solution.covariance.try_inverse().unwrap() * miss)[0] / 2.0;
        if trial > 0 {
            continue;
        }
        let mc = monte_carlo(&scans, 4000, 1, "drift").unwrap();
        let ratio = mc.covariance.trace() / solution.covariance.trace();
        // 4000 draws: the variance is known to 2 %.
        assert!((ratio - 1.0).abs() < 0.08, "{ratio}");
        assert!((mc.mean - solution.velocity).norm() < 0.1 * solution.covariance.trace().sqrt());
        let paper: Vec<PaperScan> = scans
            .iter()
            .map(|s| paper_scan(&s.lattice.basis, &s.time_gradient, sigma))
            .collect();
        let published = successive_drift(&paper).unwrap();
        // Same data, but neighbours compared instead of all with their mean: within a σ.
        assert!((published - solution.velocity).norm() < solution.covariance.trace().sqrt());
    }
    // Mean square pull over 400 trials of two components: 1 ± 0.05.
    let mean = pulls / trials as f64;
    assert!((mean - 1.0).abs() < 0.2, "{mean}");
}

/// A scan with the slow axis along y, its peaks uncertain by `sigma` (nm) along x and y.
fn paper_scan(basis: &Matrix2<f64>, gradient: &Vector2<f64>, sigma: f64) -> PaperScan {
    PaperScan {
        peaks: PaperScan::six(basis),
        peak_covariance: Matrix2::identity() * sigma * sigma,
        slow_axis: Axis::Y,
        fast_velocity: 1.0 / gradient.x,
        slow_velocity: 1.0 / gradient.y,
        velocity_sigmas: [0.0; 2],
        line: LineDirection::Trace,
    }
}

/// Scans up and down in turn, each peak off by noise of its own.
fn noisy_scans(count: u64, sigma: f64, drift: &Vector2<f64>) -> Vec<PaperScan> {
    let scans = (0..count).map(|i| {
        let u = gradient(Axis::Y, 0.0, 8.0, i % 2 == 0, true);
        let exact = paper_scan(&observed(&lattice(), &u, drift), &u, sigma);
        exact.drawn(&mut stream(17, "peaks", i))
    });
    scans.collect()
}

/// The published objective is the sum over neighbours, and its minimum is where no step leads further down.
#[test]
fn successive_scans_are_compared() {
    let drift = Vector2::new(0.5, -0.15) * NM_PER_MIN;
    let scans = noisy_scans(7, 0.05, &drift);
    let by_definition = |d: &Vector2<f64>| {
        let (mut sum, mut count) = (0.0, 0.0);
        for pair in scans.windows(2) {
            for k in 0..6 {
                let [a, b] =
                    [&pair[0], &pair[1]].map(|s| matrix(s, d).try_inverse().unwrap() * s.peaks[k]);
                sum += (a - b).norm_squared();
                count += 1.0;
            }
        }
        sum / count
    };
    let found = successive_drift(&scans).unwrap();
    let least = by_definition(&found);
    assert!((successive_objective(&scans, &found) - least).abs() < 1e-15);
    for angle in 0..12 {
        let (sin, cos) = (f64::from(angle) * std::f64::consts::FRAC_PI_6).sin_cos();
        let step = Vector2::new(cos, sin) * 1e-4 * NM_PER_MIN;
        assert!(by_definition(&(found + step)) > least);
    }
    // Without noise it is the drift, but for the matrices' error of 10⁻⁵ or so.
    let exact = successive_drift(&noisy_scans(7, 0.0, &drift)).unwrap();
    assert!((exact - drift).norm() < 1e-4 * drift.norm(), "{exact}");
    // Trace is compared with trace and retrace with retrace: the same retraces in between change nothing.
    let mut mixed = Vec::new();
    for scan in &scans {
        mixed.push(*scan);
        mixed.push(PaperScan {
            line: LineDirection::Retrace,
            ..*scan
        });
    }
    assert!((successive_drift(&mixed).unwrap() - found).norm() < 1e-9 * found.norm());
}

/// The spread of the draws is what the errors of peaks and velocities make of the minimum, by numerical derivatives.
#[test]
fn published_draws_scatter_as_their_inputs() {
    let drift = Vector2::new(0.5, -0.15) * NM_PER_MIN;
    let mut scans = noisy_scans(6, 0.02, &drift);
    for scan in &mut scans {
        scan.velocity_sigmas = [
            0.05 * scan.fast_velocity.abs(),
            0.05 * scan.slow_velocity.abs(),
        ];
    }
    let minimum = successive_drift(&scans).unwrap();
    let mut expected = Matrix2::zeros();
    let mut add = |moved: &[PaperScan], step: f64, sigma: f64| {
        let by = (successive_drift(moved).unwrap() - minimum) / step * sigma;
        expected += by * by.transpose();
    };
    for i in 0..scans.len() {
        for (k, axis) in (0..6).flat_map(|k| [(k, 0), (k, 1)]) {
            let mut moved = scans.clone();
            moved[i].peaks[k][axis] += 1e-4;
            add(&moved, 1e-4, 0.02);
        }
        let mut moved = scans.clone();
        moved[i].slow_velocity *= 1.0 + 1e-4;
        add(
            &moved,
            1e-4 * scans[i].slow_velocity,
            0.05 * scans[i].slow_velocity,
        );
    }
    let draws = successive_draws(&scans, 4000, 1, "drift").unwrap();
    for i in 0..2 {
        let ratio = draws.covariance[(i, i)] / expected[(i, i)];
        // 4000 draws know a variance to 2.2 %; second order in 5 % of velocity adds less than a per cent.
        assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
    }
    assert!((draws.mean - minimum).norm() < 0.1 * draws.covariance.trace().sqrt());
    assert!(successive_draws(&scans, 0, 1, "drift").is_none());
}
