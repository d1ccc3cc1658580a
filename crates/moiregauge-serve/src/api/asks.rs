//! Questions without files: moirés, plans, caveats, materials, settings.

use std::sync::Arc;

use axum::body::Body;
use axum::http::{HeaderMap, header};
use axum::response::IntoResponse as _;
use axum::routing::{get, post};
use axum::{Json, Router};
use moiregauge::Material;
use moiregauge::caveat::explained;
use moiregauge::settings::Settings;
use moiregauge::simulate::Simulation;
use moiregauge_pipeline::moire::{Given, Moire, MoireQuestion};
use moiregauge_pipeline::plan::PlanRequest;
use moiregauge_pipeline::{Job, conditions_on, moire, plan, settings_on};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::app::App;
use crate::body::document;
use crate::host::beside;
use crate::problem::{Answer, Problem};

pub(super) fn routes() -> Router<Arc<App>> {
    Router::new()
        .route("/moire", post(moire_document))
        .route("/moire.svg", post(moire_figure))
        .route("/plan", post(planned))
        .route("/caveats", get(caveats))
        .route("/materials", get(materials))
        .route("/defaults", get(defaults))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfMoire {
    given: Given,
    #[serde(default)]
    settings: Map<String, Value>,
    band_degeneracy: Option<f64>,
}

async fn asked(headers: &HeaderMap, body: Body) -> Answer<Moire> {
    let asked: OfMoire = document(headers, body).await?;
    beside(move || {
        let usual = MoireQuestion::new(asked.given);
        let settings = settings_on(usual.settings.clone(), asked.settings);
        let question = MoireQuestion {
            settings: settings.map_err(|e| Problem::wrong(e).at("settings"))?,
            band_degeneracy: asked.band_degeneracy.unwrap_or(usual.band_degeneracy),
            ..usual
        };
        moire(&question).map_err(|e| Problem::unusable(&e))
    })
    .await
}

/// What `moiregauge moire --json` prints.
async fn moire_document(headers: HeaderMap, body: Body) -> Answer {
    let text = asked(&headers, body).await?.document.to_json();
    let text = text.map_err(Problem::fault)?;
    Ok(([(header::CONTENT_TYPE, "application/json")], text).into_response())
}

async fn moire_figure(headers: HeaderMap, body: Body) -> Answer {
    let drawing = asked(&headers, body).await?.figure();
    Ok(([(header::CONTENT_TYPE, "image/svg+xml")], drawing.svg).into_response())
}

async fn planned(headers: HeaderMap, body: Body) -> Answer<Json<Value>> {
    let mut request: Map<String, Value> = document(&headers, body).await?;
    beside(move || {
        let conditions = request.remove("conditions").unwrap_or_else(|| json!({}));
        let conditions = conditions_on(&Simulation::default(), conditions);
        let settings = match request.remove("settings") {
            Some(Value::Object(settings)) => settings,
            None => Map::new(),
            Some(_) => return Err(Problem::wrong("expected names and values").at("settings")),
        };
        let settings = settings_on(Settings::default(), settings);
        let plain: PlanRequest = serde_json::from_value(request.into()).map_err(Problem::wrong)?;
        let request = PlanRequest {
            conditions: conditions.map_err(|e| Problem::wrong(e).at("conditions"))?,
            settings: settings.map_err(|e| Problem::wrong(e).at("settings"))?,
            ..plain
        };
        let job = Job::quiet(None).map_err(Problem::fault)?;
        let found = plan(&request, &job).map_err(|e| Problem::unusable(&e))?;
        serde_json::to_value(found)
            .map(Json)
            .map_err(Problem::fault)
    })
    .await
}

/// What `moiregauge explain --json` prints.
async fn caveats() -> Answer<Json<Value>> {
    let all: Vec<_> = explained().collect();
    serde_json::to_value(all).map(Json).map_err(Problem::fault)
}

async fn materials() -> Answer<Json<Value>> {
    serde_json::to_value(Material::all())
        .map(Json)
        .map_err(Problem::fault)
}

/// All settings, as they are where nothing is said.
async fn defaults() -> Answer<Json<Value>> {
    serde_json::to_value(Settings::default())
        .map(Json)
        .map_err(Problem::fault)
}
