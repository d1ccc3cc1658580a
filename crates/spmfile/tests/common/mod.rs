//! Where the test data are, and what to do where they are not.

use std::path::{Path, PathBuf};

/// The folder of shared test data, or `None` with a note where it is absent.
///
/// # Panics
/// If it is absent although `MOIREGAUGE_REQUIRE_TESTDATA=1` asks for it.
pub(crate) fn testdata(test: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("MOIREGAUGE_TESTDATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    if folder.is_dir() {
        return Some(folder);
    }
    let required = std::env::var_os("MOIREGAUGE_REQUIRE_TESTDATA").is_some_and(|v| v == "1");
    assert!(!required, "{test}: no test data in {}", folder.display());
    println!("{test} DID NOT RUN: no test data in {}", folder.display());
    None
}

/// The bytes of a file.
pub(crate) fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}
