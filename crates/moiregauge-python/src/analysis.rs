//! Scans that are analysed together, and what came out.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use moiregauge::campaign::picture;
use moiregauge_pipeline::campaign::{AnalyseError, Campaign, Kept, Outcome, no_advice, outcomes};
use moiregauge_pipeline::maps::{MapFound, MapRequest, NotMapped};
use moiregauge_pipeline::sink::{FolderSink, Forget, Target};
use moiregauge_pipeline::{
    Job, Known, Opened, Places, ScanInMemory, check_sets, find, read_again, record_files,
};
use moiregauge_report::results::{AtomicImages, NamedSet, Results, Run};
use moiregauge_report::screen::summary;
use moiregauge_report::{Choice, ColorMap, FailedInput};
use numpy::PyArray2;
use pyo3::prelude::*;
use serde::Deserialize;

use crate::arrays;
use crate::errors::{nothing, of_input, stopped, unreadable, unwritten, wrong};
use crate::options::{settings, told};
use crate::work::work;

/// What is asked beside settings.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Beside {
    arguments: Vec<String>,
    sets: Vec<NamedSet>,
    atomic: Option<AtomicImages>,
    survey_image: Option<String>,
}

/// Scans in memory: the name, what is known of it, its arrays or the bytes of a file.
#[derive(FromPyObject)]
enum InPython<'py> {
    Bytes(Vec<u8>),
    Scan((String, Vec<Bound<'py, PyAny>>)),
}

/// A run, what it measured and what came out. Settings can be changed; what does not depend on them is kept.
#[pyclass(frozen, module = "moiregauge._core")]
pub(crate) struct Analysis {
    run: Run,
    inputs: Vec<PathBuf>,
    places: Places,
    campaign: Mutex<Campaign>,
    outcomes: Mutex<Vec<Outcome>>,
}

#[pymethods]
impl Analysis {
    /// Takes note of what is to be done; nothing is measured yet.
    #[new]
    #[pyo3(signature = (paths, options, known, beside, held))]
    fn new(
        py: Python<'_>,
        paths: Vec<PathBuf>,
        options: &str,
        known: &str,
        beside: &str,
        held: Vec<(PathBuf, InPython<'_>)>,
    ) -> PyResult<Self> {
        let (mut inputs, left_out) = find(&paths).frames();
        let mut places = Places::new();
        for (name, given) in held {
            inputs.push(name.clone());
            match given {
                InPython::Bytes(bytes) => places.hold(name, bytes),
                InPython::Scan((about, arrays)) => {
                    let scan = arrays::scan(&about, &arrays)?;
                    places.hold_scan(name, py.detach(|| ScanInMemory::new(scan)));
                }
            }
        }
        if inputs.is_empty() {
            return Err(nothing("no scans", &left_out, false));
        }
        let beside: Beside = serde_json::from_str(beside).map_err(wrong)?;
        check_sets(&beside.sets, &inputs).map_err(wrong)?;
        let run = Run {
            command: "analyze".to_owned(),
            arguments: beside.arguments,
            settings: settings(options)?,
            known: told(known)?,
            sets: beside.sets,
            atomic: beside.atomic,
            survey_image: beside.survey_image,
            report: Choice {
                figures: false,
                png: false,
                html: false,
                colormap: ColorMap::default(),
            },
            export: Vec::new(),
            parquet: false,
            inputs: Vec::new(),
            other_files: Vec::new(),
            left_out,
        };
        let campaign = Campaign::of_run(&run, &inputs, &places, no_advice).map_err(wrong)?;
        Ok(Self {
            run,
            inputs,
            places,
            campaign: Mutex::new(campaign),
            outcomes: Mutex::default(),
        })
    }

    /// Measures what is not measured yet and analyses all: the document of each moiré and its summary for a
    /// screen, the largest cell first.
    #[pyo3(signature = (threads, progress))]
    fn analyse(
        &self,
        py: Python<'_>,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Vec<(String, String)>> {
        work(py, threads, progress.as_ref(), |job| {
            let found = self.outcomes(&self.run, job)?;
            let documents = found.iter().map(document).collect::<PyResult<_>>();
            *lock(&self.outcomes) = found;
            documents
        })
    }

    /// What was measured, as a document.
    fn kept(&self, py: Python<'_>) -> PyResult<String> {
        let kept = || serde_json::to_string(lock(&self.campaign).kept());
        py.detach(kept).map_err(wrong)
    }

    /// Takes what another run measured.
    fn take(&self, py: Python<'_>, kept: &str) -> PyResult<()> {
        py.detach(|| {
            let kept: Kept = serde_json::from_str(kept).map_err(wrong)?;
            lock(&self.campaign).take(kept);
            Ok(())
        })
    }

    /// Writes what the program writes; returns how many moirés there are.
    #[pyo3(signature = (folder, force, choice, parquet, threads, progress))]
    fn report(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        force: bool,
        choice: &str,
        parquet: bool,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<usize> {
        let choice: Choice = serde_json::from_str(choice).map_err(wrong)?;
        let run = Run {
            report: choice,
            parquet,
            ..self.run.clone()
        };
        work(py, threads, progress.as_ref(), |job| {
            self.write(&run, &folder, force, job)
        })
    }

    /// An image as it was measured, background removed: values, the way to the next pixel in x and y and from line to
    /// line (columns of a matrix), the place of the first, its unit.
    fn image<'py>(
        &self,
        py: Python<'py>,
        file: &str,
    ) -> PyResult<(
        Bound<'py, PyArray2<f64>>,
        [[f64; 2]; 2],
        [f64; 2],
        String,
        String,
    )> {
        let found = work(py, Some(1), None, |_| {
            let first = lock(&self.outcomes);
            let settings = first
                .first()
                .map_or(&self.run.settings, |o| &o.analysis.settings);
            let scan = read_again(&self.inputs, file, settings, &self.known())
                .map_err(|error| of_input(file, &error))?;
            picture(file, &scan, settings)
                .ok_or_else(|| unreadable(file, "it has no image with a size"))
        })?;
        let shape = [found.image.rows, found.image.columns];
        let matrix = found.pixel_to_nm;
        let values = arrays::values(py, found.image.values, shape)?;
        let rows = [
            [matrix[(0, 0)], matrix[(0, 1)]],
            [matrix[(1, 0)], matrix[(1, 1)]],
        ];
        Ok((values, rows, found.origin.into(), found.channel, found.unit))
    }
}

impl Analysis {
    pub(crate) fn known(&self) -> Known {
        Known::new(&self.run.known, &self.inputs).at(&self.places)
    }

    /// Maps the scans; what was measured is kept.
    pub(crate) fn map(&self, request: &MapRequest, job: &Job) -> PyResult<MapFound> {
        let mut campaign = lock(&self.campaign).clone();
        let found = moiregauge_pipeline::map(&mut campaign, request, &Forget, job);
        lock(&self.campaign).take(campaign.kept().clone());
        let mut found = found.map_err(|error| self.not_mapped(error))?;
        let mut run = Run {
            command: "map".to_owned(),
            ..self.run.clone()
        };
        record_files(
            &mut run,
            &self.known(),
            &self.inputs,
            &found.provenance.inputs,
        );
        found.provenance.run = Some(run);
        Ok(found)
    }

    /// The files that are never written over.
    pub(crate) fn inputs(&self) -> &[PathBuf] {
        &self.inputs
    }

    fn not_mapped(&self, error: NotMapped) -> PyErr {
        let words = moiregauge_pipeline::names::in_full(&error);
        match error {
            NotMapped::Cancelled(_) => stopped(),
            NotMapped::Analyse(why) | NotMapped::NoLattice { why, .. } => self.refused(&why),
            NotMapped::Nothing { failed } => nothing(&words, &failed, true),
            NotMapped::NothingLeft(_) => nothing(&words, &[], true),
            NotMapped::Band { file, .. } => unreadable(&file.display().to_string(), &words),
            _ => wrong(words),
        }
    }

    fn outcomes(&self, run: &Run, job: &Job) -> PyResult<Vec<Outcome>> {
        let drawn = run.report.figures || run.report.png || run.report.html;
        let mut campaign = lock(&self.campaign).clone().illustrated(drawn);
        let found = outcomes(run, &self.places, &mut campaign, job, |measured| {
            let mut recorded = run.clone();
            record_files(&mut recorded, &self.known(), &self.inputs, measured);
            recorded
        });
        // Kept, however it ended.
        lock(&self.campaign).take(campaign.kept().clone());
        found.map_err(|error| self.refused(&error))
    }

    fn refused(&self, error: &AnalyseError) -> PyErr {
        let words = moiregauge_pipeline::names::in_full(error);
        match error {
            AnalyseError::Cancelled(_) => stopped(),
            AnalyseError::Nothing { failed } | AnalyseError::NoCommonRegion { failed } => {
                let known = self.known();
                let readable = |path: &PathBuf| {
                    let opened = Opened::new(path, &known);
                    opened.is_ok_and(|opened| opened.reading(&self.run.settings).is_ok())
                };
                nothing(&words, failed, self.inputs.iter().any(readable))
            }
            AnalyseError::Beside { file, source, .. } => of_input(file, source),
            AnalyseError::Settings(_) => wrong(words),
            _ => nothing(
                &words,
                &[FailedInput {
                    file: self
                        .inputs
                        .first()
                        .map_or_else(String::new, |p| p.display().to_string()),
                    error: words.clone(),
                }],
                true,
            ),
        }
    }

    fn write(&self, run: &Run, folder: &Path, force: bool, job: &Job) -> PyResult<usize> {
        let sink = FolderSink::open(&Target {
            folder,
            kind: "analyze",
            names: &[
                "results.json".to_owned(),
                "report.html".to_owned(),
                "figures/".to_owned(),
            ],
            inputs: &self.inputs,
            force,
        })
        .map_err(|e| unwritten(&e))?;
        let found = self.outcomes(run, job)?;
        for (number, outcome) in found.iter().enumerate() {
            let within = match found.len() {
                1 => String::new(),
                _ => format!("moire-{}/", number + 1),
            };
            let (analysis, provenance) = (&outcome.analysis, &outcome.provenance);
            let report = moiregauge_report::write_report(analysis, provenance, &run.report);
            let mut files = report.map_err(|e| unwritten(&e))?;
            if run.parquet {
                let tables = moiregauge_report::parquet_tables(analysis, provenance);
                files.extend(tables.map_err(|e| unwritten(&e))?);
            }
            for (name, bytes) in files {
                sink.write(&format!("{within}{name}"), &bytes)
                    .map_err(|e| unwritten(&e))?;
            }
        }
        sink.commit().map_err(|e| unwritten(&e))?;
        Ok(found.len())
    }
}

fn document(outcome: &Outcome) -> PyResult<(String, String)> {
    let results = Results::new(&outcome.analysis, &outcome.provenance);
    let document = serde_json::to_string(&results).map_err(wrong)?;
    Ok((document, summary(&outcome.analysis, |_| None)))
}

fn lock<T>(of: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}
