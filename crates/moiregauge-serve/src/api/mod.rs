//! The routes.

mod asks;
mod binary;
mod campaigns;
mod demo;
mod files;
mod images;
mod maps;
#[cfg(not(target_family = "wasm"))]
mod outside;
#[cfg(not(target_family = "wasm"))]
mod session;
mod state;
mod upload;
mod watches;
mod works;
mod written;

use std::sync::Arc;

use axum::Router;
use axum::routing::{get, post};

use crate::app::App;
use crate::problem::Problem;

/// What is asked of the program, wherever it is.
fn asked() -> Router<Arc<App>> {
    Router::new()
        .route("/state", get(state::state))
        .route("/folder", get(files::folder))
        .route("/inspect", get(files::inspect))
        .route("/thumb", get(images::thumb))
        .route("/image", get(images::image))
        .route("/spectrum", get(images::spectrum))
        .route("/upload", post(upload::upload))
        .route("/demo", post(demo::demo))
        .merge(works::routes())
        .merge(maps::routes())
        .merge(asks::routes())
        .merge(campaigns::routes())
        .merge(watches::routes())
        .fallback(nothing)
}

/// The routes alone, for who asks within the process.
#[cfg(target_family = "wasm")]
pub(crate) fn routes(app: &Arc<App>) -> Router {
    let api = asked().with_state(Arc::clone(app));
    Router::new().nest("/api", api).fallback(nothing)
}

#[cfg(not(target_family = "wasm"))]
pub(crate) use outside::routes;

async fn nothing() -> Problem {
    Problem::missing("there is nothing at this address")
}
