//! Requests of the pipeline: JSON in, JSON out.

use std::path::{Path, PathBuf};

use moiregauge::simulate::Simulation;
use moiregauge_pipeline::calibrate::{
    CalibrateRequest, NotCalibrated, WhyNotCalibrated, known_lattice,
};
use moiregauge_pipeline::campaign::no_advice;
use moiregauge_pipeline::convert::{ConvertRequest, ConvertSink, ConvertTo, convert_files};
use moiregauge_pipeline::moire::{Given, MoireQuestion};
use moiregauge_pipeline::plan::{PlanError, PlanRequest};
use moiregauge_pipeline::simulate::{SimulationError, paper_sets, simulate_sets};
use moiregauge_pipeline::validate::{ValidateError, ValidateRequest};
use moiregauge_pipeline::{Known, find, names};
use moiregauge_report::FailedInput;
use pyo3::prelude::*;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::errors::{nothing, stopped, unreadable, unwritten, wrong};
use crate::options::{conditions, settings, settings_on, told};
use crate::work::work;

/// A progress callable, if any.
type Tell = Option<Py<PyAny>>;

/// What is told of every file that paths mean, as a list.
#[pyfunction]
pub(crate) fn inspect(py: Python<'_>, paths: Vec<PathBuf>, known: &str) -> PyResult<String> {
    let known = told(known)?;
    work(py, None, None, |_| {
        let (files, failed) = find(&paths).frames();
        if files.is_empty() {
            return Err(nothing("no scans", &failed, false));
        }
        let known = Known::new(&known, &files);
        let one = |file: &PathBuf| moiregauge_pipeline::inspect(file, &known, &[], no_advice);
        let all: Vec<_> = files.iter().map(one).collect();
        serde_json::to_string(&all).map_err(wrong)
    })
}

/// The answer to a question about a moiré, and a drawing of its cell as SVG.
#[pyfunction]
pub(crate) fn moire(
    py: Python<'_>,
    given: &str,
    options: &str,
    band_degeneracy: f64,
) -> PyResult<(String, String)> {
    let given: Given = serde_json::from_str(given).map_err(wrong)?;
    let plain = MoireQuestion::new(given);
    let question = MoireQuestion {
        settings: settings_on(plain.settings.clone(), options)?,
        band_degeneracy,
        ..plain
    };
    py.detach(|| {
        let found =
            moiregauge_pipeline::moire::moire(&question).map_err(|e| wrong(names::in_full(&e)))?;
        let document = serde_json::to_string(&found.document).map_err(wrong)?;
        Ok((document, found.figure().svg))
    })
}

/// Plans that meet wishes, and what they will tell.
#[pyfunction]
pub(crate) fn plan(
    py: Python<'_>,
    request: &str,
    options: &str,
    threads: Option<usize>,
    progress: Tell,
) -> PyResult<String> {
    let (request, given): (PlanRequest, _) = with_conditions(request)?;
    let instrument = given.unwrap_or_else(|| serde_json::json!({}));
    let request = PlanRequest {
        conditions: conditions(&Simulation::default(), instrument)?,
        settings: settings(options)?,
        ..request
    };
    work(py, threads, progress.as_ref(), |job| {
        let found =
            moiregauge_pipeline::plan::plan(&request, job).map_err(|error| match error {
                PlanError::Cancelled(_) => stopped(),
                other => wrong(names::in_full(&other)),
            })?;
        serde_json::to_string(&found).map_err(wrong)
    })
}

/// A request, and the conditions in it, which may be given in part.
fn with_conditions<T: DeserializeOwned>(request: &str) -> PyResult<(T, Option<Value>)> {
    let mut request: Value = serde_json::from_str(request).map_err(wrong)?;
    let conditions = request
        .as_object_mut()
        .and_then(|all| all.remove("conditions"));
    Ok((serde_json::from_value(request).map_err(wrong)?, conditions))
}

/// Writes simulated sets, or those of the paper with this seed; returns their folders.
#[pyfunction]
pub(crate) fn simulate(
    py: Python<'_>,
    sets: &str,
    paper: Option<u64>,
    out: PathBuf,
    force: bool,
    threads: Option<usize>,
    progress: Tell,
) -> PyResult<Vec<PathBuf>> {
    let given: Vec<Value> = serde_json::from_str(sets).map_err(wrong)?;
    let sets = match paper {
        Some(seed) => paper_sets(seed),
        None => given
            .into_iter()
            .map(|set| conditions(&Simulation::default(), set))
            .collect::<PyResult<_>>()?,
    };
    work(py, threads, progress.as_ref(), |job| {
        simulate_sets(&sets, &out, force, job).map_err(|error| match error {
            SimulationError::Cancelled(_) => stopped(),
            SimulationError::Sink(error) => unwritten(&error),
            SimulationError::List { .. } | SimulationError::InTheWay(_) => unwritten(&error),
            other => wrong(names::in_full(&other)),
        })
    })
}

