//! The routes.

mod asks;
mod beside;
mod binary;
mod files;
mod images;
mod maps;
mod session;
mod upload;
mod watches;
mod works;
mod written;

use std::sync::Arc;

use axum::Router;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, header};
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};

use crate::app::{App, Shared};
use crate::guard::guard;
use crate::problem::{Answer, Problem};

/// All routes, behind the guard.
pub(crate) fn routes(app: &Arc<App>) -> Router {
    let api = Router::new()
        .route("/session", post(session::open))
        .route("/state", get(session::state))
        .route("/events", get(events))
        .route("/folder", get(files::folder))
        .route("/inspect", get(files::inspect))
        .route("/thumb", get(images::thumb))
        .route("/image", get(images::image))
        .route("/spectrum", get(images::spectrum))
        .route("/upload", post(upload::upload))
        .merge(works::routes())
        .merge(maps::routes())
        .merge(asks::routes())
        .merge(watches::routes())
        .fallback(nothing);
    Router::new()
        .route(
            "/",
            get(|app: Shared| page(app, Path("index.html".to_owned()))),
        )
        .route("/page/{*name}", get(page))
        .nest("/api", api)
        .fallback(nothing)
        .layer(from_fn_with_state(Arc::clone(app), guard))
        .with_state(Arc::clone(app))
}

async fn nothing() -> Problem {
    Problem::missing("there is nothing at this address")
}

async fn page(State(app): Shared, Path(name): Path<String>) -> Answer {
    let Some((bytes, kind)) = app.page.file(&name) else {
        return Err(Problem::missing("no such file of the page").at(name));
    };
    Ok(([(header::CONTENT_TYPE, kind)], bytes.into_owned()).into_response())
}

async fn events(State(app): Shared, headers: HeaderMap) -> Response {
    let heard = headers.get("last-event-id");
    let heard = heard.map(|id| id.to_str().unwrap_or_default().to_owned());
    Arc::clone(&app.events)
        .stream(heard, app.stop.clone())
        .into_response()
}
