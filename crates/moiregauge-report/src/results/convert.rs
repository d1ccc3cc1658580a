//! Units of the inside (nm, s, rad) → units of the surface, and NaN → nothing.

use heterostrain::{Estimate, TotalEstimate};
use nalgebra::{Matrix2, Vector2};

use super::estimate::ResultEstimate;

/// Seconds in a minute: nm/s → nm/min.
pub(crate) const PER_MINUTE: f64 = 60.0;
/// Fraction → per cent.
pub(crate) const PERCENT: f64 = 100.0;

/// Degrees in a radian.
pub(crate) fn degree() -> f64 {
    1_f64.to_degrees()
}

/// A finite number, or nothing. Negative zero becomes zero.
pub(crate) fn number(value: f64) -> Option<f64> {
    value.is_finite().then_some(value + 0.0)
}

/// An estimate in another unit.
pub(crate) fn estimate(estimate: Estimate, factor: f64) -> ResultEstimate {
    let scaled = estimate.scaled(factor);
    ResultEstimate {
        value: number(scaled.value),
        sigma: number(scaled.sigma),
        sigma_total: None,
    }
}

/// An estimate with its total in another unit.
pub(crate) fn estimate_in_all(found: TotalEstimate, factor: f64) -> ResultEstimate {
    ResultEstimate {
        sigma_total: number(found.scaled(factor).total),
        ..estimate(found.statistical(), factor)
    }
}

/// A vector in another unit.
pub(crate) fn pair(vector: Vector2<f64>, factor: f64) -> [Option<f64>; 2] {
    [number(vector.x * factor), number(vector.y * factor)]
}

/// A matrix, row by row, in another unit.
pub(crate) fn square(matrix: &Matrix2<f64>, factor: f64) -> [[Option<f64>; 2]; 2] {
    [0, 1].map(|row| [0, 1].map(|column| number(matrix[(row, column)] * factor)))
}

/// The correlation coefficient of two components.
pub(crate) fn correlation(covariance: &Matrix2<f64>) -> Option<f64> {
    let product = (covariance[(0, 0)] * covariance[(1, 1)]).sqrt();
    number(covariance[(0, 1)] / product)
}
