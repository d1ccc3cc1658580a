//! Files that are dropped on the page: streamed to the disk, whole or not at all.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use axum::Json;
use axum::body::Body;
use axum::extract::{Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use serde::Deserialize;
use serde_json::{Value, json};
use tempfile::NamedTempFile;

use super::beside::beside;
use crate::app::Shared;
use crate::body::{pieces, too_long};
use crate::problem::{Answer, Problem};
use crate::roots::DROPPED;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OfUpload {
    drop: String,
    name: String,
}

/// Takes a file.
pub(super) async fn upload(
    State(app): Shared,
    Query(asked): Query<OfUpload>,
    headers: HeaderMap,
    body: Body,
) -> Answer<Json<Value>> {
    let place = app.roots.drop_place(&asked.drop, &asked.name)?;
    let limit = app.options.upload_limit;
    let announced = headers.get(header::CONTENT_LENGTH);
    let announced = announced.and_then(|n| n.to_str().ok()?.parse::<u64>().ok());
    if announced.is_some_and(|bytes| bytes > limit) {
        return Err(too_long(limit));
    }
    let file = NamedTempFile::with_prefix_in(".part-", app.roots.drop_folder());
    // Removed when it is dropped, however this ends.
    let mut file = file.map_err(|e| unwritten(&e))?;
    let bytes = pieces(body, limit, |piece| {
        tokio::task::block_in_place(|| file.write_all(piece)).map_err(|e| unwritten(&e))
    })
    .await?;
    beside(move || {
        keep(file, &place)?;
        let shown = app.roots.show(DROPPED, &place);
        let shown = shown.ok_or_else(|| Problem::fault("the file was deleted"))?;
        Ok(Json(
            json!({"file": shown.id, "name": asked.name, "bytes": bytes}),
        ))
    })
    .await
}

/// Puts the file in its place.
fn keep(file: NamedTempFile, place: &Path) -> Answer<()> {
    let folder: PathBuf = place.parent().unwrap_or(place).to_owned();
    std::fs::create_dir_all(folder).map_err(|e| unwritten(&e))?;
    file.persist(place).map_err(|e| unwritten(&e.error))?;
    Ok(())
}

fn unwritten(error: &std::io::Error) -> Problem {
    Problem::new(
        StatusCode::INSUFFICIENT_STORAGE,
        format!("the file cannot be kept: {error}"),
    )
}
