//! One wave and its overtones fitted to the pixels of a pattern: the whole-image fit of stripes.
//!
//! `I(n) = Σ_k a_k cos kφ + b_k sin kφ + plane`, `φ = q·(n − n₀)`, least squares by Gauss–Newton over the pixels that
//! show the pattern. Noise is what the fit leaves near each harmonic, so that stripes that bend have larger errors:
//! `cov(q)⁻¹ = Σ_k k² (a_k² + b_k²)/(2 S_k) · Σ (n − n̄)(n − n̄)ᵀ`.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::frame::image::Image;
use crate::spectrum::noise::LocalNoise;
use crate::spectrum::transform::hann;

/// A wave that moves by more than this share of itself is another one. Chosen by eye.
const ANOTHER: f64 = 0.3;
/// Gauss–Newton steps at most. Chosen by eye.
const STEPS: usize = 20;
/// The wave vector stands when it moves by less than this, in cycles over the frame: far below any error.
const STANDS: f64 = 1e-6;
/// Pixels whose sums are made together: enough for a thread.
const TOGETHER: usize = 1 << 14;
/// Pixels that have to show the pattern: eight by eight.
const FEWEST: usize = 64;

/// A wave fitted to pixels.
#[derive(Clone, Debug)]
pub struct FittedWave {
    /// Wave vector, rad per pixel.
    pub wave: Vector2<f64>,
    /// Its covariance by the noise that the fit leaves.
    pub covariance: Matrix2<f64>,
    /// Amplitudes of the harmonics that were fitted, as (n, amplitude).
    pub amplitudes: Vec<(i32, f64)>,
    /// Noise that the fit leaves at each of them: variance per pixel of white noise as strong.
    pub noise: Vec<f64>,
}

/// Fits harmonics `orders` near `start` (rad per pixel) to the pixels for which `shows` holds.
///
/// `None` where there are too few, or the fit runs away.
pub(crate) fn fit(
    image: &Image,
    start: Vector2<f64>,
    orders: &[i32],
    shows: &[bool],
) -> Option<FittedWave> {
    let used: Vec<usize> = (0..image.values.len())
        .filter(|&i| shows[i] && image.values[i].is_finite())
        .collect();
    if used.len() < FEWEST.max(8 * orders.len()) {
        return None;
    }
    let place = |i: usize| Vector2::new((i % image.columns) as f64, (i / image.columns) as f64);
    let count = used.len() as f64;
    let middle = used.iter().map(|&i| place(i)).sum::<Vector2<f64>>() / count;
    let reach = image.columns.max(image.rows) as f64;
    let size = 3 + 2 * orders.len();
    let mut wave = start;
    let mut linear = DVector::<f64>::zeros(size);
    let mut settled = false;
    for step in 0..STEPS {
        // The first step finds the amplitudes alone.
        let all = if step == 0 { size } else { size + 2 };
        let sums: Vec<(DMatrix<f64>, DVector<f64>)> = used
            .par_chunks(TOGETHER)
            .map(|some| {
                let mut normal = DMatrix::<f64>::zeros(all, all);
                let mut right = DVector::<f64>::zeros(all);
                let mut row = vec![0.0; size + 2];
                for &i in some {
                    let d = place(i) - middle;
                    terms(&mut row, d, (&wave, orders), &linear, reach);
                    let model: f64 = (0..size).map(|k| row[k] * linear[k]).sum();
                    let miss = image.values[i] - model;
                    for a in 0..all {
                        right[a] += row[a] * miss;
                        for b in 0..=a {
                            normal[(a, b)] += row[a] * row[b];
                        }
                    }
                }
                (normal, right)
            })
            .collect();
        let mut normal = DMatrix::<f64>::zeros(all, all);
        let mut right = DVector::<f64>::zeros(all);
        for (n, r) in &sums {
            normal += n;
            right += r;
        }
        normal.fill_upper_triangle_with_lower_triangle();
        let change = normal.cholesky()?.solve(&right);
        linear += change.rows(0, size);
        if step > 0 {
            let moved = Vector2::new(change[size], change[size + 1]) / reach;
            wave += moved;
            let cycles = (moved * reach).norm() / std::f64::consts::TAU;
            settled = cycles < STANDS;
            if settled || !cycles.is_finite() {
                break;
            }
        }
    }
    // Not the wave that was looked for.
    if !settled || (wave - start).norm() > ANOTHER * start.norm() {
        return None;
    }
    let mut left = Image::new(
        image.rows,
        image.columns,
        vec![0.0; image.rows * image.columns],
    );
    let (mut spread, mut row) = (Matrix2::zeros(), vec![0.0; size + 2]);
    let windows = [hann(image.columns), hann(image.rows)];
    let weight = |i: usize| (windows[0][i % image.columns] * windows[1][i / image.columns]).powi(2);
    for &i in &used {
        let d = place(i) - middle;
        terms(&mut row, d, (&wave, orders), &linear, reach);
        left.values[i] = image.values[i] - (0..size).map(|k| row[k] * linear[k]).sum::<f64>();
        spread += d * d.transpose();
    }
    // The window of the spectrum weighs the pixels in use and the zeros of the others.
    let share = used.iter().map(|&i| weight(i)).sum::<f64>()
        / (0..image.values.len()).map(weight).sum::<f64>();
    let local = LocalNoise::new(&left);
    let (mut normal, mut amplitudes, mut noise) = (Matrix2::zeros(), Vec::new(), Vec::new());
    for (k, &n) in orders.iter().enumerate() {
        let (a, b) = (linear[3 + 2 * k], linear[4 + 2 * k]);
        let [x, y] = local.around(wave * f64::from(n));
        let level = x.max(y) / share.max(f64::MIN_POSITIVE);
        amplitudes.push((n, a.hypot(b)));
        noise.push(level);
        normal += spread * (f64::from(n * n) * (a * a + b * b) / (2.0 * level));
    }
    Some(FittedWave {
        wave,
        covariance: normal.try_inverse()?,
        amplitudes,
        noise,
    })
}

/// Plane, cosines and sines, and what they change with the wave vector (per rad over `reach`).
fn terms(
    row: &mut [f64],
    d: Vector2<f64>,
    (wave, orders): (&Vector2<f64>, &[i32]),
    linear: &DVector<f64>,
    reach: f64,
) {
    let size = 3 + 2 * orders.len();
    [row[0], row[1], row[2]] = [1.0, d.x / reach, d.y / reach];
    let turn = Complex64::cis(wave.dot(&d));
    let mut slope = 0.0;
    for (k, &n) in orders.iter().enumerate() {
        let t = turn.powi(n);
        [row[3 + 2 * k], row[4 + 2 * k]] = [t.re, t.im];
        slope += f64::from(n) * (linear[4 + 2 * k] * t.re - linear[3 + 2 * k] * t.im);
    }
    row[size] = slope * d.x / reach;
    row[size + 1] = slope * d.y / reach;
}
