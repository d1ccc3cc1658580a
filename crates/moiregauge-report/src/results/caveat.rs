//! Doubts as they stand in documents.

use moiregauge::caveat::Caveat;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A reason to trust a number less, with a stable code for programs and words for people.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Caveat")]
pub struct ResultCaveat {
    /// Stable kebab-case code, as in `no-position-sensors`.
    pub code: String,
    /// What is wrong and what it means for the result.
    pub message: String,
    /// What it concerns: a file, a set, or `analysis`.
    #[serde(rename = "where")]
    pub place: String,
    /// What was tried before it was raised, one line for each attempt. Left out where nothing was.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub attempts: Vec<String>,
}

impl From<&Caveat> for ResultCaveat {
    fn from(caveat: &Caveat) -> Self {
        Self {
            code: caveat.code().to_owned(),
            message: caveat.message(),
            place: caveat.place.clone(),
            attempts: caveat.attempts().to_vec(),
        }
    }
}
