//! Counting for the figures: histograms, means, angles that wrap. Nothing here is a result.

use std::f64::consts::{PI, TAU};

use crate::draw::scale::Range;

/// Counts in equal bins.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Histogram {
    pub(crate) range: Range,
    pub(crate) counts: Vec<usize>,
}

impl Histogram {
    /// Values outside the range are not counted.
    pub(crate) fn of(values: &[f64], range: Range, bins: usize) -> Self {
        let mut counts = vec![0; bins];
        for &value in values {
            let place = (value - range.low) / range.width() * bins as f64;
            if place >= 0.0 && place <= bins as f64 {
                counts[(place as usize).min(bins - 1)] += 1;
            }
        }
        Self { range, counts }
    }

    /// Width of a bin.
    pub(crate) fn step(&self) -> f64 {
        self.range.width() / self.counts.len() as f64
    }

    /// The highest count, at least 1.
    pub(crate) fn highest(&self) -> f64 {
        self.counts.iter().copied().max().unwrap_or(0).max(1) as f64
    }

    /// The outline of the bars: (value, count), beginning and ending at zero.
    pub(crate) fn outline(&self) -> Vec<(f64, f64)> {
        let edge = |i: usize| self.range.low + i as f64 * self.step();
        let mut points = vec![(edge(0), 0.0)];
        for (i, &count) in self.counts.iter().enumerate() {
            points.push((edge(i), count as f64));
            points.push((edge(i + 1), count as f64));
        }
        points.push((edge(self.counts.len()), 0.0));
        points
    }
}

/// A number of bins that shows the shape of `n` values.
pub(crate) fn bins(n: usize) -> usize {
    ((n as f64).cbrt() * 2.0).clamp(8.0, 44.0) as usize
}

/// Mean and standard deviation (n − 1) of the finite values; NaN where there are too few.
pub(crate) fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let n = finite.len() as f64;
    let mean = finite.iter().sum::<f64>() / n;
    let square: f64 = finite.iter().map(|v| (v - mean).powi(2)).sum();
    let deviation = if finite.len() > 1 {
        (square / (n - 1.0)).sqrt()
    } else {
        f64::NAN
    };
    (mean, deviation)
}

/// The density of the normal distribution.
pub(crate) fn gaussian(x: f64, mean: f64, sigma: f64) -> f64 {
    (-0.5 * ((x - mean) / sigma).powi(2)).exp() / (sigma * TAU.sqrt())
}

/// The range between two quantiles of the finite values.
pub(crate) fn central(values: &[f64], share: f64) -> Option<Range> {
    let mut finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    finite.sort_by(f64::total_cmp);
    let last = finite.len().checked_sub(1)?;
    let tail = ((1.0 - share) / 2.0 * last as f64).round() as usize;
    Some(Range::new(finite[tail], finite[last - tail]))
}

/// The axis `angle` (modulo π), turned by half turns to lie within π/2 of `near`.
pub(crate) fn axis_near(angle: f64, near: f64) -> f64 {
    near + (angle - near + PI / 2.0).rem_euclid(PI) - PI / 2.0
}

/// Points of the ellipse `n` standard deviations around a mean: `mean + n · C^½ (cos t, sin t)`.
pub(crate) fn ellipse(
    mean: nalgebra::Vector2<f64>,
    covariance: &nalgebra::Matrix2<f64>,
    n: f64,
) -> Vec<(f64, f64)> {
    // The decomposition would not end on NaN.
    if !covariance.iter().all(|c| c.is_finite()) {
        return Vec::new();
    }
    let eigen = covariance.symmetric_eigen();
    (0..=72)
        .map(|i| {
            let t = TAU * f64::from(i) / 72.0;
            let along = |k: usize, part: f64| {
                eigen.eigenvectors.column(k) * (part * n * eigen.eigenvalues[k].max(0.0).sqrt())
            };
            let point = mean + along(0, t.cos()) + along(1, t.sin());
            (point.x, point.y)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_in_range_is_counted_once() {
        let found = Histogram::of(
            &[0.0, 0.9, 1.0, 2.0, 2.1, f64::NAN],
            Range::new(0.0, 2.0),
            2,
        );
        assert_eq!(found.counts, [2, 2]);
    }

    #[test]
    fn an_axis_comes_within_a_quarter_turn() {
        assert!((axis_near(0.1, PI) - (PI + 0.1)).abs() < 1e-12);
        assert!((axis_near(PI - 0.1, 0.0) + 0.1).abs() < 1e-12);
    }

    /// Every point of the n-σ ellipse has (x − μ)ᵀ C⁻¹ (x − μ) = n².
    #[test]
    fn the_ellipse_is_a_contour() -> Result<(), &'static str> {
        let covariance = nalgebra::Matrix2::new(2.0, 0.6, 0.6, 0.5);
        let inverse = covariance.try_inverse().ok_or("no inverse")?;
        for (x, y) in ellipse(nalgebra::Vector2::new(3.0, -1.0), &covariance, 2.0) {
            let d = nalgebra::Vector2::new(x - 3.0, y + 1.0);
            assert!(((d.transpose() * inverse * d)[0] - 4.0).abs() < 1e-9);
        }
        Ok(())
    }
}
