//! Least squares of a line by the columns of a matrix, and the number for which they leave least.

use nalgebra::{DMatrix, DVector};

/// What a golden section keeps of an interval.
const GOLDEN: f64 = 0.618_034;
/// Golden sections: to 5·10⁻⁷ of the first interval.
const SECTIONS: usize = 30;

/// The coefficients of the columns; `None` where they cannot be told apart.
pub(crate) fn solve(design: &DMatrix<f64>, line: &DVector<f64>) -> Option<DVector<f64>> {
    let normal = (design.transpose() * design).cholesky()?;
    Some(normal.solve(&(design.transpose() * line)))
}

/// Sum of the squares that they leave.
pub(crate) fn residual(design: &DMatrix<f64>, line: &DVector<f64>) -> Option<f64> {
    Some((line - design * solve(design, line)?).norm_squared())
}

/// The number between two for which `left` is least: the best of `steps` in equal ratios, then golden sections about it.
pub(crate) fn lowest(left: impl Fn(f64) -> f64, among: [f64; 2], steps: usize) -> f64 {
    lowest_below(left, among, steps, f64::INFINITY).unwrap_or(among[0])
}

/// The same, if the best of the steps leaves less than `limit`.
pub(crate) fn lowest_below(
    left: impl Fn(f64) -> f64,
    [low, high]: [f64; 2],
    steps: usize,
    limit: f64,
) -> Option<f64> {
    let ratio = (high / low).powf(1.0 / steps as f64);
    let grid = (0..=steps).map(|i| low * ratio.powi(i as i32));
    let best = grid
        .map(|x| (left(x), x))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let (least, middle) = best?;
    if least > limit {
        return None;
    }
    let (mut low, mut high) = (middle / ratio, middle * ratio);
    for _ in 0..SECTIONS {
        let (a, b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        if left(a) < left(b) {
            high = b;
        } else {
            low = a;
        }
    }
    Some(f64::midpoint(low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The time constant of an exponential is where least squares leave nothing, also beside a straight line.
    #[test]
    fn the_lowest_is_found() {
        let decay = |time: f64| DVector::from_fn(50, |i, _| (-(i as f64) / time).exp());
        let line = decay(7.3) * 2.0 + DVector::from_fn(50, |i, _| 0.1 * i as f64);
        let left = |time: f64| {
            let decay = decay(time);
            let design = DMatrix::from_fn(50, 2, |i, j| [decay[i], i as f64][j]);
            residual(&design, &line).unwrap_or(f64::INFINITY)
        };
        let found = lowest(left, [0.5, 100.0], 40);
        assert!((found - 7.3).abs() < 1e-4, "{found}");
    }
}
