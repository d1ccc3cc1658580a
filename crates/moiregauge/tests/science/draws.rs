//! How many draws a test of coverage takes, and where the mean square of their pulls has to lie.

use std::ops::RangeInclusive;

/// `usual` draws, or as many as `MOIREGAUGE_DRAWS` says: `docs/draws.sh` asks for hundreds.
pub(crate) fn draws(usual: u32) -> u32 {
    let asked = std::env::var("MOIREGAUGE_DRAWS").ok();
    asked.map_or(usual, |n| n.parse().expect("MOIREGAUGE_DRAWS is a number"))
}

/// Where χ²/n of n true errors lies but for one time in 370: its quantiles at ± 3 σ.
pub(crate) fn mean_square(n: u32) -> RangeInclusive<f64> {
    quantile(n, -3.0)..=quantile(n, 3.0)
}

/// The quantile of χ²/n that a normal variable has at `sigmas` (Wilson and Hilferty, PNAS 17, 684, 1931).
fn quantile(n: u32, sigmas: f64) -> f64 {
    let variance = 2.0 / (9.0 * f64::from(n));
    (1.0 - variance + sigmas * variance.sqrt()).powi(3)
}

/// Tables of χ²: 0.1 and 99.9 % of 10, of 60 and of 100 degrees of freedom.
#[test]
fn quantiles_are_those_of_the_tables() {
    for (n, low, high) in [
        (10, 1.479, 29.588),
        (60, 31.738, 99.607),
        (100, 61.918, 149.449),
    ] {
        let chi2 = |sigmas: f64| f64::from(n) * quantile(n, sigmas);
        assert!((chi2(-3.0902) - low).abs() < 0.2, "{n}: {}", chi2(-3.0902));
        assert!((chi2(3.0902) - high).abs() < 0.2, "{n}: {}", chi2(3.0902));
    }
}
