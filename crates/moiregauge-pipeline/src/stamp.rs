//! What tells a file that was changed without reading it.

use std::fs::Metadata;
use std::path::Path;
use std::time::SystemTime;

/// Size and date of a file. Dates are those of the computer that wrote it: they are compared with each other only, never
/// with a clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stamp {
    bytes: u64,
    modified: Option<SystemTime>,
}

impl Stamp {
    /// That of a file, if there is one.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        Some((&std::fs::metadata(path).ok()?).into())
    }
}

impl From<&Metadata> for Stamp {
    fn from(found: &Metadata) -> Self {
        Self {
            bytes: found.len(),
            modified: found.modified().ok(),
        }
    }
}
