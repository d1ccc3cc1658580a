//! Robust plane fit `v = v₀ + a·column + b·row` to one image.

use nalgebra::{Matrix3, Vector3};

use crate::frame::image::Image;
use crate::numbers::interrupt;

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

/// Fits a plane by least squares to the columns from `columns.start` to `columns.end`.
///
/// Missing pixels are left out, and so are outliers beyond five robust standard deviations.
/// `None` where fewer than three pixels or a single line or column remain.
pub fn fit_plane(image: &Image, columns: std::ops::Range<usize>) -> Option<PlaneFit> {
    let mut limit = f64::INFINITY;
    let mut plane = PlaneFit {
        origin: 0.0,
        per_column: 0.0,
        per_row: 0.0,
        residual: f64::INFINITY,
    };
    for _ in 0..ROUNDS {
        plane = fit_within(image, columns.clone(), &plane, limit)?;
        let mut sizes: Vec<f64> = residuals(image, columns.clone(), &plane)
            .step_by(1 + image.values.len() / 16_384)
            .map(f64::abs)
            .collect();
        if sizes.is_empty() {
            return None;
        }
        let middle = sizes.len() / 2;
        let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        let next = OUTLIER_SIGMAS * 1.4826 * median;
        if next == 0.0 || next >= limit {
            break;
        }
        limit = next;
    }
    Some(plane)
}

fn residuals<'a>(
    image: &'a Image,
    columns: std::ops::Range<usize>,
    plane: &'a PlaneFit,
) -> impl Iterator<Item = f64> + 'a {
    (0..image.rows).flat_map(move |row| {
        columns.clone().filter_map(move |column| {
            let residual = image.row(row)[column] - plane.at(column as f64, row as f64);
            residual.is_finite().then_some(residual)
        })
    })
}

/// Least squares over the pixels whose residual from `guess` is within `limit`.
fn fit_within(
    image: &Image,
    columns: std::ops::Range<usize>,
    guess: &PlaneFit,
    limit: f64,
) -> Option<PlaneFit> {
    // Centred coordinates and residuals from the guess keep the sums well conditioned.
    let cx = (columns.start + columns.end) as f64 / 2.0;
    let cy = image.rows as f64 / 2.0;
    let mut normal = Matrix3::<f64>::zeros();
    let mut right = Vector3::<f64>::zeros();
    let (mut squares, mut count) = (0.0, 0usize);
    for row in 0..image.rows {
        interrupt::check();
        let y = row as f64 - cy;
        let (mut n, mut sx, mut sxx, mut sv, mut sxv) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let line = &image.row(row)[columns.clone()];
        for (i, &value) in line.iter().enumerate() {
            let column = (columns.start + i) as f64;
            let v = value - guess.at(column, row as f64);
            // False for NaN as well.
            if v.abs() < limit {
                let x = column - cx;
                n += 1.0;
                sx += x;
                sxx += x * x;
                sv += v;
                sxv += x * v;
                squares += v * v;
                count += 1;
            }
        }
        normal += Matrix3::new(n, sx, n * y, sx, sxx, sx * y, n * y, sx * y, n * y * y);
        right += Vector3::new(sv, sxv, sv * y);
    }
    let inverse = normal.try_inverse()?;
    let step = inverse * right;
    if !(count >= 3 && step.iter().all(|s| s.is_finite())) {
        return None;
    }
    let explained = step.dot(&right);
    Some(PlaneFit {
        origin: guess.origin + step[0] - step[1] * cx - step[2] * cy,
        per_column: guess.per_column + step[1],
        per_row: guess.per_row + step[2],
        residual: ((squares - explained).max(0.0) / count as f64).sqrt(),
    })
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
