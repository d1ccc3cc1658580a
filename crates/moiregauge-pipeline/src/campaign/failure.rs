//! Why a file could not be measured, with what helps against it.

use moiregauge::scan::MeasureError;
use serde::{Deserialize, Serialize};

use crate::names::in_full;
use crate::opened::InputError;

/// What a front end says that helps against an error: its own options.
pub type Advice = fn(&InputError) -> Option<String>;

/// Nothing.
pub fn no_advice(_: &InputError) -> Option<String> {
    None
}

/// An error with what helps against it and with all its causes, in one line.
pub fn in_words(error: &InputError, advice: Advice) -> String {
    let words = in_full(error);
    match advice(error) {
        Some(advice) => format!("{advice}: {words}"),
        None => words,
    }
}

/// Why a file could not be measured, in words that can be kept.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Failure {
    pub(super) error: String,
    /// Whether it is the image that shows none.
    pub(super) no_lattice: bool,
}

impl Failure {
    pub(super) fn of(error: &InputError, advice: Advice) -> Self {
        Self {
            error: in_words(error, advice),
            no_lattice: matches!(error, InputError::Measure(MeasureError::Lattice { .. })),
        }
    }
}
