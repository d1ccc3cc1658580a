//! Keyword arguments → settings, and what is known of files. Names, defaults and checks are those of the settings.

use std::path::{Path, PathBuf};

use moiregauge::settings::Settings;
use moiregauge::simulate::Simulation;
use moiregauge_pipeline::Job;
use moiregauge_pipeline::calibrate::{read_calibration, ruler_from};
use moiregauge_pipeline::names::in_full;
use moiregauge_pipeline::read_settings;
use moiregauge_report::results::UserSpecified;
use pyo3::PyResult;
use serde_json::{Map, Value};

use crate::errors::wrong;

/// Options of an analysis as JSON, with files by name: `settings` and `scanner`.
///
/// # Errors
/// `ValueError` names the option.
pub(crate) fn settings(options: &str) -> PyResult<Settings> {
    settings_on(Settings::default(), options)
}

/// The same, on top of these settings.
///
/// # Errors
/// `ValueError` names the option.
pub(crate) fn settings_on(base: Settings, options: &str) -> PyResult<Settings> {
    let mut options: Map<String, Value> = serde_json::from_str(options).map_err(wrong)?;
    let base = match options.remove("settings") {
        Some(Value::String(file)) => {
            read_settings(Path::new(&file)).map_err(|e| wrong(in_full(&e)))?
        }
        Some(given) => {
            serde_json::from_value(given).map_err(|e| wrong(format!("settings: {e}")))?
        }
        None => base,
    };
    if let Some(Value::String(file)) = options.get("scanner") {
        let read = read_calibration(Path::new(file.as_str()));
        let read = read.map_err(|e| wrong(in_full(&e)))?;
        let read = serde_json::to_value(read).map_err(wrong)?;
        options.insert("scanner".to_owned(), read);
    }
    let atoms = options.remove("ruler_from");
    let mut settings = moiregauge_pipeline::settings_on(base, options).map_err(wrong)?;
    if let Some(atoms) = atoms {
        let files: Vec<PathBuf> = match atoms {
            Value::String(file) => vec![file.into()],
            several => {
                serde_json::from_value(several).map_err(|e| wrong(format!("ruler_from: {e}")))?
            }
        };
        let job = Job::quiet(None).map_err(wrong)?;
        let found = ruler_from(&files, &UserSpecified::default(), &settings, &job);
        settings.scanner = Some(found.map_err(|e| wrong(format!("ruler_from: {}", in_full(&e))))?);
    }
    Ok(settings)
}

/// Instrument and sample as JSON: any part of it, the rest as in `base`, materials by name.
///
/// # Errors
/// `ValueError` names what makes no sense.
pub(crate) fn conditions(base: &Simulation, given: Value) -> PyResult<Simulation> {
    moiregauge_pipeline::conditions_on(base, given).map_err(wrong)
}

/// What is known of files, as JSON.
///
/// # Errors
/// `ValueError` names what makes no sense.
pub(crate) fn told(known: &str) -> PyResult<UserSpecified> {
    let told: UserSpecified = serde_json::from_str(known).map_err(wrong)?;
    moiregauge_pipeline::check_user_specified(&told).map_err(wrong)?;
    Ok(told)
}

/// All settings with their defaults, as JSON.
pub(crate) fn defaults() -> PyResult<String> {
    serde_json::to_string(&Settings::default()).map_err(wrong)
}
