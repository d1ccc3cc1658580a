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

    /// From a value and its variance; rounding may have left the variance slightly negative.
    pub fn from_variance(value: f64, variance: f64) -> Self {
        Self::new(value, variance.max(0.0).sqrt())
    }

    /// The same quantity in another unit.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self::new(self.value * factor, self.sigma * factor.abs())
    }
}
