//! Files that were given.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An input, known by its content.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct InputFile {
    /// The file as the user named it.
    pub file: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// Its size in bytes.
    pub bytes: u64,
}

/// An input that could not be used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FailedInput {
    /// The file as the user named it.
    pub file: String,
    /// What was expected and what was found.
    pub error: String,
}
