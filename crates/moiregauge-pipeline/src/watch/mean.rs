//! Numbers of a set, in degrees and per cent.

use moiregauge_report::results::{ResultEstimate, TwistStrainResult};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A value with its errors; `null` where unknown, never NaN.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Number {
    /// The best value.
    pub value: Option<f64>,
    /// One standard deviation by noise of images and sensors, and by drift.
    pub sigma: Option<f64>,
    /// One standard deviation with everything, calibration and model included.
    pub sigma_total: Option<f64>,
}

impl From<ResultEstimate> for Number {
    fn from(found: ResultEstimate) -> Self {
        Self {
            value: found.value,
            sigma: found.sigma,
            sigma_total: found.sigma_total,
        }
    }
}

/// Twist and strain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Mean {
    /// Twist, degrees.
    pub twist_deg: Number,
    /// Magnitude of the heterostrain with the noise bias removed, per cent.
    pub heterostrain_percent: Number,
}

impl From<&TwistStrainResult> for Mean {
    fn from(found: &TwistStrainResult) -> Self {
        Self {
            twist_deg: found.twist_deg.into(),
            heterostrain_percent: found.heterostrain_percent.into(),
        }
    }
}
