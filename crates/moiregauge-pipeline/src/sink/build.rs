//! The program that is running, by its content.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::manifest::hash_file;

static CODE: OnceLock<PathBuf> = OnceLock::new();

/// Says which file holds the code that calculates, where that is not the executable: a library inside an interpreter.
/// The first call counts, before anything is kept.
pub fn calculated_by(file: &Path) {
    // A second call says the same.
    let _ = CODE.set(file.to_owned());
}

/// A hash of the program that is running, or of the file that [`calculated_by`] names: what it calculates can depend on
/// nothing else but its inputs and settings.
///
/// `None` where the file cannot be read.
pub fn build() -> Option<&'static str> {
    static BUILD: OnceLock<Option<String>> = OnceLock::new();
    let hash = || {
        let program = match CODE.get() {
            Some(file) => file.clone(),
            None => std::env::current_exe().ok()?,
        };
        Some(hash_file(&program).ok()?.1)
    };
    BUILD.get_or_init(hash).as_deref()
}
