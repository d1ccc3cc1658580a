//! Maps: begun, looked at, asked, taken away.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, header};
use axum::response::IntoResponse as _;
use axum::routing::{get, post};
use axum::{Json, Router};
use moiregauge_pipeline::campaign::Kept;
use moiregauge_pipeline::maps::{MapRequest, Questions, Shown};
use moiregauge_pipeline::view::{Part, blocks};
use moiregauge_report::results::{MapDetailsResult, ProfileResult, ResultCaveat};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::{binary, written};
use crate::app::{App, Shared};
use crate::body::document;
use crate::host::beside;
use crate::problem::{Answer, Problem};
use crate::work::{Asked, Change};

pub(super) fn routes() -> Router<Arc<App>> {
    Router::new()
        .route("/maps", post(add))
        .route("/maps/{map}", get(shown))
        .route("/maps/{map}/cancel", post(cancel))
        .route("/maps/{map}/result.json", get(result))
        .route("/maps/{map}/quantity", get(quantity))
        .route("/maps/{map}/ask", post(ask))
        .route("/maps/{map}/outputs", get(outputs))
        .route("/maps/{map}/outputs/{*name}", get(output))
        .route("/maps/{map}/archive.zip", get(zip))
}

/// A work whose scans are mapped, or files; and what map is wanted.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wanted {
    work: Option<String>,
    file: Option<String>,
    files: Option<Vec<String>>,
    channel: Option<String>,
    settings: Option<Map<String, Value>>,
    known: Option<Value>,
    #[serde(default)]
    request: MapRequest,
}

async fn add(State(app): Shared, headers: HeaderMap, body: Body) -> Answer<Json<Value>> {
    let wanted: Wanted = document(&headers, body).await?;
    beside(move || {
        let (base, kept) = match &wanted.work {
            Some(id) => {
                let work = app.works.get(id)?;
                (work.asked(), work.kept())
            }
            None => (Asked::nothing(), Kept::default()),
        };
        let mut change = Map::new();
        let files = wanted.files.or_else(|| Some(vec![wanted.file?]));
        if let Some(files) = files {
            change.insert("files".to_owned(), files.into());
        }
        let mut settings = wanted.settings;
        if let Some(channel) = wanted.channel {
            settings
                .get_or_insert_default()
                .insert("channel".to_owned(), channel.into());
        }
        if let Some(settings) = settings {
            change.insert("settings".to_owned(), settings.into());
        }
        if let Some(known) = wanted.known {
            change.insert("known".to_owned(), known);
        }
        let change: Change = serde_json::from_value(change.into()).map_err(Problem::wrong)?;
        let asked = base.with(change, &app.roots)?;
        for file in &asked.files {
            app.roots.file(&file.id)?;
        }
        let map = app.maps.add(asked, wanted.request, kept)?;
        Ok(Json(map.shown()))
    })
    .await
}

async fn shown(State(app): Shared, Path(id): Path<String>) -> Answer<Json<Value>> {
    Ok(Json(app.maps.get(&id)?.shown()))
}

async fn cancel(State(app): Shared, Path(id): Path<String>) -> Answer<Json<Value>> {
    let map = app.maps.get(&id)?;
    map.cancel();
    Ok(Json(map.shown()))
}

async fn result(State(app): Shared, Path(id): Path<String>) -> Answer {
    let bytes = app.maps.get(&id)?.mapped()?.document.clone();
    Ok(([(header::CONTENT_TYPE, "application/json")], bytes).into_response())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfQuantity {
    name: String,
}

async fn quantity(
    State(app): Shared,
    Path(id): Path<String>,
    Query(asked): Query<OfQuantity>,
) -> Answer {
    beside(move || {
        let mapped = app.maps.get(&id)?.mapped()?;
        let plane = mapped.planes.iter().find(|plane| plane.name == asked.name);
        let plane = plane.ok_or_else(|| Problem::missing("no such quantity").at("name"))?;
        binary::image(&blocks(plane, &Part::default()))
    })
    .await
}

/// Answers as they stand in `map.json`, the lines of `profiles.csv`, and doubts about them.
async fn ask(
    State(app): Shared,
    Path(id): Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Answer<Json<Value>> {
    let questions: Questions = document(&headers, body).await?;
    beside(move || {
        let mapped = app.maps.get(&id)?.mapped()?;
        questions.check().map_err(Problem::wrong)?;
        let Shown::Lattice(found) = &mapped.found.shown else {
            return Err(Problem::wrong("a map of stripes has no twist"));
        };
        let (details, doubts) = questions.ask(&found.map).map_err(Problem::wrong)?;
        let profiles: Vec<ProfileResult> = details.profiles.iter().map(Into::into).collect();
        let details = MapDetailsResult::from(&details);
        let caveats: Vec<ResultCaveat> = doubts.iter().map(Into::into).collect();
        let mut answer = serde_json::to_value(details).map_err(Problem::fault)?;
        answer["profiles"] = json!(profiles);
        answer["caveats"] = json!(caveats);
        Ok(Json(answer))
    })
    .await
}

async fn outputs(State(app): Shared, Path(id): Path<String>) -> Answer<Json<Value>> {
    beside(move || Ok(written::listed(&*app.maps.get(&id)?.mapped()?.written()?))).await
}

async fn output(State(app): Shared, Path((id, name)): Path<(String, String)>) -> Answer {
    beside(move || written::one(&*app.maps.get(&id)?.mapped()?.written()?, &name)).await
}

async fn zip(State(app): Shared, Path(id): Path<String>) -> Answer {
    beside(move || {
        let all = app.maps.get(&id)?.mapped()?.written()?;
        written::zipped(&all, "attachment; filename=\"map.zip\"")
    })
    .await
}
