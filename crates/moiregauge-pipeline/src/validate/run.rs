//! Conditions → many sets, analysed and compared.

use moiregauge::numbers::interrupt;
use moiregauge::settings::SettingsError;
use moiregauge::simulate::{Simulation, Simulator};
use moiregauge::spectrum::Method;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::compare::{Comparison, compare};
use super::error::ValidateError;
use super::found::Validation;
use crate::job::Job;

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

/// Simulates sets, analyses them, and compares drift, twist and strain with what was put in: bias, efficiency, and
/// coverage of the stated errors.
///
/// # Errors
/// [`ValidateError`].
///
/// ```no_run
/// use moiregauge_pipeline::Job;
/// use moiregauge_pipeline::validate::{ValidateRequest, validate};
///
/// let found = validate(&ValidateRequest { sets: 20, ..ValidateRequest::default() }, &Job::quiet(None)?)?;
/// for quantity in &found.quantities {
///     println!("{}: rms pull {:.2}", quantity.name, quantity.rms_pull);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn validate(request: &ValidateRequest, job: &Job) -> Result<Validation, ValidateError> {
    request.check()?;
    let stage = job.stage("validating", "sets", request.sets as usize);
    let one = |index| {
        interrupt::check();
        let result = compare(&request.conditions, request.method, request.seed, index);
        stage.step();
        result
    };
    let compared: Vec<Option<Comparison>> =
        job.run(|| (0..request.sets).into_par_iter().map(one).collect())?;
    drop(stage);
    let failed = compared.iter().filter(|c| c.is_none()).count();
    let compared: Vec<Comparison> = compared.into_iter().flatten().collect();
    if compared.len() < 2 {
        return Err(ValidateError::Nothing {
            failed,
            sets: request.sets,
        });
    }
    Ok(Validation::new(request, failed, compared))
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
