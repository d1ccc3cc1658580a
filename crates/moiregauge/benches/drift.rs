//! Drift from ten scans, trace and retrace: the least-squares solution and its Monte Carlo.
//!
//! `cargo bench -p moiregauge --bench drift`. The published way needs 10,000 minimisations.

use divan::Bencher;
use heterostrain::lattice::Lattice;
use moiregauge::drift::monte_carlo;
use moiregauge::drift::{Observation, solve};
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
