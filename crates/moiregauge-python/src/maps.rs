//! Maps of twist and strain.

use std::path::PathBuf;

use moiregauge_pipeline::maps::{MAP_FILES, MapFound, MapRequest, Shown};
use moiregauge_pipeline::sink::{FolderSink, MemorySink, Sink, Target};
use moiregauge_report::{Choice, ColorMap, map_scan};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::analysis::Analysis;
use crate::arrays;
use crate::errors::{unwritten, wrong};
use crate::work::work;

/// A map as it was made.
#[pyclass(frozen, module = "moiregauge._core")]
pub(crate) struct Map {
    found: MapFound,
    request: MapRequest,
    inputs: Vec<PathBuf>,
}

/// Maps the scans of an analysis: the map, its document, and every quantity with its unit and values.
#[pyfunction]
#[pyo3(signature = (analysis, asked, threads, progress))]
pub(crate) fn map<'py>(
    py: Python<'py>,
    analysis: &Analysis,
    asked: &str,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Map, String, Bound<'py, PyDict>)> {
    let request: MapRequest = serde_json::from_str(asked).map_err(wrong)?;
    let (map, document, planes) = work(py, threads, progress.as_ref(), |job| {
        let found = analysis.map(&request, job)?;
        let map = Map {
            found,
            request,
            inputs: analysis.inputs().to_vec(),
        };
        let nothing_drawn = Choice {
            figures: false,
            png: false,
            html: false,
            colormap: ColorMap::default(),
        };
        let document = map.write(nothing_drawn, &MemorySink::new())?;
        let planes = match &map.found.shown {
            Shown::Lattice(found) => map_scan(&found.map, found.registry.as_ref()).channels,
            Shown::Stripes(found) => moiregauge_report::stripe_scan(&found.stripes).channels,
        };
        Ok((map, document, planes))
    })?;
    let all = PyDict::new(py);
    for plane in planes {
        let shape = [plane.rows, plane.columns];
        let values = arrays::values(py, plane.values(), shape)?;
        all.set_item(&plane.name, (&plane.unit, values))?;
    }
    Ok((map, document, all))
}

#[pymethods]
impl Map {
    /// Writes what the program writes.
    #[pyo3(signature = (folder, force, choice, threads, progress))]
    fn report(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        force: bool,
        choice: &str,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<()> {
        let choice: Choice = serde_json::from_str(choice).map_err(wrong)?;
        work(py, threads, progress.as_ref(), |_| {
            let sink = FolderSink::open(&Target {
                folder: &folder,
                kind: "map",
                names: &MAP_FILES.map(str::to_owned),
                inputs: &self.inputs,
                force,
            });
            let sink = sink.map_err(|e| unwritten(&e))?;
            self.write(choice, &sink)?;
            sink.commit().map_err(|e| unwritten(&e))
        })
    }
}

impl Map {
    /// Asks the questions and writes everything; returns the document.
    fn write(&self, choice: Choice, sink: &dyn Sink) -> PyResult<String> {
        let mut found = self.found.clone();
        if let Some(run) = &mut found.provenance.run {
            run.report = choice;
        }
        let results = found.write(&self.request, choice, sink);
        let results = results.map_err(|e| wrong(moiregauge_pipeline::names::in_full(&e)))?;
        serde_json::to_string(&results).map_err(wrong)
    }
}
