//! Files that are dropped on the page: streamed to the disk, whole or not at all.

use axum::Json;
use axum::body::Body;
use axum::extract::{Query, State};
use axum::http::{HeaderMap, header};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::app::Shared;
use crate::body::too_long;
use crate::host::{beside, take};
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
    let bytes = take(body, limit, app.roots.drop_folder(), place.clone()).await?;
    beside(move || {
        let shown = app.roots.show(DROPPED, &place);
        let shown = shown.ok_or_else(|| Problem::fault("the file was deleted"))?;
        Ok(Json(
            json!({"file": shown.id, "name": asked.name, "bytes": bytes}),
        ))
    })
    .await
}
