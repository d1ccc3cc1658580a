//! Conditions → many sets, analysed and compared.

use moiregauge::numbers::interrupt;
use rayon::prelude::*;

use super::compare::{Comparison, compare};
use super::error::ValidateError;
use super::found::Validation;
use super::request::ValidateRequest;
use crate::job::Job;

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
