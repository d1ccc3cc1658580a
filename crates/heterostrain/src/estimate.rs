//! A measured number and its uncertainty.

use serde::{Deserialize, Serialize};

/// A value with its standard uncertainty, in the same unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Estimate {
    /// The best value.
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
}

impl Estimate {
    /// A value and its standard uncertainty.
    pub fn new(value: f64, sigma: f64) -> Self {
        Self { value, sigma }
    }

    /// From a value and its variance; rounding may have left the variance slightly negative. An unknown
    /// variance (NaN) is an unknown σ, not zero.
    pub fn from_variance(value: f64, variance: f64) -> Self {
        let sigma = if variance < 0.0 { 0.0 } else { variance.sqrt() };
        Self::new(value, sigma)
    }

    /// The same quantity in another unit.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self::new(self.value * factor, self.sigma * factor.abs())
    }
}

/// A measured number with both of its standard uncertainties, in the same unit.
///
/// What may be published is `value ± total`; `statistical` alone is for comparing results of one scanner and
/// one model with each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TotalEstimate {
    /// The best value.
    pub value: f64,
    /// One standard deviation by what scatters: noise of images and sensors, and the drift.
    pub statistical: f64,
    /// One standard deviation by everything: calibration of the scanner, lattice constant and model as well;
    /// NaN where a part of it is not known.
    pub total: f64,
}

impl TotalEstimate {
    /// A statistical estimate and the variance of everything.
    pub fn new(statistical: Estimate, total_variance: f64) -> Self {
        let Estimate { value, sigma } = statistical;
        Self {
            value,
            statistical: sigma,
            total: Estimate::from_variance(value, total_variance).sigma,
        }
    }

    /// The value with everything: what may be published.
    pub fn total(self) -> Estimate {
        Estimate::new(self.value, self.total)
    }

    /// The value with its statistical part alone.
    pub fn statistical(self) -> Estimate {
        Estimate::new(self.value, self.statistical)
    }

    /// The same quantity in another unit.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            statistical: self.statistical * factor.abs(),
            total: self.total * factor.abs(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_variance_is_not_zero() {
        assert_eq!(Estimate::from_variance(1.0, 4.0).sigma, 2.0);
        assert_eq!(Estimate::from_variance(1.0, -1e-20).sigma, 0.0);
        assert!(Estimate::from_variance(1.0, f64::NAN).sigma.is_nan());
    }
}
