//! Ground as a running median: it follows steps, slopes and broad bumps, and not a pattern of which a window holds more than a period.
//!
//! A median keeps an edge where it is, which means and polynomials spread over their whole width. It treats every place alike, so that
//! what is left of a perfect lattice is a lattice with the same waves, but for windows that the frame cuts off.

use std::ops::Range;

use rayon::prelude::*;

use crate::frame::image::Image;
use crate::numbers::interrupt;
use crate::numbers::moving_median::MovingMedian;

/// Bins along a side of the window: an edge is known to half of one.
const BINS: usize = 16;

/// The rank of a value that is missing.
const MISSING: u32 = u32::MAX;

/// Pixels along a side of the bins of which the median under a window of `side` pixels is taken.
pub(crate) fn bin_of(side: usize) -> usize {
    (side / BINS).max(1)
}

/// The median of the pixels that are there in a square of about `side` pixels around each place, NaN where there are none.
///
/// It is taken of means over bins, and a straight line from bin to bin.
pub(crate) fn running_median(image: &Image, side: usize) -> Image {
    let bin = bin_of(side);
    let reach = (side / bin / 2).max(1);
    let binned = means(image, bin);
    let (columns, rows) = (binned.columns, binned.rows);
    let mut ground = vec![f64::NAN; columns * rows];
    // Values are sorted once for this number of lines and those that their windows reach.
    let together = 2 * reach;
    let bands = ground.par_chunks_mut(columns * together).enumerate();
    bands.for_each(|(band, ground)| {
        interrupt::check();
        let lines = band * together..band * together + ground.len() / columns;
        medians(&binned, reach, lines, ground);
    });
    spread(&Image::new(rows, columns, ground), bin, image)
}

/// The medians at some lines, in a square that reaches so far to each side.
fn medians(image: &Image, reach: usize, lines: Range<usize>, ground: &mut [f64]) {
    let (columns, rows) = (image.columns, image.rows);
    let near = |line: usize| line.saturating_sub(reach)..(line + reach + 1).min(rows);
    let first = near(lines.start).start;
    let last = near(lines.end - 1).end;
    let (order, ranks) = ranked(&image.values[first * columns..last * columns]);
    for (line, ground) in lines.zip(ground.chunks_mut(columns)) {
        let mut window = MovingMedian::new(order.len());
        let ranks = &ranks;
        let there = |column: usize| {
            let places = near(line).map(move |line| (line - first) * columns + column);
            places.map(|i| ranks[i]).filter(|rank| *rank != MISSING)
        };
        for column in 0..reach.min(columns) {
            there(column).for_each(|rank| window.add(rank));
        }
        for (column, ground) in ground.iter_mut().enumerate() {
            if column + reach < columns {
                there(column + reach).for_each(|rank| window.add(rank));
            }
            if let Some(gone) = column.checked_sub(reach + 1) {
                there(gone).for_each(|rank| window.remove(rank));
            }
            if let Some(middle) = window.median() {
                *ground = order[middle];
            }
        }
    }
}

/// The values that are there in order, and the place of each value in it, or [`MISSING`].
fn ranked(values: &[f64]) -> (Vec<f64>, Vec<u32>) {
    let mut places: Vec<usize> = (0..values.len())
        .filter(|i| values[*i].is_finite())
        .collect();
    places.sort_unstable_by(|a, b| values[*a].total_cmp(&values[*b]).then(a.cmp(b)));
    let mut ranks = vec![MISSING; values.len()];
    for (rank, place) in (0..).zip(&places) {
        ranks[*place] = rank;
    }
    (places.into_iter().map(|i| values[i]).collect(), ranks)
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

#[cfg(test)]
mod tests {
    use super::*;

    fn image([columns, rows]: [usize; 2], value: impl Fn(f64, f64) -> f64) -> Image {
        let at = |i: usize| value((i % columns) as f64, (i / columns) as f64);
        Image::new(rows, columns, (0..columns * rows).map(at).collect())
    }

    /// Against medians that are written out, at the edges and where pixels are missing, too.
    #[test]
    fn medians_are_those_of_squares() {
        let mut made = image([9, 7], |x, y| (7.0 * x + 3.0 * y * y) % 11.0);
        made.values[31] = f64::NAN;
        let found = running_median(&made, 5);
        for (i, found) in found.values.iter().enumerate() {
            let (x, y) = ((i % 9) as i32, (i / 9) as i32);
            let near = |j: &usize| {
                let (dx, dy) = ((j % 9) as i32 - x, (j / 9) as i32 - y);
                dx.abs() <= 2 && dy.abs() <= 2 && made.values[*j].is_finite()
            };
            let mut all: Vec<f64> = (0..63).filter(near).map(|j| made.values[j]).collect();
            all.sort_by(f64::total_cmp);
            assert_eq!(*found, all[all.len() / 2], "{x}, {y}");
        }
    }

    /// A straight step is left where it is, and as high; a bin at it may be on either side.
    #[test]
    fn steps_stay_sharp() {
        let step = |x: f64, y: f64| f64::from(u8::from(x + 0.3 * y > 70.0));
        let made = image([128, 96], step);
        // Bins of three pixels.
        let found = running_median(&made, 48);
        let mut off = 0;
        for (i, (found, made)) in found.values.iter().zip(&made.values).enumerate() {
            let (x, y) = ((i % 128) as f64, (i / 128) as f64);
            let far = (x + 0.3 * y - 70.0).abs() > 6.0;
            // Where the frame cuts a window off it sees more of one side.
            let inside = (24.0..72.0).contains(&y);
            off += usize::from(far && inside && (found - made).abs() > 1e-9);
        }
        assert_eq!(off, 0);
    }

    /// What is taken off a perfect lattice has its periods, so that the waves of what is left are its own: columns and rows are told apart.
    #[test]
    fn a_lattice_keeps_its_periods() {
        let turn = std::f64::consts::TAU;
        let lattice = |x: f64, y: f64| (turn * x / 8.0).cos() + (turn * y / 12.0).cos().powi(3);
        let found = running_median(&image([96, 84], lattice), 15);
        for (x, y) in (16..72).flat_map(|x| (16..56).map(move |y| (x, y))) {
            let at = |x: usize, y: usize| found.values[y * 96 + x];
            assert!((at(x, y) - at(x + 8, y)).abs() < 1e-9, "{x}, {y}");
            assert!((at(x, y) - at(x, y + 12)).abs() < 1e-9, "{x}, {y}");
        }
    }

    /// Wide windows are taken of bins, and a slope goes through them as it is.
    #[test]
    fn slopes_go_through_bins() {
        let slope = |x: f64, y: f64| 0.25 * x - 0.5 * y;
        let made = image([200, 150], slope);
        let found = running_median(&made, 72);
        for (x, y) in (40..160).flat_map(|x| (40..110).map(move |y| (x, y))) {
            let off = found.values[y * 200 + x] - slope(x as f64, y as f64);
            assert!(off.abs() < 0.5, "{x}, {y}: {off}");
        }
        let mut holed = made;
        for i in 0..200 * 100 {
            holed.values[i] = f64::NAN;
        }
        let found = running_median(&holed, 72);
        assert!(found.values[200 * 149].is_finite() && found.values[0].is_nan());
    }
}
