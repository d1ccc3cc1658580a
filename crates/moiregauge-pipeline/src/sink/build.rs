//! The program that is running, by its content.

use std::sync::OnceLock;

use super::manifest::hash_file;

/// A hash of the program that is running: what it calculates can depend on nothing else but its inputs and settings.
///
/// `None` where the executable cannot be read. A front end that is a library inside another program (an interpreter)
/// has to add a hash of its own to what it keeps.
pub fn build() -> Option<&'static str> {
    static BUILD: OnceLock<Option<String>> = OnceLock::new();
    let hash = || {
        let program = std::env::current_exe().ok()?;
        Some(hash_file(&program).ok()?.1)
    };
    BUILD.get_or_init(hash).as_deref()
}
