//! How well the steps of a frame are known: by what its lines say of them, each for itself.

use std::ops::Range;

use nalgebra::{Matrix4, Vector2};

use crate::frame::image::Image;
use crate::frame::plane::{PlaneFit, line_sums};

/// A line with fewer values has no slope.
const FEWEST: f64 = 3.0;

/// What a plane leaves of a line of a sensor, nm.
pub(crate) struct LineLeft {
    /// Step from column to column, that of the plane included; `None` of fewer than three values.
    pub(crate) slope: Option<f64>,
    /// The mean; NaN of a line without values.
    pub(crate) mean: f64,
}

/// Looks at every line of a sensor.
pub(crate) fn lines(image: &Image, plane: &PlaneFit, used: &Range<usize>) -> Vec<LineLeft> {
    let mut lines = Vec::with_capacity(image.rows);
    let add = |_, [n, x, xx, v, xv, _]: [f64; 6]| {
        let spread = n * xx - x * x;
        let known = n >= FEWEST && spread > 0.0;
        lines.push(LineLeft {
            slope: known.then(|| plane.per_column + (n * xv - x * v) / spread),
            mean: v / n,
        });
    };
    line_sums(image, used.clone(), plane, f64::INFINITY, 1, add);
    lines
}

/// Covariance of `J` from what repeats: the fast step from line to line, the slow step from the
/// scatter of the line means, each with an effective number of independent lines.
pub(crate) fn covariance(
    line_slopes: &[Vector2<f64>],
    lines: &[Vec<LineLeft>; 2],
    planes: &[PlaneFit; 2],
) -> Matrix4<f64> {
    let mut c = Matrix4::zeros();
    for (axis, (lines, plane)) in lines.iter().zip(planes).enumerate() {
        let slopes: Vec<f64> = line_slopes
            .iter()
            .map(|s| s[axis] - plane.per_column)
            .collect();
        let n = slopes.len() as f64;
        if n > 1.0 {
            let variance = slopes.iter().map(|s| s * s).sum::<f64>() / (n - 1.0);
            c[(axis, axis)] = variance * correlated(&slopes) / n;
        }
        let means = lines.iter().map(|line| line.mean);
        let means: Vec<f64> = means.filter(|m| m.is_finite()).collect();
        let n = means.len() as f64;
        if n > 2.0 {
            let variance = means.iter().map(|m| m * m).sum::<f64>() / (n - 2.0);
            let spread = n * (n * n - 1.0) / 12.0;
            c[(2 + axis, 2 + axis)] = variance * correlated(&means) / spread;
        }
    }
    c
}

/// By how much correlation between successive residuals raises the variance of their mean:
/// `1 + 2 Σ ρ_k`, summed while the autocorrelation is positive (initial positive sequence).
pub(crate) fn correlated(residuals: &[f64]) -> f64 {
    let total: f64 = residuals.iter().map(|r| r * r).sum();
    if total == 0.0 {
        return 1.0;
    }
    let mut factor = 1.0;
    for lag in 1..residuals.len() / 4 {
        let rho = residuals
            .iter()
            .zip(&residuals[lag..])
            .map(|(a, b)| a * b)
            .sum::<f64>()
            / total;
        // Below twice the scatter of ρ for independent residuals it is noise.
        if rho < 2.0 / (residuals.len() as f64).sqrt() {
            break;
        }
        factor += 2.0 * rho;
    }
    factor
}
