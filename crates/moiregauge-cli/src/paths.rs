//! The files that are meant, and a line on what is left alone beside them.

use std::path::PathBuf;

use moiregauge_pipeline::{Found, find};
use moiregauge_report::FailedInput;

/// The files meant by names of files, folders and wildcards, in order; what cannot be used with the reason.
pub(crate) fn expand(paths: &[PathBuf], loud: bool) -> Vec<Result<PathBuf, FailedInput>> {
    found(paths, loud).files
}

/// The same for measuring: what can be read apart from what cannot, and each frame once.
pub(crate) fn inputs(paths: &[PathBuf], loud: bool) -> (Vec<PathBuf>, Vec<FailedInput>) {
    found(paths, loud).frames()
}

fn found(paths: &[PathBuf], loud: bool) -> Found {
    let found = find(paths);
    if loud && found.left_alone.count > 0 {
        eprintln!("{}", found.left_alone);
    }
    found
}
