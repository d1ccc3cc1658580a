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
}

impl From<&Caveat> for ResultCaveat {
    fn from(caveat: &Caveat) -> Self {
        Self {
            code: caveat.code().to_owned(),
            message: caveat.message(),
            place: caveat.place.clone(),
        }
    }
}
