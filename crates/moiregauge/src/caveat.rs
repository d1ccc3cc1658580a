//! Named doubts: what a reader of the numbers has to know before trusting them.

use serde::{Deserialize, Serialize};

/// A reason to trust a number less, with a stable code for programs and words for people.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Caveat {
    /// Stable kebab-case code, as in `no-position-sensors`.
    pub code: String,
    /// What is wrong and what it means for the result.
    pub message: String,
    /// What it concerns: a file, a set, or `analysis`.
    #[serde(rename = "where")]
    pub place: String,
}

impl Caveat {
    /// A caveat about `place`.
    pub fn new(code: &str, place: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            code: code.to_owned(),
            message: message.into(),
            place: place.into(),
        }
    }
}
