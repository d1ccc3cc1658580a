//! One wave and its overtones fitted to the pixels of a pattern: the whole-image fit of stripes.
//!
//! `I(n) = Σ_k a_k cos kφ + b_k sin kφ + plane`, `φ = q·(n − n₀)`, least squares by Gauss–Newton over the pixels that
//! show the pattern. Noise is what the fit leaves near each harmonic, so that stripes that bend have larger errors:
//! `cov(q)⁻¹ = Σ_k k² (a_k² + b_k²)/(2 S_k) · Σ (n − n̄)(n − n̄)ᵀ`.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::frame::image::Image;
use crate::numbers::{MOST_ROUNDS, interrupt};
use crate::spectrum::hann::hann;
use crate::spectrum::noise::LocalNoise;
use crate::stripes::find::SAME;

/// The wave vector stands when it moves by less than this, in cycles over the frame: far below any error.
const STANDS: f64 = 1e-6;
/// Pixels whose sums are made together: enough for a thread.
const TOGETHER: usize = 1 << 14;
/// Pixels that have to show the pattern: eight by eight.
const FEWEST: usize = 64;

/// A wave fitted to pixels.
#[derive(Clone, Debug)]
#[non_exhaustive]
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
    let sum: Vector2<f64> = used.iter().map(|&i| place(image, i)).sum();
    let middle = sum / used.len() as f64;
    let reach = image.columns.max(image.rows) as f64;
    let pixels = Pixels {
        image,
        orders,
        used,
        middle,
        reach,
    };
    let size = 3 + 2 * orders.len();
    let mut wave = start;
    let mut linear = DVector::<f64>::zeros(size);
    for step in 0..MOST_ROUNDS {
        // The first step finds the amplitudes alone.
        let all = if step == 0 { size } else { size + 2 };
        let change = pixels.step(&wave, &linear, all)?;
        linear += change.rows(0, size);
        if step == 0 {
            continue;
        }
        let moved = Vector2::new(change[size], change[size + 1]) / reach;
        wave += moved;
        let cycles = (moved * reach).norm() / std::f64::consts::TAU;
        if cycles < STANDS {
            // Else it is not the wave that was looked for.
            let near = (wave - start).norm() <= SAME * start.norm();
            return near.then(|| pixels.fitted(wave, &linear)).flatten();
        }
        if !cycles.is_finite() {
            break;
        }
    }
    None
}

fn place(image: &Image, i: usize) -> Vector2<f64> {
    Vector2::new((i % image.columns) as f64, (i / image.columns) as f64)
}

/// The pixels of a fit.
struct Pixels<'a> {
    image: &'a Image,
    orders: &'a [i32],
    used: Vec<usize>,
    middle: Vector2<f64>,
    /// Length of the frame, pixels: changes of the wave vector are per rad over it.
    reach: f64,
}

impl Pixels<'_> {
    /// A step of Gauss–Newton, of the first `all` parameters.
    fn step(&self, wave: &Vector2<f64>, linear: &DVector<f64>, all: usize) -> Option<DVector<f64>> {
        let sums: Vec<(DMatrix<f64>, DVector<f64>)> = self
            .used
            .par_chunks(TOGETHER)
            .map(|some| {
                interrupt::check();
                let mut normal = DMatrix::<f64>::zeros(all, all);
                let mut right = DVector::<f64>::zeros(all);
                let mut row = vec![0.0; linear.len() + 2];
                for &i in some {
                    self.terms(&mut row, i, wave, linear);
                    let miss = self.miss(&row, i, linear);
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
        Some(normal.cholesky()?.solve(&right))
    }

    /// What the terms of a pixel leave of it.
    fn miss(&self, row: &[f64], i: usize, linear: &DVector<f64>) -> f64 {
        let model: f64 = (0..linear.len()).map(|k| row[k] * linear[k]).sum();
        self.image.values[i] - model
    }

    /// Plane, cosines and sines, and what they change with the wave vector (per rad over `reach`).
    fn terms(&self, row: &mut [f64], i: usize, wave: &Vector2<f64>, linear: &DVector<f64>) {
        let (d, size) = (place(self.image, i) - self.middle, linear.len());
        [row[0], row[1], row[2]] = [1.0, d.x / self.reach, d.y / self.reach];
        let turn = Complex64::cis(wave.dot(&d));
        let mut slope = 0.0;
        for (k, &n) in self.orders.iter().enumerate() {
            let t = turn.powi(n);
            [row[3 + 2 * k], row[4 + 2 * k]] = [t.re, t.im];
            slope += f64::from(n) * (linear[4 + 2 * k] * t.re - linear[3 + 2 * k] * t.im);
        }
        row[size] = slope * d.x / self.reach;
        row[size + 1] = slope * d.y / self.reach;
    }

    /// The fit, its errors by the noise that it leaves.
    fn fitted(&self, wave: Vector2<f64>, linear: &DVector<f64>) -> Option<FittedWave> {
        let (image, count) = (self.image, self.image.values.len());
        let mut left = Image::new(image.rows, image.columns, vec![0.0; count]);
        let (mut spread, mut row) = (Matrix2::zeros(), vec![0.0; linear.len() + 2]);
        for &i in &self.used {
            let d = place(image, i) - self.middle;
            self.terms(&mut row, i, &wave, linear);
            left.values[i] = self.miss(&row, i, linear);
            spread += d * d.transpose();
        }
        // The window of the spectrum weighs the pixels in use and the zeros of the others.
        let windows = [hann(image.columns), hann(image.rows)];
        let weight =
            |i: usize| (windows[0][i % image.columns] * windows[1][i / image.columns]).powi(2);
        let share =
            self.used.iter().map(|&i| weight(i)).sum::<f64>() / (0..count).map(weight).sum::<f64>();
        let local = LocalNoise::new(&left);
        let (mut normal, mut amplitudes, mut noise) = (Matrix2::zeros(), Vec::new(), Vec::new());
        for (k, &n) in self.orders.iter().enumerate() {
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
}
