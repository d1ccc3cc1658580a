//! Files that people write: settings, in which layers may be named, and layers of their own.

use std::path::Path;

use heterostrain::material::Material;
use moiregauge::settings::Settings;
use serde::Deserialize;

use crate::calibrate::{CalibrationFileError, read_calibration};
use crate::reading::{FileError, read_text};
use crate::replay::{ReplayError, settings_of};

/// A material that has no name here.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown material {name:?}; known are {}", known.join(", "))]
pub struct UnknownMaterial {
    /// The name that was given.
    pub name: String,
    /// The names that there are.
    pub known: Vec<String>,
}

/// Why text holds no settings.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NotSettings {
    /// It is no TOML, or not that of settings.
    #[error(transparent)]
    Toml(#[from] toml::de::Error),
    /// It names a material that nobody knows.
    #[error(transparent)]
    Material(#[from] UnknownMaterial),
    /// The calibration file that it names.
    #[error(transparent)]
    Calibration(#[from] CalibrationFileError),
    /// A part of it cannot be TOML.
    #[error(transparent)]
    Write(#[from] toml::ser::Error),
    /// Numbers of a layer.
    #[error("{0}")]
    Layer(String),
}

/// Why a file holds no settings or layers.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsFileError {
    /// It cannot be read.
    #[error("cannot read {what} {file}")]
    Unreadable {
        /// `the settings file`, or `the layers of`.
        what: &'static str,
        /// Its name.
        file: String,
        /// Why not.
        source: FileError,
    },
    /// It is JSON and no results.
    #[error(transparent)]
    Results(#[from] ReplayError),
    /// What is in it.
    #[error("in {what} {file}")]
    Content {
        /// `the settings file`, or `the layers of`.
        what: &'static str,
        /// Its name.
        file: String,
        /// What was expected and what was found.
        source: Box<NotSettings>,
    },
}

const SETTINGS: &str = "the settings file";
const LAYERS: &str = "the layers of";

/// Reads a settings file (TOML), or the settings that results (JSON) hold. They are not checked yet.
///
/// # Errors
/// [`SettingsFileError`].
pub fn read_settings(path: &Path) -> Result<Settings, SettingsFileError> {
    let text = text_of(SETTINGS, path)?;
    // No TOML file begins so.
    if text.trim_start().starts_with('{') {
        return Ok(settings_of(path, text.as_bytes())?);
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    parse_settings(&text, folder).map_err(in_file(SETTINGS, path))
}

/// The settings in a text, in which `material` and `substrate` may be names; a calibration file is looked for from
/// `folder` on.
///
/// # Errors
/// [`NotSettings`].
///
/// ```
/// let settings = moiregauge_pipeline::parse_settings("material = \"hBN\"\nseed = 7", "".as_ref())?;
/// assert_eq!((settings.bilayer().name().as_str(), settings.seed), ("hBN", 7));
/// # Ok::<(), moiregauge_pipeline::NotSettings>(())
/// ```
pub fn parse_settings(text: &str, folder: &Path) -> Result<Settings, NotSettings> {
    let mut table: toml::Table = toml::from_str(text)?;
    let mut changed = false;
    // Who names layers has chosen them.
    let layers = ["material", "substrate", "moire_layers"];
    if layers.iter().any(|key| table.contains_key(*key)) && !table.contains_key("layers_chosen") {
        table.insert("layers_chosen".to_owned(), toml::Value::Boolean(true));
        changed = true;
    }
    changed |= name_materials(&mut table)?;
    if let Some(toml::Value::Array(moires)) = table.get_mut("moire_layers") {
        for layers in moires.iter_mut().filter_map(toml::Value::as_table_mut) {
            changed |= name_materials(layers)?;
        }
    }
    if let Some(toml::Value::String(file)) = table.get("scanner") {
        let scanner = toml::Value::try_from(read_calibration(&folder.join(file))?)?;
        table.insert("scanner".to_owned(), scanner);
        changed = true;
    }
    if changed {
        return Ok(table.try_into()?);
    }
    // Straight from the text: errors then show the line.
    Ok(toml::from_str(text)?)
}

/// Puts materials in the place of their names; whether there were any.
fn name_materials(table: &mut toml::Table) -> Result<bool, NotSettings> {
    let mut changed = false;
    for key in ["material", "substrate"] {
        if let Some(toml::Value::String(name)) = table.get(key) {
            let material = toml::Value::try_from(named_material(name, &[])?)?;
            table.insert(key.to_owned(), material);
            changed = true;
        }
    }
    Ok(changed)
}

/// A material by name, one of the user's own first.
///
/// # Errors
/// [`UnknownMaterial`] lists the names.
pub fn named_material(name: &str, own: &[Material]) -> Result<Material, UnknownMaterial> {
    let of_user = own
        .iter()
        .find(|m| m.name.eq_ignore_ascii_case(name.trim()));
    let found = of_user.cloned().or_else(|| Material::named(name));
    found.ok_or_else(|| UnknownMaterial {
        name: name.to_owned(),
        known: own
            .iter()
            .cloned()
            .chain(Material::all())
            .map(|m| m.name)
            .collect(),
    })
}

/// `graphene`, or `graphene/hBN` for graphene on hBN: the layers (upper, lower where it is another one).
///
/// # Errors
/// As [`named_material`].
pub fn named_layers(
    text: &str,
    own: &[Material],
) -> Result<(Material, Option<Material>), UnknownMaterial> {
    match text.split_once('/') {
        None => Ok((named_material(text, own)?, None)),
        Some((upper, lower)) => {
            let (upper, lower) = (named_material(upper, own)?, named_material(lower, own)?);
            let substrate = (upper != lower).then_some(lower);
            Ok((upper, substrate))
        }
    }
}

/// The layers that a user describes in a file: `[[layer]]` tables.
///
/// # Errors
/// [`SettingsFileError`].
pub fn read_layers(path: &Path) -> Result<Vec<Material>, SettingsFileError> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct File {
        layer: Vec<Material>,
    }
    let text = text_of(LAYERS, path)?;
    let file: Result<File, _> = toml::from_str(&text);
    let file = file.map_err(|why| in_file(LAYERS, path)(why.into()))?;
    match file.layer.iter().find_map(Material::problem) {
        Some(problem) => Err(in_file(LAYERS, path)(NotSettings::Layer(problem))),
        None => Ok(file.layer),
    }
}

fn text_of(what: &'static str, path: &Path) -> Result<String, SettingsFileError> {
    read_text(path).map_err(|source| SettingsFileError::Unreadable {
        what,
        file: path.display().to_string(),
        source,
    })
}

fn in_file(what: &'static str, path: &Path) -> impl FnOnce(NotSettings) -> SettingsFileError {
    let file = path.display().to_string();
    move |source| SettingsFileError::Content {
        what,
        file,
        source: Box::new(source),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Layers of each moiré by name; as many as there are moirés.
    #[test]
    fn moires_have_layers_of_their_own() {
        let text = "moires = 2\n[[moire_layers]]\nmaterial = \"graphene\"\n[[moire_layers]]\n\
                    material = \"graphene\"\nsubstrate = \"hBN\"\n";
        let settings = parse_settings(text, Path::new("")).unwrap();
        settings.check().unwrap();
        assert_eq!(settings.of_moire(0).bilayer().name(), "graphene");
        assert_eq!(settings.of_moire(1).bilayer().name(), "graphene/hBN");
        let three = Settings {
            moires: 3,
            ..settings
        };
        let error = three.check().unwrap_err().to_string();
        assert!(
            error.contains("each of the 3") && error.contains("found 2"),
            "{error}"
        );
    }

    #[test]
    fn unknown_keys_and_materials_are_refused_with_what_is_known() {
        let error = |text| {
            let settings = parse_settings(text, Path::new(""));
            settings.unwrap_err().to_string()
        };
        assert!(error("metod = \"fourier\"").contains("metod"));
        assert!(error("material = \"unobtainium\"").contains("graphene"));
    }
}
