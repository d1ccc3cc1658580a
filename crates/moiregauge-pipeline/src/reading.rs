//! Bytes of files: regular ones only, and no more than fit in memory.
//!
//! A device never ends and a pipe without a writer never begins; both are refused before they are opened.

use std::fs::{File, Metadata};
use std::io::{self, Read as _};
use std::path::Path;

use crate::memory;

/// No file of scans is larger; what is must be mapped line by line ([`open`]).
const LARGEST: u64 = 16 << 30;
/// Settings and calibrations are much smaller.
const LARGEST_TEXT: u64 = 16 << 20;

/// Why a file is not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The system says no.
    #[error("{0}")]
    System(#[from] io::Error),
    /// A device, a pipe, a folder.
    #[error("expected a file, found {0}")]
    NotAFile(&'static str),
    /// Larger than is read at once.
    #[error("the file has {}, but at most {} are read at once", memory::in_words(*found), memory::in_words(*limit))]
    TooLarge {
        /// Its bytes.
        found: u64,
        /// What would be read.
        limit: u64,
    },
    /// Larger than the memory that is left.
    #[error("the file has {}, but only {} of memory are free", memory::in_words(*found), memory::in_words(*available))]
    NoMemory {
        /// Its bytes.
        found: u64,
        /// Bytes of memory.
        available: u64,
    },
    /// Text in another encoding.
    #[error("expected text in UTF-8")]
    NotText,
}

impl FileError {
    /// Whether there is no such file.
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::System(error) if error.kind() == io::ErrorKind::NotFound)
    }
}

/// Opens a regular file, or a link to one, to read it piece by piece.
///
/// # Errors
/// - There is no such file, or it may not be read.
/// - It is a folder, a device, a pipe or a socket.
pub fn open(path: &Path) -> Result<File, FileError> {
    regular(&std::fs::metadata(path)?)?;
    Ok(File::open(path)?)
}

/// The bytes of a regular file, or of a link to one.
///
/// # Errors
/// - As [`open`].
/// - It is larger than 16 GiB, or than the memory that can be had.
pub fn read(path: &Path) -> Result<Vec<u8>, FileError> {
    let file = open(path)?;
    let found = file.metadata()?.len();
    if found > LARGEST {
        return Err(FileError::TooLarge {
            found,
            limit: LARGEST,
        });
    }
    let available = memory::available().unwrap_or(LARGEST);
    if found > available {
        return Err(FileError::NoMemory { found, available });
    }
    whole(file, found, LARGEST)
}

/// The text of a file of settings.
///
/// # Errors
/// - As [`open`].
/// - It is larger than 16 MiB, or not UTF-8.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    let file = open(path)?;
    let found = file.metadata()?.len();
    let bytes = whole(file, found, LARGEST_TEXT)?;
    String::from_utf8(bytes).map_err(|_| FileError::NotText)
}

/// The first bytes of a file, up to a number.
pub(crate) fn head(path: &Path, length: u64) -> Result<Vec<u8>, FileError> {
    let mut head = Vec::new();
    open(path)?.take(length).read_to_end(&mut head)?;
    Ok(head)
}

/// All bytes. Some systems have files that say they are empty and never end.
fn whole(file: File, expected: u64, limit: u64) -> Result<Vec<u8>, FileError> {
    let refused = |found| Err(FileError::TooLarge { found, limit });
    if expected > limit {
        return refused(expected);
    }
    let mut bytes = Vec::new();
    bytes
        .try_reserve_exact(usize::try_from(expected).unwrap_or(usize::MAX))
        .map_err(|_| FileError::NoMemory {
            found: expected,
            available: memory::available().unwrap_or(0),
        })?;
    file.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return refused(bytes.len() as u64);
    }
    Ok(bytes)
}

fn regular(found: &Metadata) -> Result<(), FileError> {
    if found.is_file() {
        return Ok(());
    }
    Err(FileError::NotAFile(kind(found)))
}

/// What it is, in words.
pub(crate) fn kind(found: &Metadata) -> &'static str {
    if found.is_dir() {
        return "a folder";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        let kind = found.file_type();
        if kind.is_fifo() {
            return "a pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
        if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    "something else"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_their_bytes_and_folders_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, b"123").unwrap();
        assert_eq!(read(&path).unwrap(), b"123");
        assert_eq!(read_text(&path).unwrap(), "123");
        assert_eq!(head(&path, 2).unwrap(), b"12");
        let error = read(folder.path()).unwrap_err();
        assert_eq!(error.to_string(), "expected a file, found a folder");
        assert!(read(&folder.path().join("b")).unwrap_err().is_missing());
        std::fs::write(&path, b"\xff").unwrap();
        assert!(matches!(read_text(&path), Err(FileError::NotText)));
    }

    /// A sparse file: long, and nothing on the disk.
    #[test]
    fn long_files_are_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("long");
        File::create(&path).unwrap().set_len(LARGEST + 1).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains("at most 17.2 GB"), "{error}");
        assert!(read_text(&path).is_err());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_are_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("scan.000");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        for path in [Path::new("/dev/zero"), &link] {
            let error = read(path).unwrap_err();
            assert_eq!(error.to_string(), "expected a file, found a device");
        }
    }
}
