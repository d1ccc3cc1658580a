//! The program `moiregauge`, as the wheel brings it along.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use pyo3::prelude::*;

/// Runs the program with these arguments, its name first; returns its exit code. Ctrl-C is the program's.
#[pyfunction]
pub(crate) fn program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    let ended = py.detach(|| moiregauge_cli::program(arguments));
    let known = (0..=u8::MAX).find(|code| ExitCode::from(*code) == ended);
    known.unwrap_or(1)
}

/// Says which file calculates: this module, and not the interpreter.
#[pyfunction]
pub(crate) fn calculated_by(file: PathBuf) {
    moiregauge_pipeline::sink::calculated_by(&file);
}
