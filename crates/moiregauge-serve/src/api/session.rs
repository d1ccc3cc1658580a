//! The token against a cookie; what there is.

use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::app::Shared;
use crate::body::document;
use crate::lock::lock;
use crate::problem::{Answer, Problem};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Given {
    token: String,
}

/// The cookie for the token.
pub(super) async fn open(State(app): Shared, headers: HeaderMap, body: Body) -> Answer {
    let given: Given = document(&headers, body).await?;
    let has_ticket = lock(&app.ticket)
        .take_if(|ticket| ticket.is(&given.token))
        .is_some();
    if !has_ticket && !app.token.is(&given.token) {
        return Err(Problem::new(
            StatusCode::UNAUTHORIZED,
            "the token is not that of the server: open the address that the terminal shows",
        ));
    }
    let (name, value) = (app.cookie(), app.session.text());
    let cookie = format!("{name}={value}; HttpOnly; SameSite=Strict; Path=/");
    let response: Response =
        (StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie)]).into_response();
    Ok(response)
}

/// What there is.
pub(super) async fn state(State(app): Shared) -> Json<Value> {
    let roots = app.roots.shown().into_iter();
    let roots: Vec<Value> = roots
        .map(|(root, name)| json!({"root": root, "name": name}))
        .collect();
    Json(json!({
        "version": env!("CARGO_PKG_VERSION"),
        "roots": roots,
        "upload_limit_bytes": app.options.upload_limit,
        "saves": app.options.keep.is_some(),
        "works": app.works.ids(),
        "maps": app.maps.ids(),
        "watches": app.watches.ids(),
    }))
}
