//! Robust plane fit `v = v₀ + a·column + b·row` to one image.

use std::ops::Range;

use crate::frame::column_sums::ColumnSums;
use crate::frame::image::Image;
use crate::frame::plane::{PlaneFit, PlaneSums, line_sums};
use crate::numbers::median::median;

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
pub(crate) fn fit_plane(image: &Image, columns: Range<usize>) -> Option<PlaneFit> {
    through(&ColumnSums::of(image), image, columns)
}

/// The same from the sums over the columns of the image: it is read again only where it has outliers.
pub(crate) fn through(sums: &ColumnSums, image: &Image, columns: Range<usize>) -> Option<PlaneFit> {
    let mut plane = sums.least_squares(columns.clone())?;
    let mut limit = limit(image, columns.clone(), &plane)?;
    if limit == 0.0 || sums.all_within(columns.clone(), &plane, limit) {
        return Some(plane);
    }
    for _ in 1..ROUNDS {
        plane = fit_within(image, columns.clone(), &plane, limit)?;
        let next = self::limit(image, columns.clone(), &plane)?;
        if next == 0.0 || next >= limit {
            break;
        }
        limit = next;
    }
    Some(plane)
}

/// The residual from which on a pixel is an outlier; `None` without pixels.
fn limit(image: &Image, columns: Range<usize>, plane: &PlaneFit) -> Option<f64> {
    let mut sizes = sampled_residuals(image, columns, plane);
    (!sizes.is_empty()).then(|| OUTLIER_SIGMAS * 1.4826 * median(&mut sizes))
}

/// Sizes of the residuals of some 16,000 pixels, evenly spread; missing ones are left out.
fn sampled_residuals(image: &Image, columns: Range<usize>, plane: &PlaneFit) -> Vec<f64> {
    let width = columns.len();
    let step = 1 + image.values.len() / SAMPLED;
    let mut sizes = Vec::with_capacity(image.rows * width / step + 1);
    // Columns of each line at a constant step, from where the line before left off.
    let mut first = 0;
    for row in 0..image.rows {
        let line = &image.row(row)[columns.clone()];
        let mut column = first;
        while column < width {
            let place = (columns.start + column) as f64;
            let size = (line[column] - plane.at(place, row as f64)).abs();
            if size.is_finite() {
                sizes.push(size);
            }
            column += step;
        }
        first = column - width;
    }
    sizes
}

/// Least squares over the pixels whose residual from `guess` is within `limit`.
fn fit_within(
    image: &Image,
    columns: Range<usize>,
    guess: &PlaneFit,
    limit: f64,
) -> Option<PlaneFit> {
    let mut sums = PlaneSums::new(guess, columns.clone(), image.rows);
    line_sums(image, columns, guess, limit, 1, |row, of_line| {
        sums.add_line(row, of_line);
    });
    sums.plane()
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
