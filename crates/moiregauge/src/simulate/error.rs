//! Why a simulation cannot be run.

use heterostrain::strain::StrainError;

/// Why a simulation cannot be run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// A setting is out of its range.
    #[error("setting `{setting}`: expected {expected}, found {found}")]
    Setting {
        /// Its path, as in `raster.line_rate_hz`.
        setting: &'static str,
        /// The range, in words.
        expected: &'static str,
        /// As given.
        found: String,
    },
    /// A class of samples, or one of its numbers, that does not exist or is out of its range.
    #[error("{setting}: expected {expected}, found {found}")]
    Feature {
        /// Which, as in `sample edge: share`.
        setting: String,
        /// What there is, or the range.
        expected: String,
        /// As given.
        found: String,
    },
    /// Twist, strain and material make no moiré.
    #[error("the sample has no moiré: {0}")]
    NoMoire(#[from] StrainError),
}
