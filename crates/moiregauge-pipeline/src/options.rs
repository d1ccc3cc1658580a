//! Options as JSON → settings, and conditions of simulations: for front ends that take names and values.

use moiregauge::settings::{MoireLayers, Settings};
use moiregauge::simulate::Simulation;
use serde_json::{Map, Value};

use crate::settings_file::{named_layers, named_material};

/// An option that makes no sense, by its name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct OptionError(String);

fn wrong(error: impl std::fmt::Display) -> OptionError {
    OptionError(error.to_string())
}

/// Any settings on top of these: `layers` as `"graphene/hBN"`, materials by name, `drift` as `[x, y]`, a part of a
/// table without the rest of it. `method = "paper"` brings all that belongs to it.
///
/// # Errors
/// [`OptionError`] names the option.
///
/// ```
/// use moiregauge::settings::Settings;
/// use moiregauge_pipeline::settings_on;
///
/// let options = serde_json::from_str(r#"{"layers": "graphene/hBN", "seed": 7}"#)?;
/// let settings = settings_on(Settings::default(), options)?;
/// assert_eq!((settings.bilayer().name().as_str(), settings.seed), ("graphene/hBN", 7));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn settings_on(
    base: Settings,
    mut options: Map<String, Value>,
) -> Result<Settings, OptionError> {
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
fn both(given: Value) -> Result<Value, OptionError> {
    let layers = match given {
        Value::String(layers) => layers,
        Value::Object(mut table) => {
            // Named, with what else is known of them.
            let named = table.remove("layers");
            if let Some(Value::Object(layers)) = named.map(both).transpose()? {
                table.extend(layers);
            }
            return Ok(table.into());
        }
        given => return Ok(given),
    };
    let (material, substrate) = named_layers(&layers, &[]).map_err(wrong)?;
    serde_json::to_value(MoireLayers::new(material, substrate)).map_err(wrong)
}

/// A material by name; a table with the name of a known one changes that.
fn material(given: Value) -> Result<Value, OptionError> {
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
/// [`OptionError`] names what makes no sense.
pub fn conditions_on(base: &Simulation, mut given: Value) -> Result<Simulation, OptionError> {
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

#[cfg(test)]
mod tests {
    use moiregauge::settings::RulerLayer;

    use super::*;

    fn settings(options: &str) -> Result<Settings, String> {
        let options = serde_json::from_str(options).unwrap();
        settings_on(Settings::default(), options).map_err(|e| e.to_string())
    }

    #[test]
    fn settings_are_read_back_as_they_are_written() {
        let changed = settings(
            r#"{"layers": "graphene/hBN", "drift": [0.5, 1], "by_hand": {"near_nm": 12}}"#,
        )
        .unwrap();
        assert!(changed.layers_chosen && changed.by_hand.near_nm == Some(12.0));
        for all in [Settings::default(), changed] {
            let text = serde_json::to_string(&all).unwrap();
            assert_eq!(settings(&text), Ok(all));
        }
    }

    #[test]
    fn each_moire_has_its_layers_and_its_ruler() {
        let given = r#"{"moires": 2, "moire_layers": [{"layers": "graphene/hBN", "ruler": "off"}, "graphene"], "ruler": "2"}"#;
        let found = settings(given).unwrap();
        let of = |moire: usize| {
            let own = found.of_moire(moire);
            (own.bilayer().name(), own.ruler)
        };
        let upper_on_lower = found.moire_layers[0].substrate.is_some();
        assert!(upper_on_lower && of(0).1 == RulerLayer::Off);
        assert_eq!(of(1), ("graphene".to_owned(), RulerLayer::Second));
        // Only the atoms of the moiré that has a ruler are looked for.
        let looked_for: Vec<&str> = found
            .ruler_layers()
            .iter()
            .map(|l| l.name.as_str())
            .collect();
        assert_eq!(looked_for, ["graphene"]);
    }

    #[test]
    fn what_makes_no_sense_is_named_and_no_file_is_opened() {
        assert!(settings(r#"{"metod": 1}"#).unwrap_err().contains("metod"));
        assert!(settings(r#"{"seed": "x"}"#).unwrap_err().contains("seed"));
        assert!(
            settings(r#"{"scanner": "/etc/passwd"}"#)
                .unwrap_err()
                .contains("scanner")
        );
        assert!(
            settings(r#"{"material": "unobtainium"}"#)
                .unwrap_err()
                .contains("graphene")
        );
    }

    #[test]
    fn conditions_are_changed_in_part() {
        let base = Simulation::default();
        let given = serde_json::json!({"sample": {"twist_deg": 2.5}});
        let changed = conditions_on(&base, given).unwrap();
        assert_eq!(changed.raster, base.raster);
        assert_ne!(changed.sample, base.sample);
    }
}
