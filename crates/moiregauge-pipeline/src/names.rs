//! Paths in words that lead back to the path, for results that know files by text.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// The path as text: as it is where it is Unicode, otherwise with every byte that is not as `%` and two
/// hexadecimal digits. Unlike [`Path::display`], no two paths of one run become the same text by that.
pub fn in_words(path: &Path) -> String {
    if let Some(text) = path.to_str() {
        return text.to_owned();
    }
    let mut words = String::new();
    for chunk in path.as_os_str().as_encoded_bytes().utf8_chunks() {
        words.push_str(chunk.valid());
        for byte in chunk.invalid() {
            // Writing into a string cannot fail.
            let _ = write!(words, "%{byte:02X}");
        }
    }
    words
}

/// An error with all its causes, in one line.
pub fn in_full(error: &dyn std::error::Error) -> String {
    let mut words = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        // Writing into a string cannot fail.
        let _ = write!(words, ": {error}");
        cause = error.source();
    }
    words
}

/// The path among those of a run that has these words.
pub fn with_words<'a>(paths: &'a [PathBuf], words: &str) -> Option<&'a Path> {
    let found = paths.iter().find(|path| in_words(path) == words);
    found.map(PathBuf::as_path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_unicode_names_are_the_names() {
        for name in ["scan 1.spm", "Messung für Jürgen/a%FF.spm", ""] {
            assert_eq!(in_words(Path::new(name)), name);
        }
    }

    #[cfg(unix)]
    #[test]
    fn words_lead_back_to_names_that_are_not_unicode() {
        use std::os::unix::ffi::OsStrExt as _;
        let of = |bytes: &[u8]| PathBuf::from(std::ffi::OsStr::from_bytes(bytes));
        let all = [of(b"a\xff.spm"), of(b"a\xfe.spm"), of(b"plain.spm")];
        assert_eq!(in_words(&all[0]), "a%FF.spm");
        for path in &all {
            assert_eq!(with_words(&all, &in_words(path)), Some(path.as_path()));
        }
        assert_eq!(with_words(&all, "gone.spm"), None);
    }
}
