//! Two lattices that look like one: their wave vectors lie within the resolution of a window.
//!
//! In: an image and the pair of the lattice that the two make together. Out: both, well enough to start with.
//!
//! Around each of the three first harmonics the two waves that together take most power off the image are looked
//! for on a grid: with `F(q) = Σ I e^{−iq·n}` and `D(p) = Σ e^{ip·n}` (both about the middle), waves at a and b
//! take `fᴴ G⁻¹ f`, `f = (F(a), F(b))`, `G = (N, D(a−b); D(a−b), N)`. Then each wave of one harmonic belongs to
//! that of the next with which `K₃ = K₂ − K₁` closes.

use nalgebra::{Matrix2, Vector2};
use rustfft::num_complex::Complex64;

use crate::frame::image::Image;
use crate::spectrum::select::TOLERANCE;

/// Step of the grid, cycles per frame: a small part of a main lobe, ...
const STEP: f64 = 0.25;
/// ... and its reach in steps: 2.5 cycles, a main lobe and a half.
const REACH: i32 = 10;

/// A lattice to start with: its reciprocal pair (rad per pixel) and its three first waves.
pub(crate) struct Guess {
    pub(crate) pair: Matrix2<f64>,
    pub(crate) waves: [Wave; 3],
}

/// One wave: q (rad per pixel) and amplitude, `2 Re c e^{iq·n}` about the middle.
#[derive(Clone, Copy)]
pub(crate) struct Wave {
    pub(crate) q: Vector2<f64>,
    pub(crate) amplitude: Complex64,
}

/// The two lattices near `pair`; `None` where only one is seen.
pub(crate) fn split(image: &Image, pair: &Matrix2<f64>) -> Option<[Guess; 2]> {
    let (k1, k2) = (pair.column(0).into_owned(), pair.column(1).into_owned());
    let waves = [k1, k2, k2 - k1].map(|q| two_waves(image, q));
    let [Some(first), Some(second), Some(third)] = waves else {
        return None;
    };
    // Which of the second and of the third belongs to the first of the first.
    let closure = |s: usize, t: usize| {
        let one = second[s].q - first[0].q - third[t].q;
        let other = second[1 - s].q - first[1].q - third[1 - t].q;
        one.norm() + other.norm()
    };
    let (s, t) = [(0, 0), (0, 1), (1, 0), (1, 1)]
        .into_iter()
        .min_by(|a, b| closure(a.0, a.1).total_cmp(&closure(b.0, b.1)))?;
    let guess = |waves: [Wave; 3]| {
        let [a, b, c] = waves.map(|w| w.q);
        Guess {
            pair: Matrix2::from_columns(&[(2.0 * a + b - c) / 3.0, (a + 2.0 * b + c) / 3.0]),
            waves,
        }
    };
    Some([
        guess([first[0], second[s], third[t]]),
        guess([first[1], second[1 - s], third[1 - t]]),
    ])
}

/// The two waves near `q` that take most power off the image.
fn two_waves(image: &Image, q: Vector2<f64>) -> Option<[Wave; 2]> {
    let size = Vector2::new(image.columns as f64, image.rows as f64);
    let step = size.map(|n| STEP * std::f64::consts::TAU / n);
    let places: Vec<Vector2<f64>> = (-REACH..=REACH)
        .flat_map(|y| (-REACH..=REACH).map(move |x| Vector2::new(f64::from(x), f64::from(y))))
        .collect();
    let transforms: Vec<Complex64> = transforms(image, q, &step);
    let n = size.x * size.y;
    let mut best: (f64, Option<[Wave; 2]>) = (0.0, None);
    for (i, a) in places.iter().enumerate() {
        for (j, b) in places.iter().enumerate().skip(i + 1) {
            let apart = (a - b) * STEP;
            if apart.norm() < TOLERANCE {
                continue;
            }
            let d = sinc(apart.x) * sinc(apart.y);
            let (fa, fb) = (transforms[i] / n, transforms[j] / n);
            let left = 1.0 - d * d;
            let [ca, cb] = [(fa - fb * d) / left, (fb - fa * d) / left];
            let power = (ca.conj() * fa + cb.conj() * fb).re;
            if power > best.0 {
                let wave = |at: &Vector2<f64>, amplitude| Wave {
                    q: q + at.component_mul(&step),
                    amplitude,
                };
                best = (power, Some([wave(a, ca), wave(b, cb)]));
            }
        }
    }
    best.1
}

/// `Σ I e^{−iq·n}` on the grid about `q`, row by row; missing pixels count as 0.
fn transforms(image: &Image, q: Vector2<f64>, step: &Vector2<f64>) -> Vec<Complex64> {
    let (columns, rows) = (image.columns, image.rows);
    let centre = Vector2::new(columns as f64 - 1.0, rows as f64 - 1.0) / 2.0;
    let grid = || -REACH..=REACH;
    // Along the lines first: a few numbers for each line.
    let turns: Vec<Vec<Complex64>> = grid()
        .map(|x| {
            let q = q.x + f64::from(x) * step.x;
            (0..columns)
                .map(|c| Complex64::cis(-q * (c as f64 - centre.x)))
                .collect()
        })
        .collect();
    let mean = image.values.iter().filter(|v| v.is_finite()).sum::<f64>()
        / image.values.iter().filter(|v| v.is_finite()).count().max(1) as f64;
    let side = turns.len();
    let mut sums = vec![Complex64::default(); side * side];
    for row in 0..rows {
        let line = image.row(row);
        let along: Vec<Complex64> = turns
            .iter()
            .map(|turns| {
                let seen = line.iter().zip(turns).filter(|(v, _)| v.is_finite());
                seen.map(|(v, turn)| turn * (v - mean)).sum()
            })
            .collect();
        for (y, sums) in grid().zip(sums.chunks_exact_mut(side)) {
            let q = q.y + f64::from(y) * step.y;
            let turn = Complex64::cis(-q * (row as f64 - centre.y));
            for (sum, along) in sums.iter_mut().zip(&along) {
                *sum += along * turn;
            }
        }
    }
    sums
}

/// `sin πx / πx`.
fn sinc(x: f64) -> f64 {
    let angle = std::f64::consts::PI * x;
    if angle.abs() < 1e-9 {
        1.0
    } else {
        angle.sin() / angle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two waves 1.3 cycles per frame apart are found to within the grid.
    #[test]
    fn two_waves_are_told_apart() {
        let tau = std::f64::consts::TAU;
        let n = 96;
        let (a, b) = (
            Vector2::new(9.0, 5.0) * tau / n as f64,
            Vector2::new(10.2, 5.5) * tau / n as f64,
        );
        let values = (0..n * n).map(|i| {
            let at = Vector2::new((i % n) as f64, (i / n) as f64);
            (a.dot(&at) + 0.4).cos() + 0.7 * (b.dot(&at) - 1.3).cos()
        });
        let image = Image::new(n, n, values.collect());
        let middle = (a + b) / 2.0;
        let found = two_waves(&image, middle).unwrap();
        for wanted in [a, b] {
            let miss = found.map(|w| (w.q - wanted).norm() * n as f64 / tau);
            assert!(miss[0].min(miss[1]) < 0.3, "{miss:?}");
        }
    }
}
