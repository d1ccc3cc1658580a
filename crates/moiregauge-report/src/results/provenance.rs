//! Where the numbers come from: program, seed, inputs and what was left out.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::run::Run;
use crate::input::{FailedInput, InputFile};

/// What is needed to make the numbers again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Provenance {
    /// Version of the program.
    pub version: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The files that were analysed, in order.
    pub inputs: Vec<InputFile>,
    /// The files that were given but could not be used.
    pub failed: Vec<FailedInput>,
    /// What was asked, for a repetition.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<Run>,
}
