//! Why a validation has no answer.

use moiregauge::settings::SettingsError;
use moiregauge::simulate::SimulateError;

use crate::job::Cancelled;

/// Why a validation has no answer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ValidateError {
    /// It was stopped.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A number of the request.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The conditions.
    #[error("these conditions cannot be simulated")]
    Conditions(#[source] SimulateError),
    /// A class of samples that does not exist, or one of its numbers.
    #[error(transparent)]
    Class(#[from] SimulateError),
    /// A sample.
    #[error("sample {sample}")]
    Sample {
        /// As it was given.
        sample: String,
        /// Which setting makes no sense.
        source: SimulateError,
    },
    /// Hardly any set gave an answer.
    #[error("{failed} of {sets} sets gave no drift and twist: nothing to compare")]
    Nothing {
        /// Sets without.
        failed: usize,
        /// All sets.
        sets: u32,
    },
}
