//! The compiled half of the Python package `moiregauge`: the pipeline, with JSON and arrays of numpy at its edge.
//!
//! No physics, no statistics, no caveats, and no words on results: those are the libraries'. What users call is in
//! `python/moiregauge`.

mod analysis;
mod arrays;
mod asks;
mod errors;
mod maps;
mod options;
mod program;
mod samples;
mod scans;
mod words;
mod work;

use pyo3::prelude::*;

/// The compiled half of moiregauge. Use the package.
#[pymodule(gil_used = false)]
mod _core {
    #[pymodule_export]
    use crate::analysis::Analysis;
    #[pymodule_export]
    use crate::asks::{calibrate, convert, inspect, moire, plan, simulate, validate};
    #[pymodule_export]
    use crate::maps::{Map, map};
    #[pymodule_export]
    use crate::program::{calculated_by, program};
    #[pymodule_export]
    use crate::samples::ManySamples;
    #[pymodule_export]
    use crate::scans::read;
    #[pymodule_export]
    use crate::words::{plus_minus, tables};

    use super::{Bound, PyModule, PyModuleMethods as _, PyResult};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("SETTINGS", crate::options::defaults()?)
    }
}
