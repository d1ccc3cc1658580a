//! Files of results: which there are, one of them, all in an archive.

use axum::Json;
use axum::http::{HeaderName, HeaderValue, header};
use axum::response::IntoResponse as _;
use moiregauge_pipeline::sink::archive;
use serde_json::{Value, json};

use crate::problem::{Answer, Problem};
use crate::work::Written;

/// Pages and pictures of results: their own styles, and nothing else that runs or loads.
const OF_RESULTS: &str = "sandbox; default-src 'none'; img-src data:; style-src 'unsafe-inline'; font-src data:; \
                          frame-ancestors 'none'";

/// Their names and sizes.
pub(super) fn listed(all: &Written) -> Json<Value> {
    let all = all.iter();
    let all = all.map(|(name, bytes)| json!({"name": name, "bytes": bytes.len()}));
    Json(all.collect())
}

/// One of them.
pub(super) fn one(all: &Written, name: &str) -> Answer {
    let bytes = all.get(name).cloned();
    let bytes = bytes.ok_or_else(|| Problem::missing("no such file of results").at(name))?;
    let extension = name.rsplit_once('.').map_or("", |(_, extension)| extension);
    let kind = match extension {
        "html" => "text/html; charset=utf-8",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "json" => "application/json",
        "csv" => "text/csv; charset=utf-8",
        "md" | "toml" | "txt" => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    };
    let policy = HeaderValue::from_static(OF_RESULTS);
    let headers: [(HeaderName, HeaderValue); 2] = [
        (header::CONTENT_TYPE, HeaderValue::from_static(kind)),
        (header::CONTENT_SECURITY_POLICY, policy),
    ];
    Ok((headers, bytes).into_response())
}

/// All of them in an archive to be kept, under the name in `disposition`.
pub(super) fn zipped(all: &Written, disposition: &'static str) -> Answer {
    let headers = [
        (header::CONTENT_TYPE, "application/zip"),
        (header::CONTENT_DISPOSITION, disposition),
    ];
    let bytes = archive(all).map_err(Problem::fault)?;
    Ok((headers, bytes).into_response())
}
