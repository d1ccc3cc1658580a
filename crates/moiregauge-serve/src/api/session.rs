//! The token against a cookie.

use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use serde::Deserialize;

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
    let has_ticket = lock(&app.door.ticket)
        .take_if(|ticket| ticket.is(&given.token))
        .is_some();
    if !has_ticket && !app.door.token.is(&given.token) {
        return Err(Problem::new(
            StatusCode::UNAUTHORIZED,
            "the token is not that of the server: open the address that the terminal shows",
        ));
    }
    let (name, value) = (app.door.cookie(), app.door.session.text());
    let cookie = format!("{name}={value}; HttpOnly; SameSite=Strict; Path=/");
    let response: Response =
        (StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie)]).into_response();
    Ok(response)
}
