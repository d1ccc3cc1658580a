//! Keyword arguments → settings, and what is known of files. Names, defaults and checks are those of the settings.

use std::path::Path;

use moiregauge::settings::{MoireLayers, Settings};
use moiregauge::simulate::Simulation;
use moiregauge_pipeline::calibrate::read_calibration;
use moiregauge_pipeline::names::in_full;
use moiregauge_pipeline::{named_layers, named_material, read_settings};
use moiregauge_report::results::Told;
use pyo3::PyResult;
use serde_json::{Map, Value};

use crate::errors::wrong;

/// Options of an analysis as JSON: any settings, `layers` as `"graphene/hBN"`, materials by name, `drift` as `[x, y]`.
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
    let published = options.get("method").and_then(Value::as_str) == Some("paper");
    let base = if published { base.as_published() } else { base };
    let Value::Object(mut all) = serde_json::to_value(base).map_err(wrong)? else {
        return Err(wrong("settings: expected names and values"));
    };
    if let Some(layers) = options.remove("layers")
        && let Value::Object(both) = both(layers)?
    {
        options.extend(both);
    }
    let chosen = ["material", "substrate", "moire_layers"];
    if chosen.iter().any(|name| options.contains_key(*name)) {
        all.insert("layers_chosen".to_owned(), true.into());
    }
    if options.contains_key("material") {
        // Who names layers names all of them.
        all.remove("substrate");
        all.remove("moire_layers");
    }
    for (name, mut value) in options {
        match (name.as_str(), &mut value) {
            ("material" | "substrate", given) => *given = material(given.take())?,
            ("moire_layers", Value::Array(moires)) => {
                for layers in moires {
                    *layers = both(layers.take())?;
                }
            }
            ("scanner", Value::String(file)) => {
                let read = read_calibration(Path::new(file.as_str()));
                let read = read.map_err(|e| wrong(in_full(&e)))?;
                value = serde_json::to_value(read).map_err(wrong)?;
            }
            ("drift", Value::Array(xy)) if xy.len() == 2 => {
                value = serde_json::json!({"x_nm_per_min": xy[0], "y_nm_per_min": xy[1]});
            }
            _ => {}
        }
        if let (Some(Value::Object(known)), Value::Object(given)) = (all.get_mut(&name), &value) {
            // A part of a table leaves the rest as it is.
            known.extend(given.clone());
        } else {
            all.insert(name, value);
        }
    }
    // One by one, lest the error not tell which.
    for (name, value) in &all {
        let one = Map::from_iter([(name.clone(), value.clone())]);
        serde_json::from_value::<Settings>(one.into())
            .map_err(|e| wrong(format!("{name}: {e}")))?;
    }
    let settings: Settings = serde_json::from_value(all.into()).map_err(wrong)?;
    settings.check().map_err(wrong)?;
    Ok(settings)
}

/// The layers of a moiré: `"graphene/hBN"`, or a table of both.
fn both(given: Value) -> PyResult<Value> {
    let Value::String(layers) = given else {
        return Ok(given);
    };
    let (material, substrate) = named_layers(&layers, &[]).map_err(wrong)?;
    serde_json::to_value(MoireLayers {
        material,
        substrate,
    })
    .map_err(wrong)
}

/// A material by name; a table with the name of a known one changes that.
fn material(given: Value) -> PyResult<Value> {
    let named =
        |name: &str| serde_json::to_value(named_material(name, &[]).map_err(wrong)?).map_err(wrong);
    match given {
        Value::String(name) => named(&name),
        Value::Object(table) if table.contains_key("name") && !table.contains_key("source") => {
            let mut whole = named(table["name"].as_str().unwrap_or_default())?;
            let source = format!(
                "{}, changed by the user",
                whole["name"].as_str().unwrap_or_default()
            );
            put(&mut whole, table.into());
            whole["source"] = source.into();
            Ok(whole)
        }
        other => Ok(other),
    }
}

/// Instrument and sample as JSON: any part of it, the rest as in `base`, materials by name.
///
/// # Errors
/// `ValueError` names what makes no sense.
pub(crate) fn conditions(base: &Simulation, mut given: Value) -> PyResult<Simulation> {
    if let Some(Value::Object(sample)) = given.get_mut("sample") {
        if let Some(layers) = sample.remove("layers")
            && let Value::Object(both) = both(layers)?
        {
            sample.extend(both);
        }
        for layer in ["material", "substrate"] {
            if let Some(one) = sample.get_mut(layer) {
                *one = material(one.take())?;
            }
        }
    }
    let mut all = serde_json::to_value(base).map_err(wrong)?;
    put(&mut all, given);
    serde_json::from_value(all).map_err(wrong)
}

/// Puts what is given in the place of what was, table by table.
fn put(all: &mut Value, given: Value) {
    match (all, given) {
        (Value::Object(all), Value::Object(given)) => {
            for (name, value) in given {
                put(all.entry(name).or_insert(Value::Null), value);
            }
        }
        (all, given) => *all = given,
    }
}

/// What is known of files, as JSON.
///
/// # Errors
/// `ValueError` names what makes no sense.
pub(crate) fn told(known: &str) -> PyResult<Told> {
    let told: Told = serde_json::from_str(known).map_err(wrong)?;
    moiregauge_pipeline::check_told(&told).map_err(wrong)?;
    Ok(told)
}

/// All settings with their defaults, as JSON.
pub(crate) fn defaults() -> PyResult<String> {
    serde_json::to_string(&Settings::default()).map_err(wrong)
}
