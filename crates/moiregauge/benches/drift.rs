//! Drift from ten scans, trace and retrace: the least-squares solution and its Monte Carlo; the joint fit of 10 to 640 scans
//! with everything left out once, as scans per second: 640 take 64 times as long as 10 where all is linear.
//!
//! `cargo bench -p moiregauge --bench drift`. The published way needs 10,000 minimisations.

use std::f64::consts::TAU;

use divan::{Bencher, counter::ItemsCount};
use heterostrain::lattice::{Lattice, Waves};
use moiregauge::drift::monte_carlo;
use moiregauge::drift::{Detection, Observation, fit, solve};
use moiregauge::spectrum::Phases;
use nalgebra::{Matrix2, Matrix4, Vector2};

fn main() {
    divan::main();
}

/// Twenty lattices at 12.5 nm, slow axis y, alternately up and down, trace and retrace, with errors of
/// a few picometres that follow no pattern.
fn observations() -> Vec<Observation> {
    let drift = Vector2::new(0.5, -0.15) / 60.0;
    let basis = Matrix2::new(12.4, 4.9, 1.6, 11.5);
    (0..20)
        .map(|i| {
            let slow = if i % 4 < 2 { 0.887 } else { -0.887 };
            let fast = if i % 2 == 0 { 918.0 } else { -918.0 };
            let time_gradient = Vector2::new(1.0 / fast, 1.0 / slow);
            let map = Matrix2::identity() - drift * time_gradient.transpose();
            let error = |k: i32| 0.005 * f64::from((i * 7 + k * 5) % 11 - 5) / 5.0;
            let errors = Matrix2::new(error(0), error(1), error(2), error(3));
            Observation {
                lattice: Lattice::new(
                    map.try_inverse().expect("a slow drift") * basis + errors,
                    Matrix4::identity() * 0.005_f64.powi(2),
                ),
                time_gradient,
                speed_error: [1e-4, 1e-4],
                sensor: Matrix4::zeros(),
            }
        })
        .collect()
}

#[divan::bench]
fn solution(bencher: Bencher<'_, '_>) {
    let observations = observations();
    bencher.bench(|| solve(divan::black_box(&observations)).expect("up and down"));
}

#[divan::bench(sample_count = 20, sample_size = 1)]
fn ten_thousand_draws(bencher: Bencher<'_, '_>) {
    let observations = observations();
    bencher.bench(|| monte_carlo(divan::black_box(&observations), 10_000, 1, "bench"));
}

/// Frames of a minute at 12.5 nm, alternately up and down, trace and retrace, drifting by 0.5 nm/min, with errors that
/// follow no pattern.
fn sightings(scans: usize) -> Vec<Detection> {
    let drift = Vector2::new(0.5, -0.15) / 60.0;
    let pair = Matrix2::new(0.58, 0.24, 0.05, 0.54);
    let harmonics = [
        pair.column(0).into_owned(),
        pair.column(1).into_owned(),
        pair.column(1) - pair.column(0),
    ];
    (0..2 * scans)
        .map(|i| {
            let (scan, class) = (i / 2, i % 2);
            let error = |k: usize| ((i * 7 + k * 5) % 11) as f64 / 5.0 - 1.0;
            let time = 65.0 * scan as f64;
            let slow = if scan % 2 == 0 { 0.887 } else { -0.887 };
            let fast = if class == 0 { 918.0 } else { -918.0 };
            let u = Vector2::new(1.0 / fast, 1.0 / slow);
            let place = Vector2::new(3.0, -1.0) - drift * time;
            let phase = |h: usize| {
                let plain = harmonics[h].dot(&place) + 0.003 * error(h + 4);
                plain - TAU * (plain / TAU).round()
            };
            let noise = Matrix2::new(error(0), error(1), error(2), error(3)) * 1e-4;
            Detection {
                scan,
                class,
                block: 0,
                waves: Waves::new(
                    (Matrix2::identity() - u * drift.transpose()) * pair + noise,
                    Matrix4::identity() * 1e-8,
                ),
                sensor: Matrix4::zeros(),
                time_gradient: u,
                fast_gain: Matrix2::new(1.0, 0.0, 0.0, 0.0),
                time,
                position: Vector2::new(3.0, -1.0),
                phases: Some(Phases::independent([0, 1, 2].map(phase), [9e-6; 3])),
            }
        })
        .collect()
}

#[divan::bench(args = [10, 40, 160, 640], sample_count = 5, sample_size = 1)]
fn joint_fit(bencher: Bencher<'_, '_>, scans: usize) {
    let (sightings, pair) = (sightings(scans), Matrix2::new(0.58, 0.24, 0.05, 0.54));
    let drift = Vector2::new(0.5, -0.15) / 60.0;
    bencher.counter(ItemsCount::new(scans)).bench(|| {
        let fit = fit(divan::black_box(&sightings), &pair, &drift, 0.6).expect("up and down");
        assert!(fit.terms.phases);
        fit.leave_one_out()
    });
}
