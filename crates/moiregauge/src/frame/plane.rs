//! Robust plane fit `v = v₀ + a·column + b·row` to one image.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use crate::frame::image::Image;
use crate::numbers::interrupt;
use crate::numbers::median::median;

/// A fitted plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneFit {
    /// Value at pixel (0, 0).
    pub origin: f64,
    /// Slope from column to column.
    pub per_column: f64,
    /// Slope from row to row.
    pub per_row: f64,
    /// Standard deviation of the residuals of the pixels that were used.
    pub residual: f64,
}

impl PlaneFit {
    /// The plane at a pixel.
    pub fn at(&self, column: f64, row: f64) -> f64 {
        self.origin + self.per_column * column + self.per_row * row
    }
}

/// Rounds of outlier rejection; the set of rejected pixels settles in one or two.
const ROUNDS: usize = 3;
/// Residuals beyond this many standard deviations are outliers (one in 10⁶ for Gaussian noise).
const OUTLIER_SIGMAS: f64 = 5.0;
/// Residuals that the standard deviation is read from: it is then known to a per cent.
const SAMPLED: usize = 16_384;

/// Fits a plane by least squares to the columns from `columns.start` to `columns.end`.
///
/// Missing pixels are left out, and so are outliers beyond five robust standard deviations.
/// `None` where fewer than three pixels or a single line or column remain.
pub fn fit_plane(image: &Image, columns: Range<usize>) -> Option<PlaneFit> {
    let mut limit = f64::INFINITY;
    let mut plane = PlaneFit {
        origin: 0.0,
        per_column: 0.0,
        per_row: 0.0,
        residual: f64::INFINITY,
    };
    for _ in 0..ROUNDS {
        plane = fit_within(image, columns.clone(), &plane, limit)?;
        let mut sizes = sampled_residuals(image, columns.clone(), &plane);
        if sizes.is_empty() {
            return None;
        }
        let next = OUTLIER_SIGMAS * 1.4826 * median(&mut sizes);
        if next == 0.0 || next >= limit {
            break;
        }
        limit = next;
    }
    Some(plane)
}

/// Sizes of the residuals of some 16,000 pixels, evenly spread; missing ones are left out.
fn sampled_residuals(image: &Image, columns: Range<usize>, plane: &PlaneFit) -> Vec<f64> {
    let width = columns.len();
    let step = 1 + image.values.len() / SAMPLED;
    let sizes = (0..image.rows * width).step_by(step).map(|place| {
        let (row, column) = (place / width, columns.start + place % width);
        (image.row(row)[column] - plane.at(column as f64, row as f64)).abs()
    });
    sizes.filter(|size| size.is_finite()).collect()
}

/// Pixels that are summed side by side. Their number is fixed, so that every vector width gives the same bits.
const LANES: usize = 8;

/// Sums over pixels of one line within the limit: their number, x, x², v, x v, v², where x is the place along the line from
/// the middle and v the residual.
type Sums = [[f64; LANES]; 6];

/// Least squares over the pixels whose residual from `guess` is within `limit`.
fn fit_within(
    image: &Image,
    columns: Range<usize>,
    guess: &PlaneFit,
    limit: f64,
) -> Option<PlaneFit> {
    // Centred coordinates and residuals from the guess keep the sums well conditioned.
    let cx = (columns.start + columns.end) as f64 / 2.0;
    let cy = image.rows as f64 / 2.0;
    let mut normal = Matrix3::<f64>::zeros();
    let mut right = Vector3::<f64>::zeros();
    let (mut squares, mut count) = (0.0, 0.0);
    let from_middle: Vec<f64> = columns.clone().map(|c| c as f64 - cx).collect();
    let slope: Vec<f64> = columns
        .clone()
        .map(|c| guess.per_column * c as f64)
        .collect();
    for row in 0..image.rows {
        interrupt::check();
        let y = row as f64 - cy;
        let line = Line {
            values: &image.row(row)[columns.clone()],
            from_middle: &from_middle,
            slope: &slope,
            start: guess.origin + guess.per_row * row as f64,
        };
        let [n, sx, sxx, sv, sxv, svv] = line.sums(limit);
        normal += Matrix3::new(n, sx, n * y, sx, sxx, sx * y, n * y, sx * y, n * y * y);
        right += Vector3::new(sv, sxv, sv * y);
        squares += svv;
        count += n;
    }
    let inverse = normal.try_inverse()?;
    let step = inverse * right;
    if !(count >= 3.0 && step.iter().all(|s| s.is_finite())) {
        return None;
    }
    let explained = step.dot(&right);
    Some(PlaneFit {
        origin: guess.origin + step[0] - step[1] * cx - step[2] * cy,
        per_column: guess.per_column + step[1],
        per_row: guess.per_row + step[2],
        residual: ((squares - explained).max(0.0) / count).sqrt(),
    })
}

