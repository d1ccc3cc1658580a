//! Watches: begun, looked at, ended.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode};
use axum::routing::{get, post};
use axum::{Json, Router};
use moiregauge::settings::Settings;
use moiregauge_pipeline::settings_on;
use moiregauge_pipeline::watch::{Until, WatchRequest};
use moiregauge_report::results::UserSpecified;
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::app::{App, Shared};
use crate::body::document;
use crate::host::{DROPPED_CHANGES, beside};
use crate::problem::{Answer, Problem};
use crate::roots::DROPPED;

pub(super) fn routes() -> Router<Arc<App>> {
    Router::new()
        .route("/watches", post(add))
        .route("/watches/{watch}", get(shown).delete(end))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wanted {
    root: String,
    #[serde(default)]
    under: String,
    #[serde(default)]
    until: Until,
    #[serde(default)]
    settings: Map<String, Value>,
    #[serde(default)]
    known: UserSpecified,
}

async fn add(State(app): Shared, headers: HeaderMap, body: Body) -> Answer<Json<Value>> {
    let wanted: Wanted = document(&headers, body).await?;
    beside(move || {
        if wanted.root == DROPPED && !DROPPED_CHANGES {
            return Err(
                Problem::wrong("a microscope cannot save into a folder of the page").at("root"),
            );
        }
        if wanted.known.sensors.is_some() {
            return Err(Problem::wrong("a second file cannot be named here").at("known.sensors"));
        }
        let folder = app.roots.folder(&wanted.root, &wanted.under)?;
        let settings = settings_on(Settings::default(), wanted.settings);
        let watched = app.watches.add(WatchRequest {
            folder: if wanted.root == DROPPED {
                folder.real
            } else {
                folder.name
            },
            settings: settings.map_err(|e| Problem::wrong(e).at("settings"))?,
            told: wanted.known,
            until: wanted.until,
            ..WatchRequest::default()
        })?;
        Ok(Json(watched.shown()))
    })
    .await
}

async fn shown(State(app): Shared, Path(id): Path<String>) -> Answer<Json<Value>> {
    beside(move || Ok(Json(app.watches.get(&id)?.shown()))).await
}

async fn end(State(app): Shared, Path(id): Path<String>) -> Answer<StatusCode> {
    app.watches.remove(&id)?;
    Ok(StatusCode::NO_CONTENT)
}
