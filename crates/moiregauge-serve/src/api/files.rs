//! Folders, and what files hold.

use axum::Json;
use axum::extract::{Query, State};
use moiregauge_pipeline::{Known, find, names};
use moiregauge_report::results::UserSpecified;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::app::Shared;
use crate::host::beside;
use crate::paths::below;
use crate::problem::{Answer, Problem};
use crate::roots::{File, places};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OfFolder {
    root: String,
    #[serde(default)]
    under: String,
}

/// The folders and scans in a folder.
pub(super) async fn folder(
    State(app): Shared,
    Query(asked): Query<OfFolder>,
) -> Answer<Json<Value>> {
    beside(move || {
        let folder = app.roots.folder(&asked.root, &asked.under)?;
        let entries = std::fs::read_dir(&folder.real);
        let entries = entries.map_err(|e| Problem::missing(e.to_string()).at("under"))?;
        let mut folders: Vec<String> = entries
            .filter_map(|entry| {
                let path = entry.ok()?.path();
                let name = path.file_name()?.to_str()?.to_owned();
                let shown = path.is_dir() && !name.starts_with('.') && below(&name).is_ok();
                shown.then_some(name)
            })
            .collect();
        folders.sort();
        let mut files = Vec::new();
        for found in find(std::slice::from_ref(&folder.real)).files {
            match found {
                Ok(path) => {
                    let Some(file) = app.roots.show(&folder.root, &path) else {
                        continue;
                    };
                    let bytes = std::fs::metadata(&path).map_or(0, |m| m.len());
                    let name = path.file_name().unwrap_or_default().to_string_lossy();
                    files.push(json!({"file": file.id, "name": name, "bytes": bytes}));
                }
                Err(failed) => {
                    let path = std::path::Path::new(&failed.file);
                    // That the folder holds no scans is seen.
                    if path != folder.real {
                        let name = path.file_name().unwrap_or_default().to_string_lossy();
                        files.push(json!({"name": name, "error": failed.error}));
                    }
                }
            }
        }
        Ok(Json(json!({
            "root": asked.root,
            "under": asked.under,
            "folders": folders,
            "files": files,
        })))
    })
    .await
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OfFile {
    file: String,
    /// What the file does not tell, as JSON.
    known: Option<String>,
}

/// What is known of one file.
pub(super) fn known_of(file: &File, told: Option<&str>) -> Answer<Known> {
    let told: UserSpecified = match told {
        Some(text) => serde_json::from_str(text).map_err(|e| Problem::wrong(e).at("known"))?,
        None => UserSpecified::default(),
    };
    known(std::slice::from_ref(file), &told)
}

/// What is told of files, and where they are.
pub(crate) fn known(files: &[File], told: &UserSpecified) -> Answer<Known> {
    moiregauge_pipeline::check_user_specified(told)
        .map_err(|e| Problem::wrong(&e).at(e.setting))?;
    if told.sensors.is_some() {
        return Err(Problem::wrong("a second file cannot be named here").at("known.sensors"));
    }
    let names: Vec<_> = files.iter().map(|file| file.name.clone()).collect();
    Ok(Known::new(told, &names).at(&places(files)))
}

/// What the program tells of a file, and the rest of its header.
pub(super) async fn inspect(
    State(app): Shared,
    Query(asked): Query<OfFile>,
) -> Answer<Json<Value>> {
    beside(move || {
        let file = app.roots.file(&asked.file)?;
        let known = known_of(&file, asked.known.as_deref())?;
        let info = moiregauge_pipeline::inspect(&file.name, &known, &[], app.options.advice);
        let mut told = serde_json::to_value(&info).map_err(Problem::fault)?;
        told["header"] = info
            .scan
            .map_or_else(Vec::new, |scan| scan.header)
            .into_iter()
            .map(|(name, value)| json!([name, value]))
            .collect();
        told["name"] = names::in_words(&file.name).into();
        Ok(Json(told))
    })
    .await
}
