//! A value with its uncertainty as the document holds it.

use heterostrain::Estimate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A value with its standard uncertainty in the same unit; `null` where unknown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Estimate")]
pub struct ResultEstimate {
    /// The best value.
    pub value: Option<f64>,
    /// One standard deviation. Where `sigma_total` stands beside it, the statistical part of that: noise of
    /// images and sensors, and the drift.
    pub sigma: Option<f64>,
    /// One standard deviation with everything, calibration and model included: publish this one. Present in the means
    /// of sets and in `combined`; left out where it is not known, as when the drift was not removed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_total: Option<f64>,
}

impl ResultEstimate {
    /// For printing: unknown numbers become NaN.
    pub(crate) fn plain(&self) -> Estimate {
        Estimate::new(
            self.value.unwrap_or(f64::NAN),
            self.sigma.unwrap_or(f64::NAN),
        )
    }

    /// For printing: with the total where it is known, otherwise with the statistical σ.
    pub(crate) fn in_all(&self) -> Estimate {
        let sigma = self.sigma_total.or(self.sigma);
        Estimate::new(self.value.unwrap_or(f64::NAN), sigma.unwrap_or(f64::NAN))
    }
}
