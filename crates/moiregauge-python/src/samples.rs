//! Many samples, one table.

use std::path::PathBuf;

use moiregauge_pipeline::samples::{
    Samples, SamplesDone, SamplesError, analyse_samples, analyse_some, give_up, samples_in,
    samples_of_table,
};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;

use crate::errors::stopped;
use crate::options::{settings, told};
use crate::work::work;

/// Samples that are found once: folders below `root`, or those of a table.
#[pyclass(frozen, module = "moiregauge._core")]
pub(crate) struct ManySamples {
    asked: Samples,
    out: PathBuf,
}

/// How samples ended: ok, doubtful, failed, and how many of them were done before.
type Counts = (usize, usize, usize, usize);

#[pymethods]
impl ManySamples {
    /// Looks for the samples.
    #[new]
    #[pyo3(signature = (root, table, options, known, out))]
    fn new(
        py: Python<'_>,
        root: PathBuf,
        table: Option<PathBuf>,
        options: &str,
        known: &str,
        out: PathBuf,
    ) -> PyResult<Self> {
        let (settings, known) = (settings(options)?, told(known)?);
        py.detach(|| {
            let found = match table {
                Some(table) => samples_of_table(&table, &root),
                None => samples_in(&root, &out),
            };
            let asked = Samples::new(&root, found.map_err(refused)?, settings, known);
            let asked = asked.map_err(|e| PyValueError::new_err(e.to_string()))?;
            Ok(Self { asked, out })
        })
    }

    fn __len__(&self) -> usize {
        self.asked.len()
    }

    /// Analyses those that are not done and writes the tables, as the program does.
    #[pyo3(signature = (threads, progress))]
    fn all(
        &self,
        py: Python<'_>,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Counts> {
        work(py, threads, progress.as_ref(), |job| {
            analyse_samples(&self.asked, &self.out, job)
                .map(counts)
                .map_err(refused)
        })
    }

    /// Analyses those at these places, and writes their parts only.
    #[pyo3(signature = (places, threads))]
    fn some(&self, py: Python<'_>, places: Vec<usize>, threads: Option<usize>) -> PyResult<Counts> {
        work(py, threads, None, |job| {
            analyse_some(&self.asked, &places, &self.out, job)
                .map(counts)
                .map_err(refused)
        })
    }

    /// The sample at this place: its name, a hash of all that its results depend on, and its files.
    fn sample(&self, py: Python<'_>, place: usize) -> PyResult<(String, String, Vec<PathBuf>)> {
        let found = py.detach(|| self.asked.sample(place));
        found.ok_or_else(|| PyValueError::new_err(format!("there is no sample {place}")))
    }

    /// Writes that the sample at this place failed, and why.
    fn give_up(&self, py: Python<'_>, place: usize, why: &str) -> PyResult<()> {
        py.detach(|| give_up(&self.asked, place, why, &self.out).map_err(refused))
    }
}

fn counts(done: SamplesDone) -> Counts {
    (done.ok, done.doubtful, done.failed, done.done_before)
}

fn refused(error: SamplesError) -> PyErr {
    match error {
        SamplesError::Cancelled(_) => stopped(),
        SamplesError::Table { .. }
        | SamplesError::TableLine { .. }
        | SamplesError::NoSamples(_) => {
            PyValueError::new_err(moiregauge_pipeline::names::in_full(&error))
        }
        _ => PyOSError::new_err(moiregauge_pipeline::names::in_full(&error)),
    }
}
