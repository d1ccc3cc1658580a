//! What was typed, for results that record it.

use std::ffi::OsString;
use std::sync::OnceLock;

static TYPED: OnceLock<Vec<OsString>> = OnceLock::new();

/// Keeps it, once in a process.
pub(crate) fn keep(typed: Vec<OsString>) -> &'static [OsString] {
    TYPED.get_or_init(|| typed)
}

/// What was typed, the name of the program first.
pub(crate) fn typed() -> impl Iterator<Item = OsString> {
    TYPED.get().into_iter().flatten().cloned()
}
