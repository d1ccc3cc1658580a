//! Bodies of requests: no longer and no slower than they may be.

use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, StatusCode, header};
use futures_util::StreamExt as _;
use serde::de::DeserializeOwned;

use crate::host;
use crate::problem::{Answer, Problem};

/// Bytes of a document.
const DOCUMENT: u64 = 4 << 20;
/// Time between two pieces of a body.
const PIECE_TIME: Duration = Duration::from_secs(20);

/// Too much.
pub(crate) fn too_long(limit: u64) -> Problem {
    let words = "the body is too long";
    Problem::new(StatusCode::PAYLOAD_TOO_LARGE, words).what(format!("at most {limit} bytes"))
}

/// Takes a body piece by piece.
pub(crate) async fn pieces(
    body: Body,
    limit: u64,
    mut take: impl FnMut(&Bytes) -> Answer<()> + Send,
) -> Answer<u64> {
    let mut stream = body.into_data_stream();
    let mut length = 0;
    loop {
        let next = host::within(PIECE_TIME, stream.next()).await;
        let slow = || Problem::new(StatusCode::REQUEST_TIMEOUT, "the body came too slowly");
        let Some(piece) = next.ok_or_else(slow)? else {
            return Ok(length);
        };
        let piece = piece.map_err(|e| Problem::wrong(format!("the body ended too early: {e}")))?;
        length += piece.len() as u64;
        if length > limit {
            return Err(too_long(limit));
        }
        take(&piece)?;
    }
}

/// A document, as JSON that says so: forms of other pages cannot.
pub(crate) async fn document<T: DeserializeOwned>(headers: &HeaderMap, body: Body) -> Answer<T> {
    let kind = headers.get(header::CONTENT_TYPE);
    let kind = kind.and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    if kind.split(';').next().map(str::trim) != Some("application/json") {
        let words = "expected application/json";
        return Err(Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, words).at("Content-Type"));
    }
    let mut bytes = Vec::new();
    pieces(body, DOCUMENT, |piece| {
        bytes.extend_from_slice(piece);
        Ok(())
    })
    .await?;
    serde_json::from_slice(&bytes)
        .map_err(|e| Problem::wrong(format!("not the expected document: {e}")))
}
