//! Lattice vectors from the three first harmonics of the Hann-windowed Fourier transform.
//!
//! Each wave vector is the maximum of the transform, found to far below a grid step. Its variance
//! along one axis is `S Σw²x² / (2|c|² (Σwx²)²)` for noise power S, amplitude 2|c| and window w (the
//! Cramér–Rao bound for one cosine where w = 1). The three are fitted with `K₃ = K₂ − K₁` and turned
//! into real-space vectors by the full 2×2 inverse.

use heterostrain::lattice::{Lattice, Px, Waves};
use nalgebra::{Matrix2, Vector2};

use crate::spectrum::hann::hann;
use crate::spectrum::harmonics::{Harmonic, Harmonics};

/// Fits the lattice to the first three wave vectors. `size` is (columns, rows).
pub(crate) fn measure(
    harmonics: &Harmonics,
    peaks: &[Vector2<f64>; 3],
    size: [usize; 2],
) -> Option<Lattice<Px>> {
    reciprocal_lattice(harmonics, peaks, size)?.lattice()
}

/// The published shortcut `λ = 4π/(√3 |K|)`, right only for undistorted hexagons, for comparison;
/// in the order of the wave vectors, unit as `pixel_to_nm`.
pub(crate) fn shortcut_wavelengths(
    peaks: &[Vector2<f64>; 3],
    pixel_to_nm: &Matrix2<f64>,
) -> Option<[f64; 3]> {
    let map = pixel_to_nm.try_inverse()?.transpose();
    let length = |q: &Vector2<f64>| 4.0 * std::f64::consts::PI / (3.0f64.sqrt() * (map * q).norm());
    Some([length(&peaks[0]), length(&peaks[1]), length(&peaks[2])])
}

/// Weighted least squares of `(K₁, K₂)` with `K₃ = K₂ − K₁`, rad per pixel.
fn reciprocal_lattice(
    harmonics: &Harmonics,
    peaks: &[Vector2<f64>; 3],
    size: [usize; 2],
) -> Option<Waves<Px>> {
    let moments = size.map(|n| {
        let w = hann(n);
        let c = (n as f64 - 1.0) / 2.0;
        let sum = |f: &dyn Fn(f64, f64) -> f64| {
            w.iter()
                .enumerate()
                .map(|(i, w)| f(*w, i as f64 - c))
                .sum::<f64>()
        };
        [
            sum(&|w, _| w),
            sum(&|w, x| w * x * x),
            sum(&|w, _| w * w),
            sum(&|w, x| (w * x).powi(2)),
        ]
    });
    // Per axis: Σ w² x² and Σ w x² over the frame are products of one-dimensional sums.
    let variance = |h: &Harmonic, axis: usize| {
        let other = 1 - axis;
        let (m, o) = (moments[axis], moments[other]);
        h.noise[axis] * m[3] * o[2] / (2.0 * h.amplitude.norm_sqr() * (m[1] * o[0]).powi(2))
    };
    let rows = [[1.0, 0.0], [0.0, 1.0], [-1.0, 1.0]];
    let mut k = Waves::exact(Matrix2::zeros());
    for axis in 0..2 {
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for ((harmonic, peak), row) in harmonics.list.iter().zip(peaks).zip(rows) {
            let row = Vector2::from(row);
            let weight = 1.0 / variance(harmonic, axis);
            normal += weight * row * row.transpose();
            right += weight * peak[axis] * row;
        }
        let inverse = normal.try_inverse()?;
        let solution = inverse * right;
        for i in 0..2 {
            k.basis[(axis, i)] = solution[i];
            for j in 0..2 {
                k.covariance[(2 * i + axis, 2 * j + axis)] = inverse[(i, j)];
            }
        }
    }
    Some(k)
}
