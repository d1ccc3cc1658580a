//! Errors of the library → exceptions of the package.

use moiregauge_pipeline::InputError;
use moiregauge_report::FailedInput;
use pyo3::exceptions::{PyKeyboardInterrupt, PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;

/// `moiregauge.ReadError` or `.MeasureError`, with the file it is about and all files that failed.
fn of_class(class: &str, message: &str, failed: &[FailedInput]) -> PyErr {
    Python::attach(|py| {
        let made = || -> PyResult<PyErr> {
            let class = py.import("moiregauge._errors")?.getattr(class)?;
            let all: Vec<(&str, &str)> = failed
                .iter()
                .map(|f| (f.file.as_str(), f.error.as_str()))
                .collect();
            Ok(PyErr::from_value(class.call1((message, all))?))
        };
        made().unwrap_or_else(|error| error)
    })
}

/// A file cannot be read.
pub(crate) fn unreadable(file: &str, error: &str) -> PyErr {
    let failed = FailedInput {
        file: file.to_owned(),
        error: error.to_owned(),
    };
    of_class("ReadError", &format!("{file}: {error}"), &[failed])
}

/// None of the files can be read, or none shows a lattice.
pub(crate) fn nothing(words: &str, failed: &[FailedInput], readable: bool) -> PyErr {
    let class = if readable {
        "MeasureError"
    } else {
        "ReadError"
    };
    let all: Vec<String> = failed
        .iter()
        .map(|f| format!("{}: {}", f.file, f.error))
        .collect();
    let message = match all.as_slice() {
        [one] => one.clone(),
        _ => format!("{words}\n{}", all.join("\n")),
    };
    of_class(class, message.trim_end(), failed)
}

/// What one file gives.
pub(crate) fn of_input(file: &str, error: &InputError) -> PyErr {
    let words = moiregauge_pipeline::names::in_full(error);
    if matches!(error, InputError::Measure(_)) {
        let failed = FailedInput {
            file: file.to_owned(),
            error: words,
        };
        return nothing("", &[failed], true);
    }
    unreadable(file, &words)
}

/// Arguments that make no sense.
pub(crate) fn wrong(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Results that cannot be written.
pub(crate) fn unwritten(error: &dyn std::error::Error) -> PyErr {
    PyOSError::new_err(moiregauge_pipeline::names::in_full(error))
}

/// What was stopped.
pub(crate) fn stopped() -> PyErr {
    PyKeyboardInterrupt::new_err("stopped before the end")
}

/// A fault of ours.
pub(crate) fn fault(words: &str) -> PyErr {
    PyRuntimeError::new_err(format!("a fault of moiregauge, please report it: {words}"))
}