/// One line of an image and of the plane that is guessed.
struct Line<'a> {
    values: &'a [f64],
    /// Columns from the middle of those that are used.
    from_middle: &'a [f64],
    /// The guessed plane along the line, from its start.
    slope: &'a [f64],
    start: f64,
}

impl Line<'_> {
    fn sums(&self, limit: f64) -> [f64; 6] {
        let mut sums: Sums = [[0.0; LANES]; 6];
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || {
                let (values, ends) = self.values.as_chunks::<LANES>();
                let (xs, last_xs) = self.from_middle.as_chunks::<LANES>();
                let (slopes, last_slopes) = self.slope.as_chunks::<LANES>();
                for ((values, xs), slopes) in values.iter().zip(xs).zip(slopes) {
                    for lane in 0..LANES {
                        let v = values[lane] - slopes[lane] - self.start;
                        add(&mut sums, lane, xs[lane], v, limit);
                    }
                }
                for (lane, value) in ends.iter().enumerate() {
                    let v = value - last_slopes[lane] - self.start;
                    add(&mut sums, lane, last_xs[lane], v, limit);
                }
            },
        );
        sums.map(|lanes| lanes.iter().sum())
    }
}

#[expect(
    clippy::inline_always,
    reason = "only inlined code is compiled for the wide vectors"
)]
#[inline(always)]
fn add(sums: &mut Sums, lane: usize, x: f64, v: f64, limit: f64) {
    // False for NaN as well.
    let inside = v.abs() < limit;
    let (one, x, v) = if inside { (1.0, x, v) } else { (0.0, 0.0, 0.0) };
    for (sum, term) in sums.iter_mut().zip([one, x, x * x, v, x * v, v * v]) {
        sum[lane] += term;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An exact plane with outliers and missing pixels is recovered to rounding.
    #[test]
    fn outliers_and_gaps_do_not_move_the_plane() {
        let (rows, columns) = (40, 60);
        let values = (0..rows * columns)
            .map(|i| {
                let (x, y) = ((i % columns) as f64, (i / columns) as f64);
                let ripple = if (i % columns + i / columns) % 2 == 0 {
                    1e-3
                } else {
                    -1e-3
                };
                match i % 97 {
                    0 => f64::NAN,
                    1 => 1e4,
                    _ => 5.0 + 0.1 * x - 0.02 * y + ripple,
                }
            })
            .collect();
        let fit = fit_plane(&Image::new(rows, columns, values), 0..columns).unwrap();
        assert!((fit.per_column - 0.1).abs() < 2e-6, "{fit:?}");
        assert!((fit.per_row + 0.02).abs() < 2e-6, "{fit:?}");
        assert!((fit.origin - 5.0).abs() < 1e-4, "{fit:?}");
        assert!((fit.residual - 1e-3).abs() < 1e-5, "{fit:?}");
    }

    /// A single line does not determine a plane.
    #[test]
    fn one_line_is_no_plane() {
        let image = Image::new(1, 5, vec![0.0, 1.0, 2.0, 3.0, 4.0]);
        assert!(fit_plane(&image, 0..5).is_none());
    }
}
