//! Who may ask: the host, the origin of the page, the cookie; and the headers of every answer.

use std::net::IpAddr;
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::http::{HeaderMap, Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};

use crate::app::App;
use crate::connection::Connection;
use crate::problem::Problem;

/// What the page may load: its own files and what the server gives; nothing may show it within another page.
const POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; frame-ancestors 'none'; base-uri 'none'; \
                      form-action 'none'; object-src 'none'";

/// What every answer says. A route may have said something stricter.
const HEADERS: [(HeaderName, &str); 7] = [
    (header::CONTENT_SECURITY_POLICY, POLICY),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::CACHE_CONTROL, "no-store"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    ),
    (
        HeaderName::from_static("cross-origin-opener-policy"),
        "same-origin",
    ),
];

/// The layer around all routes.
pub(crate) async fn guard(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let mut response = match refusal(&app, &request) {
        Some(problem) => problem.into_response(),
        None => next.run(request).await,
    };
    let headers = response.headers_mut();
    for (name, value) in HEADERS {
        headers
            .entry(name)
            .or_insert(HeaderValue::from_static(value));
    }
    response
}

/// Why a request is refused.
fn refusal(app: &App, request: &Request) -> Option<Problem> {
    let headers = request.headers();
    let Some(host) = host(headers).filter(|host| is_ours(app, host)) else {
        let words = "this address is not that of the server";
        return Some(Problem::new(StatusCode::MISDIRECTED_REQUEST, words).at("Host"));
    };
    let forbidden = |place: &str| {
        Some(
            Problem::new(
                StatusCode::FORBIDDEN,
                "requests from other pages are refused",
            )
            .at(place),
        )
    };
    let is_read = [Method::GET, Method::HEAD].contains(request.method());
    let path = request.uri().path();
    let is_api = path.starts_with("/api/");
    if !is_read
        && let Some(origin) = headers.get(header::ORIGIN)
        && origin.as_bytes() != format!("http://{host}").as_bytes()
    {
        return forbidden("Origin");
    }
    let site = headers.get("sec-fetch-site").map(HeaderValue::as_bytes);
    let is_own = site.is_none_or(|site| [&b"same-origin"[..], b"none"].contains(&site));
    // The page itself may be opened by a link; nothing else.
    if !is_own && (is_api || !is_read || path != "/") {
        return forbidden("Sec-Fetch-Site");
    }
    if is_api && path != "/api/session" {
        if !has_cookie(app, headers) {
            let words = "the token is missing: open the address that the terminal shows";
            return Some(Problem::new(StatusCode::UNAUTHORIZED, words));
        }
        if let Some(connection) = request.extensions().get::<Arc<Connection>>() {
            connection.trust();
        }
    }
    None
}

/// The one host that is asked.
fn host(headers: &HeaderMap) -> Option<&str> {
    let mut all = headers.get_all(header::HOST).iter();
    let host = all.next()?.to_str().ok()?;
    all.next().is_none().then_some(host)
}

/// Whether a host is ours: an address where we listen, or the name of this computer for itself. A name of somebody else
/// that leads here would let pages from there read answers.
fn is_ours(app: &App, host: &str) -> bool {
    let (name, port) = match host.rsplit_once(':') {
        Some((name, port)) if !port.ends_with(']') => (name, port),
        _ => (host, "80"),
    };
    if port != app.door.port.to_string() {
        return false;
    }
    let address = app.options.address;
    let plain = name.trim_start_matches('[').trim_end_matches(']');
    match plain.parse::<IpAddr>() {
        Ok(asked) => asked == address || address.is_unspecified(),
        Err(_) => name.eq_ignore_ascii_case("localhost") && address.is_loopback(),
    }
}

fn has_cookie(app: &App, headers: &HeaderMap) -> bool {
    let name = app.door.cookie();
    let cookies = headers.get_all(header::COOKIE).iter();
    let cookies = cookies.filter_map(|line| line.to_str().ok());
    let mut pairs = cookies.flat_map(|line| line.split(';'));
    pairs.any(|pair| {
        let pair = pair.trim().split_once('=');
        pair.is_some_and(|(key, value)| key == name && app.door.session.is(value))
    })
}
