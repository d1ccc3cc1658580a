//! Errors that are wished for, and whether they are reached.

use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mean::Mean;

/// Errors that can be wished for, in any unit.
const WISH: [f64; 2] = [1e-9, 1e6];

/// Total standard errors at which enough is measured; none of them: never.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Until {
    /// Of the twist, degrees.
    pub twist_deg: Option<f64>,
    /// Of the heterostrain, per cent.
    pub strain_percent: Option<f64>,
}

/// Words that are no such wish.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "expected total errors, in degrees and per cent, as in twist=0.01 or twist=0.01,strain=0.02, found {0:?}"
)]
pub struct NotUntil(String);

impl FromStr for Until {
    type Err = NotUntil;

    fn from_str(text: &str) -> Result<Self, NotUntil> {
        let refused = || NotUntil(text.to_owned());
        let mut until = Self::default();
        for part in text.split(',') {
            let (name, value) = part.split_once('=').ok_or_else(refused)?;
            let value: f64 = value.trim().parse().map_err(|_| refused())?;
            if !(WISH[0]..=WISH[1]).contains(&value) {
                return Err(refused());
            }
            let wish = match name.trim() {
                "twist" => &mut until.twist_deg,
                "strain" => &mut until.strain_percent,
                _ => return Err(refused()),
            };
            if wish.replace(value).is_some() {
                return Err(refused());
            }
        }
        Ok(until)
    }
}

/// How far the wish is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UntilState {
    /// The wish.
    pub wanted: Until,
    /// Whether it is fulfilled.
    pub reached: bool,
    /// Number of further frames that may suffice; `null` where that is not known, or where no number of frames does.
    pub frames_needed: Option<usize>,
    /// Whether calibration and model alone exceed it, which no frame changes.
    pub out_of_reach: bool,
}

impl Until {
    /// Whether anything is wished for.
    pub fn is_any(&self) -> bool {
        self.twist_deg.is_some() || self.strain_percent.is_some()
    }

    /// Whether both errors are as small as wished. An error that is not known is not small.
    pub(super) fn is_met(&self, twist_deg: Option<f64>, strain_percent: Option<f64>) -> bool {
        let small = |wish: Option<f64>, now: Option<f64>| {
            wish.is_none_or(|wish| now.is_some_and(|now| now <= wish))
        };
        self.is_any()
            && small(self.twist_deg, twist_deg)
            && small(self.strain_percent, strain_percent)
    }

    /// Whether these numbers fulfil it.
    pub(super) fn is_met_by(&self, mean: &Mean) -> bool {
        self.is_met(
            mean.twist_deg.sigma_total,
            mean.heterostrain_percent.sigma_total,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wishes_are_named() {
        let both = Until {
            twist_deg: Some(0.01),
            strain_percent: Some(0.02),
        };
        assert_eq!("strain=0.02, twist=1e-2".parse(), Ok(both));
        assert!(both.is_met(Some(0.01), Some(0.0)));
        assert!(!both.is_met(Some(0.01), None) && !both.is_met(Some(0.011), Some(0.0)));
        assert!(!Until::default().is_met(Some(0.0), Some(0.0)));
        for wrong in [
            "",
            "0.01",
            "twist",
            "twist=",
            "twist=-1",
            "twist=nan",
            "drift=1",
            "twist=1,twist=2",
        ] {
            assert!(wrong.parse::<Until>().is_err(), "{wrong}");
        }
    }
}