/// Converts scans into a file or a folder; returns the files, and what failed.
#[pyfunction]
pub(crate) fn convert(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    known: &str,
    request: &str,
    to: (PathBuf, bool),
    force: bool,
    threads: Option<usize>,
    progress: Tell,
) -> PyResult<(Vec<PathBuf>, Vec<(String, String)>)> {
    let known = told(known)?;
    let request: ConvertRequest = serde_json::from_str(request).map_err(wrong)?;
    let (to, is_file) = to;
    let to = if is_file {
        ConvertTo::File(to)
    } else {
        ConvertTo::Folder(to)
    };
    work(py, threads, progress.as_ref(), |job| {
        let (files, failed) = find(&paths).frames();
        if files.is_empty() {
            return Err(nothing("no scans", &failed, false));
        }
        if is_file && files.len() > 1 {
            return Err(wrong(format!(
                "one file cannot hold {} scans: give a folder",
                files.len()
            )));
        }
        let known = Known::new(&known, &files);
        let sink = ConvertSink::open(&to, request.format, force, &files);
        let sink = sink.map_err(|e| unwritten(&e))?;
        let all = convert_files(&files, &known, &request, &sink, job).map_err(|_| stopped())?;
        let failed = failed.into_iter().map(|f| (f.file, f.error));
        let (mut written, mut failed) = (Vec::new(), failed.collect::<Vec<_>>());
        for (file, result) in files.iter().zip(all) {
            match result {
                Ok(files) => written.extend(files),
                Err(error) => failed.push((names::in_words(file), names::in_full(&error))),
            }
        }
        if written.is_empty() {
            let all: Vec<_> = failed
                .into_iter()
                .map(|(file, error)| FailedInput { file, error })
                .collect();
            return Err(nothing("nothing could be converted", &all, false));
        }
        Ok((written, failed))
    })
}

/// Calibrates a scanner: the document, its file as TOML, and what failed.
#[pyfunction]
pub(crate) fn calibrate(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    known: &str,
    lattice: &str,
    drift_sigma_nm_per_min: f64,
    options: &str,
    threads: Option<usize>,
    progress: Tell,
) -> PyResult<(String, String, Vec<(String, String)>)> {
    let known = told(known)?;
    let lattice = known_lattice(lattice, &[]).ok_or_else(|| {
        wrong(format!(
            "unknown lattice {lattice:?}: expected a surface or layer, as graphite"
        ))
    })?;
    let request = CalibrateRequest {
        lattice,
        drift_sigma_nm_per_min,
        settings: settings(options)?,
    };
    work(py, threads, progress.as_ref(), |job| {
        let (files, failed) = find(&paths).frames();
        if files.is_empty() {
            return Err(nothing("no scans", &failed, false));
        }
        let known = Known::new(&known, &files);
        let (found, lost) = moiregauge_pipeline::calibrate(&files, &known, &request, job)
            .map_err(not_calibrated)?;
        let document = found.document().map_err(|e| wrong(names::in_full(&e)))?;
        let toml = document
            .to_toml("Calibration of a scanner by moiregauge.")
            .map_err(wrong)?;
        let failed = failed.into_iter().map(|f| (f.file, f.error));
        let lost = lost
            .iter()
            .map(|f| (words(&f.file), names::in_full(&f.error)));
        Ok((
            serde_json::to_string(&document).map_err(wrong)?,
            toml,
            failed.chain(lost).collect(),
        ))
    })
}

fn words(file: &Path) -> String {
    names::in_words(file)
}

fn not_calibrated(error: NotCalibrated) -> PyErr {
    let failed = error.failed.iter().map(|f| FailedInput {
        file: words(&f.file),
        error: names::in_full(&f.error),
    });
    let failed: Vec<_> = failed.collect();
    match &error.why {
        WhyNotCalibrated::Cancelled(_) => stopped(),
        WhyNotCalibrated::Settings(_) | WhyNotCalibrated::NoArea => {
            wrong(names::in_full(&error.why))
        }
        WhyNotCalibrated::NothingRead(_) => match failed.as_slice() {
            [one] => unreadable(&one.file, &one.error),
            _ => nothing(&error.why.to_string(), &failed, false),
        },
        _ => nothing(&error.why.to_string(), &failed, true),
    }
}

/// Many simulated sets, analysed and compared with what was put in.
#[pyfunction]
pub(crate) fn validate(
    py: Python<'_>,
    request: &str,
    threads: Option<usize>,
    progress: Tell,
) -> PyResult<String> {
    let (request, given): (ValidateRequest, _) = with_conditions(request)?;
    let request = match given {
        Some(given) => ValidateRequest {
            conditions: conditions(&request.conditions, given)?,
            ..request
        },
        None => request,
    };
    work(py, threads, progress.as_ref(), |job| {
        let found =
            moiregauge_pipeline::validate::validate(&request, job).map_err(
                |error| match error {
                    ValidateError::Cancelled(_) => stopped(),
                    other => wrong(names::in_full(&other)),
                },
            )?;
        serde_json::to_string(&found).map_err(wrong)
    })
}
