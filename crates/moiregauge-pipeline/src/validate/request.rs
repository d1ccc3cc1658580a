//! What is to be validated.

use moiregauge::settings::SettingsError;
use moiregauge::simulate::{Simulation, Simulator};
use moiregauge::spectrum::Method;
use serde::{Deserialize, Serialize};

use super::error::ValidateError;

/// Sets of one validation.
const SETS: [u32; 2] = [2, 1_000_000];

/// What is to be validated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ValidateRequest {
    /// Instrument and sample.
    pub conditions: Simulation,
    /// Estimator of the lattice vectors.
    pub method: Method,
    /// Number of sets, each with noise and a lattice orientation of its own.
    pub sets: u32,
    /// Seed of all noise.
    pub seed: u64,
}

impl Default for ValidateRequest {
    /// 200 sets of four small frames.
    fn default() -> Self {
        let mut conditions = Simulation::default();
        conditions.raster.pixels = [128; 2];
        conditions.raster.scans = 4;
        Self {
            conditions,
            method: Method::Lattice,
            sets: 200,
            seed: 1,
        }
    }
}

impl ValidateRequest {
    /// Refuses what cannot be simulated.
    ///
    /// # Errors
    /// Which setting makes no sense.
    pub fn check(&self) -> Result<(), ValidateError> {
        check_sets(self.sets, SETS[0])?;
        Simulator::new(self.conditions.clone()).map_err(ValidateError::Conditions)?;
        Ok(())
    }
}

/// An error if that many sets cannot be made.
pub(super) fn check_sets(sets: u32, least: u32) -> Result<(), SettingsError> {
    if (least..=SETS[1]).contains(&sets) {
        return Ok(());
    }
    let most = SETS[1];
    Err(SettingsError {
        setting: "sets",
        reason: format!("sets: expected a whole number from {least} to {most}, found {sets}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_checked() {
        let request = ValidateRequest::default();
        request.check().unwrap();
        let none = ValidateRequest {
            sets: 0,
            ..request.clone()
        };
        assert!(matches!(none.check(), Err(ValidateError::Settings(e)) if e.setting == "sets"));
        let mut wrong = request;
        wrong.conditions.raster.line_rate_hz = f64::NAN;
        assert!(matches!(wrong.check(), Err(ValidateError::Conditions(_))));
    }
}
