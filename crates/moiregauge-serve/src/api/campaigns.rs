//! Campaigns: begun, looked at, their tables shown and taken away.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, header};
use axum::response::IntoResponse as _;
use axum::routing::{get, post};
use axum::{Json, Router};
use moiregauge::settings::Settings;
use moiregauge_pipeline::samples::samples_shown;
use moiregauge_pipeline::settings_on;
use moiregauge_report::results::UserSpecified;
use serde::Deserialize;
use serde_json::{Map, Value};

use super::written::zipped;
use crate::app::{App, Shared};
use crate::body::document;
use crate::host::{self, beside};
use crate::problem::{Answer, Problem};
use crate::roots::Folder;
use crate::work::Written;

pub(super) fn routes() -> Router<Arc<App>> {
    Router::new()
        .route("/campaigns", post(add))
        .route("/campaigns/{campaign}", get(shown))
        .route("/campaigns/{campaign}/cancel", post(cancel))
        .route("/samples", get(samples))
        .route("/samples/picture", get(picture))
        .route("/samples/archive.zip", get(zip))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wanted {
    root: String,
    #[serde(default)]
    under: String,
    #[serde(default)]
    settings: Map<String, Value>,
    #[serde(default)]
    known: UserSpecified,
}

async fn add(State(app): Shared, headers: HeaderMap, body: Body) -> Answer<Json<Value>> {
    let wanted: Wanted = document(&headers, body).await?;
    beside(move || {
        if wanted.known.sensors.is_some() {
            return Err(Problem::wrong("a second file cannot be named here").at("known.sensors"));
        }
        let folder = app.roots.folder(&wanted.root, &wanted.under)?;
        let settings = settings_on(Settings::default(), wanted.settings);
        let settings = settings.map_err(|e| Problem::wrong(e).at("settings"))?;
        let out = app.roots.drop_folder();
        let begun = (app.campaigns).add(&folder, &wanted.under, out, settings, wanted.known)?;
        Ok(Json(begun.shown()))
    })
    .await
}

async fn shown(State(app): Shared, Path(id): Path<String>) -> Answer<Json<Value>> {
    Ok(Json(app.campaigns.get(&id)?.shown()))
}

async fn cancel(State(app): Shared, Path(id): Path<String>) -> Answer<Json<Value>> {
    let campaign = app.campaigns.get(&id)?;
    campaign.cancel();
    Ok(Json(campaign.shown()))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfSamples {
    root: String,
    #[serde(default)]
    under: String,
    /// The name of a picture in the folder.
    name: Option<String>,
}

async fn samples(State(app): Shared, Query(asked): Query<OfSamples>) -> Answer<Json<Value>> {
    beside(move || {
        let folder = app.roots.folder(&asked.root, &asked.under)?;
        let shown = samples_shown(&folder.real).map_err(|e| Problem::unusable(&e).at("under"))?;
        serde_json::to_value(shown)
            .map(Json)
            .map_err(Problem::fault)
    })
    .await
}

async fn picture(State(app): Shared, Query(asked): Query<OfSamples>) -> Answer {
    beside(move || {
        let name = asked.name.unwrap_or_default();
        let parts = format!("{}/parts", asked.under);
        let folder = app
            .roots
            .folder(&asked.root, parts.trim_start_matches('/'))?;
        let missing = || Problem::missing("no such picture").at("name");
        let stem = name
            .strip_prefix("parts/")
            .and_then(|n| n.strip_suffix(".png"));
        let stem = stem.ok_or_else(missing)?;
        if stem.is_empty() || !stem.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(missing());
        }
        let file = folder.real.join(format!("{stem}.png"));
        let real = host::real(&file).map_err(|_| missing())?;
        if !real.starts_with(&folder.real) {
            return Err(missing());
        }
        let bytes = std::fs::read(real).map_err(|_| missing())?;
        Ok(([(header::CONTENT_TYPE, "image/png")], bytes).into_response())
    })
    .await
}

/// Tables and page, with the pictures that the page shows.
async fn zip(State(app): Shared, Query(asked): Query<OfSamples>) -> Answer {
    beside(move || {
        let folder = app.roots.folder(&asked.root, &asked.under)?;
        let shown = samples_shown(&folder.real).map_err(|e| Problem::unusable(&e).at("under"))?;
        let pictures = shown.pictures.into_iter().flatten();
        let tables = ["samples.csv", "failed.csv", "campaign.html"].map(str::to_owned);
        let mut all = Written::new();
        for name in tables.into_iter().chain(pictures) {
            let bytes = read(&folder, &name)?;
            all.insert(name, bytes);
        }
        zipped(&all, "attachment; filename=\"campaign.zip\"")
    })
    .await
}

/// A file of a folder of results, unless a link leads out of it.
fn read(folder: &Folder, name: &str) -> Answer<Vec<u8>> {
    let missing = || Problem::missing("no such file of results").at(name);
    let real = host::real(&folder.real.join(name)).map_err(|_| missing())?;
    if !real.starts_with(&folder.real) {
        return Err(missing());
    }
    std::fs::read(real).map_err(|_| missing())
}
