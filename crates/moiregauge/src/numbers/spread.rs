//! Mean and standard deviation.

use heterostrain::Estimate;

/// Mean and standard deviation (N − 1) of `values`; σ is NaN for fewer than two.
pub(crate) fn mean_and_spread(values: &[f64]) -> Estimate {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    Estimate::new(mean, variance.sqrt())
}
