//! Large images in coarse bins.
//!
//! `b(j) = Σ_n w(n − n_j) I(n) / Σ_n w(n − n_j)` about the middle `n_j` of every `size × size` pixels, where w is a box of
//! `size` pixels three times folded with itself: waves that are too short for the bins are not seen as long ones, as they
//! are in plain means. Beyond the edges, and where pixels are missing, w is 0.

use rayon::prelude::*;

use crate::frame::image::Image;
use crate::numbers::interrupt;
use crate::numbers::widest::widest;

/// Boxes folded with each other.
const BOXES: i32 = 3;

/// What the bins of `size` pixels leave of a wave (rad per pixel, along one axis).
pub(crate) fn response(q: f64, size: usize) -> f64 {
    mean_over(q, size).powi(BOXES)
}

/// Mean of `cos(q x)` over `size` pixels around 0.
pub(crate) fn mean_over(q: f64, size: usize) -> f64 {
    let half = (q / 2.0).sin();
    if half.abs() < 1e-12 {
        1.0
    } else {
        (size as f64 * q / 2.0).sin() / (size as f64 * half)
    }
}

/// The image in bins of `size × size` pixels. Pixels that fill no bin are seen by the last one only.
pub(crate) fn smaller(image: &Image, size: usize) -> Image {
    let (rows, columns) = (image.rows / size, image.columns / size);
    let taps = taps(size);
    let whole = image.values.par_iter().all(|v| v.is_finite());
    let lines = (0..rows).into_par_iter().map(|row| {
        interrupt::check();
        let mut sums = vec![0.0; image.columns];
        let mut weights = vec![0.0; if whole { 0 } else { image.columns }];
        let mut weight = 0.0;
        for (line, tap) in around(row, size, &taps, image.rows) {
            weight += tap;
            add(&mut sums, &mut weights, image.row(line), tap);
        }
        let bin = |column: usize| {
            let (mut sum, mut all) = (0.0, 0.0);
            let mut there = 0.0;
            for (column, tap) in around(column, size, &taps, image.columns) {
                sum += tap * sums[column];
                all += tap;
                if !whole {
                    there += tap * weights[column];
                }
            }
            let there = if whole { all * weight } else { there };
            if 2.0 * there >= all * weight {
                sum / there
            } else {
                f64::NAN
            }
        };
        (0..columns).map(bin).collect::<Vec<f64>>()
    });
    let lines: Vec<Vec<f64>> = lines.collect();
    Image::new(rows, columns, lines.concat())
}

/// Adds a line, and where some pixels of the image are missing, what there is of it.
fn add(sums: &mut [f64], weights: &mut [f64], line: &[f64], tap: f64) {
    widest(
        #[inline(always)]
        || {
            if weights.is_empty() {
                for (sum, value) in sums.iter_mut().zip(line) {
                    *sum += tap * value;
                }
                return;
            }
            for ((sum, weight), value) in sums.iter_mut().zip(weights).zip(line) {
                let there = value.is_finite();
                *sum += if there { tap * value } else { 0.0 };
                *weight += if there { tap } else { 0.0 };
            }
        },
    );
}

/// The pixels that a bin sees along one axis of `count`, with their weights.
fn around(
    bin: usize,
    size: usize,
    taps: &[f64],
    count: usize,
) -> impl Iterator<Item = (usize, f64)> {
    let first = (bin * size) as i64 - (taps.len() as i64 - size as i64) / 2;
    let all = taps
        .iter()
        .enumerate()
        .map(move |(i, tap)| (first + i as i64, *tap));
    all.filter(move |(at, _)| (0..count as i64).contains(at))
        .map(|(at, tap)| (at as usize, tap))
}

/// A box of `size` pixels folded with itself.
fn taps(size: usize) -> Vec<f64> {
    let mut taps = vec![1.0];
    for _ in 0..BOXES {
        let mut wider = vec![0.0; taps.len() + size - 1];
        for (i, tap) in taps.iter().enumerate() {
            wider[i..i + size]
                .iter_mut()
                .for_each(|t| *t += tap / size as f64);
        }
        taps = wider;
    }
    taps
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(q: [f64; 2], rows: usize, columns: usize) -> Image {
        let at = |i: usize| (q[0] * (i % columns) as f64 + q[1] * (i / columns) as f64).cos();
        Image::new(rows, columns, (0..rows * columns).map(at).collect())
    }

    /// Away from the edges a wave has its phase, and the amplitude that the response says; constants stay.
    #[test]
    fn waves_keep_their_phase() {
        for size in [2, 3, 4] {
            let q = [0.31, -0.17];
            let small = smaller(&wave(q, 60, 84), size);
            let left = response(q[0], size) * response(q[1], size);
            for (row, column) in [(6, 7), (8, 9), (10, 4)] {
                let at = |i: usize| (i * size) as f64 + (size as f64 - 1.0) / 2.0;
                let wanted = left * (q[0] * at(column) + q[1] * at(row)).cos();
                let found = small.row(row)[column];
                assert!((found - wanted).abs() < 1e-12, "{size}: {found} {wanted}");
            }
        }
        let level = smaller(&Image::new(9, 11, vec![2.5; 99]), 3);
        assert!(level.values.iter().all(|v| (v - 2.5).abs() < 1e-12));
    }

    /// A wave of 4.5 pixels looks like one of 36 in plain means of 4, an eighth as strong; here it is gone.
    #[test]
    fn short_waves_are_no_long_ones() {
        let fast = wave([std::f64::consts::TAU / 4.5, 0.0], 64, 128);
        let most = |image: &Image| {
            let inner = image.row(8)[3..29].iter();
            inner.fold(0.0f64, |most, v| most.max(v.abs()))
        };
        assert!(most(&fast.binned(4)) > 0.1);
        assert!(most(&smaller(&fast, 4)) < 0.003);
    }

    /// Missing pixels weigh nothing, and a bin of which most is missing is missing.
    #[test]
    fn missing_pixels_weigh_nothing() {
        let mut image = Image::new(24, 24, vec![1.5; 576]);
        image.values[5 * 24 + 7] = f64::NAN;
        for row in 12..24 {
            image.values[row * 24..(row + 1) * 24].fill(f64::NAN);
        }
        let small = smaller(&image, 3);
        assert!((small.row(1)[2] - 1.5).abs() < 1e-12);
        assert!(small.row(6)[2].is_nan());
    }
}
