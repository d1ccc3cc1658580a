//! Ground as a running median: it follows steps, slopes and broad bumps, and not a pattern of which a window holds more than a period.
//!
//! A median keeps an edge where it is, which means and polynomials spread over their whole width. It treats every place alike, so that
//! what is left of a perfect lattice is a lattice with the same waves, but for windows that the frame cuts off.

use rayon::prelude::*;

use crate::frame::image::Image;
use crate::numbers::interrupt;
use crate::numbers::median::median;

/// Bins along a side of the window: an edge is known to a half of one.
const BINS: usize = 24;

/// The median of the pixels that are there in a square of about `side` pixels around each place, NaN where there are none.
///
/// It is taken of means over bins, and a straight line from bin to bin.
pub(crate) fn running_median(image: &Image, side: usize) -> Image {
    let bin = (side / BINS).max(1);
    let reach = (side / bin / 2).max(1);
    let binned = means(image, bin);
    let (columns, rows) = (binned.columns, binned.rows);
    let mut ground = vec![f64::NAN; columns * rows];
    let lines = ground.par_chunks_mut(columns).enumerate();
    lines.for_each(|(row, line)| {
        interrupt::check();
        let near = |at: usize, count: usize| at.saturating_sub(reach)..(at + reach + 1).min(count);
        let mut window = Vec::with_capacity((2 * reach + 1).pow(2));
        for (column, ground) in line.iter_mut().enumerate() {
            window.clear();
            for other in near(row, rows) {
                let part = &binned.row(other)[near(column, columns)];
                window.extend(part.iter().copied().filter(|v| v.is_finite()));
            }
            if !window.is_empty() {
                *ground = median(&mut window);
            }
        }
    });
    spread(&Image::new(rows, columns, ground), bin, image)
}

/// Means over square bins, those at the upper and right ends too, which may have fewer pixels.
fn means(image: &Image, bin: usize) -> Image {
    let (columns, rows) = (image.columns.div_ceil(bin), image.rows.div_ceil(bin));
    let mut sums = vec![[0.0; 2]; columns * rows];
    for (row, line) in image.values.chunks(image.columns).enumerate() {
        let bins = &mut sums[row / bin * columns..];
        for (pixels, [sum, count]) in line.chunks(bin).zip(bins) {
            for value in pixels.iter().filter(|v| v.is_finite()) {
                *sum += value;
                *count += 1.0;
            }
        }
    }
    let means = sums.into_iter().map(|[sum, count]| sum / count);
    Image::new(rows, columns, means.collect())
}

/// Bins at the places of the pixels of `like`, by straight lines between their middles.
fn spread(bins: &Image, bin: usize, like: &Image) -> Image {
    if bin == 1 {
        return bins.clone();
    }
    let between = |pixel: usize, count: usize| {
        let at = (pixel as f64 + 0.5) / bin as f64 - 0.5;
        let at = at.clamp(0.0, (count - 1) as f64);
        let low = (at as usize).min(count.saturating_sub(2));
        (low, (low + 1).min(count - 1), at - low as f64)
    };
    let across: Vec<_> = (0..like.columns)
        .map(|column| between(column, bins.columns))
        .collect();
    let mut values = vec![0.0; like.values.len()];
    let lines = values.par_chunks_mut(like.columns).enumerate();
    lines.for_each(|(row, line)| {
        let (low, high, up) = between(row, bins.rows);
        let (low, high) = (bins.row(low), bins.row(high));
        for (value, (left, right, along)) in line.iter_mut().zip(&across) {
            let [below, above] = [low, high].map(|line| {
                let (a, b) = (line[*left], line[*right]);
                if a.is_finite() && b.is_finite() {
                    a + along * (b - a)
                } else if a.is_finite() {
                    a
                } else {
                    b
                }
            });
            *value = match (below.is_finite(), above.is_finite()) {
                (true, true) => below + up * (above - below),
                (true, false) => below,
                _ => above,
            };
        }
    });
    Image::new(like.rows, like.columns, values)
}
