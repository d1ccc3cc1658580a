//! The bytes of a file and their format: read once, told once, however often channels are taken of them.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use moiregauge_report::InputFile;
use sha2::{Digest as _, Sha256};
use spmfile::{Format, detect};

use crate::hash::hexadecimal;
use crate::names::in_words;
use crate::reading::{self, FileError};

/// A file in memory.
#[derive(Clone, Debug)]
pub struct Content {
    bytes: Arc<Vec<u8>>,
    format: Format,
    sha256: OnceLock<String>,
}

impl Content {
    /// Reads a file.
    ///
    /// # Errors
    /// As [`crate::read`].
    pub fn read(place: &Path) -> Result<Self, FileError> {
        Ok(Self::of(reading::read(place)?))
    }

    /// These bytes.
    #[must_use]
    pub fn of(bytes: Vec<u8>) -> Self {
        Self::shared(Arc::new(bytes))
    }

    /// Bytes that others hold, too.
    pub(crate) fn shared(bytes: Arc<Vec<u8>>) -> Self {
        Self {
            format: detect(&bytes),
            sha256: OnceLock::new(),
            bytes,
        }
    }

    /// What the file holds.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// What its bytes say it is.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Their hash, calculated once.
    fn sha256(&self) -> &str {
        let hash = || hexadecimal(&Sha256::digest(self.bytes.as_slice()));
        self.sha256.get_or_init(hash)
    }

    /// What identifies the file; `name` is what the user calls it.
    pub fn identity(&self, name: &Path) -> InputFile {
        InputFile {
            file: in_words(name),
            sha256: self.sha256().to_owned(),
            bytes: self.bytes.len() as u64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::identity;

    #[test]
    fn content_has_the_identity_of_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        std::fs::write(&path, b"1 2\n3 4\n").unwrap();
        let content = Content::read(&path).unwrap();
        assert_eq!(content.format(), Format::TextMatrix);
        let name = Path::new("a");
        assert_eq!(content.identity(name), identity(name, &path).unwrap());
    }
}
