//! All routes of a server: those of the program, the page, the stream of events, behind the guard.

use std::sync::Arc;

use axum::Router;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, header};
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};

use super::{asked, nothing, session};
use crate::app::{App, Shared};
use crate::guard::guard;
use crate::problem::{Answer, Problem};

/// All routes, behind the guard.
pub(crate) fn routes(app: &Arc<App>) -> Router {
    let api = asked()
        .route("/session", post(session::open))
        .route("/events", get(events));
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

async fn page(State(app): Shared, Path(name): Path<String>) -> Answer {
    let Some((bytes, kind)) = app.door.page.file(&name) else {
        return Err(Problem::missing("no such file of the page").at(name));
    };
    Ok(([(header::CONTENT_TYPE, kind)], bytes.into_owned()).into_response())
}

async fn events(State(app): Shared, headers: HeaderMap) -> Response {
    let heard = headers.get("last-event-id");
    let heard = heard.map(|id| id.to_str().unwrap_or_default().to_owned());
    Arc::clone(&app.events)
        .stream(heard, app.door.stop.clone())
        .into_response()
}
