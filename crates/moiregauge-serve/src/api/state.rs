//! What there is.

use axum::Json;
use axum::extract::State;
use serde_json::{Value, json};

use crate::app::Shared;
use crate::host;

/// What there is.
pub(super) async fn state(State(app): Shared) -> Json<Value> {
    let roots = app.roots.shown().into_iter();
    let roots: Vec<Value> = roots
        .map(|(root, name)| json!({"root": root, "name": name}))
        .collect();
    Json(json!({
        "version": moiregauge_pipeline::VERSION,
        "roots": roots,
        "upload_limit_bytes": app.options.upload_limit,
        "saves": host::SAVES && app.options.keep.is_some(),
        "works": app.works.ids(),
        "maps": app.maps.ids(),
        "watches": app.watches.ids(),
    }))
}
