//! Files known by their content.

use std::fmt::Write as _;
use std::io::Read as _;
use std::path::Path;

use moiregauge_report::InputFile;
use sha2::{Digest as _, Sha256};

use crate::names::in_words;
use crate::reading::{FileError, open};

/// The digits of a hash.
pub fn hexadecimal(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        // Writing into a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// The file at `place` by its content, read piece by piece; `name` is what the user calls it.
///
/// # Errors
/// The file cannot be read, or is not a regular file.
pub fn identity(name: &Path, place: &Path) -> Result<InputFile, FileError> {
    let mut file = open(place)?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0; 1 << 20];
    let mut bytes = 0;
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            break;
        }
        hash.update(&buffer[..count]);
        bytes += count as u64;
    }
    Ok(InputFile {
        file: in_words(name),
        sha256: hexadecimal(&hash.finalize()),
        bytes,
    })
}
