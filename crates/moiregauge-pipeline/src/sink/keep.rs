//! Parts of a long run, kept until all is written.

use super::SinkError;
use super::folder::{FolderSink, Part};

/// Somewhere to keep parts of a long run, so that another one can go on with them if this one is interrupted.
pub trait Keep: Sync {
    /// Keeps a part.
    ///
    /// # Errors
    /// [`SinkError`] if it cannot be written.
    fn keep(&self, name: &str, bytes: &[u8]) -> Result<(), SinkError>;

    /// A part that an earlier run has kept.
    fn kept(&self, name: &str) -> Part;
}

impl Keep for FolderSink {
    fn keep(&self, name: &str, bytes: &[u8]) -> Result<(), SinkError> {
        FolderSink::keep(self, name, bytes)
    }

    fn kept(&self, name: &str) -> Part {
        FolderSink::kept(self, name)
    }
}

/// Keeps nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Forget;

impl Keep for Forget {
    fn keep(&self, _: &str, _: &[u8]) -> Result<(), SinkError> {
        Ok(())
    }

    fn kept(&self, _: &str) -> Part {
        Part::Absent
    }
}
