//! Works: made, changed, analysed, taken away.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, header};
use axum::response::IntoResponse as _;
use axum::routing::{get, post};
use axum::{Json, Router};
use moiregauge_pipeline::choices::{self, grains};
use moiregauge_pipeline::view::{FitView, fit_of, overlays};
use serde::Deserialize;
use serde_json::{Value, json};
use spmfile::LineDirection;

use super::files::known;
use super::{binary, written};
use crate::app::{App, Shared};
use crate::body::document;
use crate::host::beside;
use crate::problem::{Answer, Problem};
use crate::work::{Asked, Change, Work, command};

pub(super) fn routes() -> Router<Arc<App>> {
    Router::new()
        .route("/works", post(add))
        .route("/works/{work}", get(shown).patch(change))
        .route("/works/{work}/undo", post(undo))
        .route("/works/{work}/redo", post(redo))
        .route("/works/{work}/run", post(run))
        .route("/works/{work}/cancel", post(cancel))
        .route("/works/{work}/results.json", get(results))
        .route("/works/{work}/summary", get(summary))
        .route("/works/{work}/names", get(names))
        .route("/works/{work}/overlay", get(overlay))
        .route("/works/{work}/residual", get(residual))
        .route("/works/{work}/cell", get(cell))
        .route("/works/{work}/outputs", get(outputs))
        .route("/works/{work}/outputs/{*name}", get(output))
        .route("/works/{work}/archive.zip", get(zip))
        .route("/works/{work}/command", get(command_line))
        .route("/works/{work}/settings.toml", get(settings))
}

type Id = Path<String>;

async fn add(State(app): Shared, headers: HeaderMap, body: Body) -> Answer<Json<Value>> {
    let change: Change = document(&headers, body).await?;
    beside(move || {
        let run = change.run;
        let work = app.works.add(Asked::nothing().with(change, &app.roots)?)?;
        if run {
            work.run(&app.roots)?;
        }
        Ok(Json(work.shown()))
    })
    .await
}

/// Does something with a work and shows it.
async fn with(
    app: Arc<App>,
    id: String,
    what: impl FnOnce(&Arc<Work>, &App) -> Answer<()> + Send + 'static,
) -> Answer<Json<Value>> {
    beside(move || {
        let work = app.works.get(&id)?;
        what(&work, &app)?;
        Ok(Json(work.shown()))
    })
    .await
}

async fn shown(State(app): Shared, Path(id): Id) -> Answer<Json<Value>> {
    with(app, id, |_, _| Ok(())).await
}

async fn change(
    State(app): Shared,
    Path(id): Id,
    headers: HeaderMap,
    body: Body,
) -> Answer<Json<Value>> {
    let change: Change = document(&headers, body).await?;
    with(app, id, |work, app| work.change(change, &app.roots)).await
}

async fn undo(State(app): Shared, Path(id): Id) -> Answer<Json<Value>> {
    with(app, id, |work, app| work.step(true, &app.roots)).await
}

async fn redo(State(app): Shared, Path(id): Id) -> Answer<Json<Value>> {
    with(app, id, |work, app| work.step(false, &app.roots)).await
}

async fn run(State(app): Shared, Path(id): Id) -> Answer<Json<Value>> {
    with(app, id, |work, app| work.run(&app.roots)).await
}

async fn cancel(State(app): Shared, Path(id): Id) -> Answer<Json<Value>> {
    with(app, id, |work, _| {
        work.cancel();
        Ok(())
    })
    .await
}

/// Which of several moirés, counted from 1, the largest cell first.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfMoire {
    moire: Option<usize>,
}

impl OfMoire {
    fn of<T>(self, all: &[T]) -> Answer<&T> {
        let found = self
            .moire
            .unwrap_or(1)
            .checked_sub(1)
            .and_then(|n| all.get(n));
        found.ok_or_else(|| {
            Problem::missing("no such moiré")
                .what(format!("found {}, counted from 1", all.len()))
                .at("moire")
        })
    }
}

async fn results(State(app): Shared, Path(id): Id, Query(moire): Query<OfMoire>) -> Answer {
    let (done, _) = app.works.get(&id)?.done()?;
    let bytes = moire.of(&done.documents)?.clone();
    Ok(([(header::CONTENT_TYPE, "application/json")], bytes).into_response())
}

async fn summary(State(app): Shared, Path(id): Id, Query(moire): Query<OfMoire>) -> Answer {
    beside(move || {
        let (_, outcomes) = app.works.get(&id)?.outcomes()?;
        let outcome = moire.of(&outcomes)?;
        let text = moiregauge_report::screen::summary(&outcome.analysis, |_| None);
        Ok(([(header::CONTENT_TYPE, "text/plain; charset=utf-8")], text).into_response())
    })
    .await
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfFile {
    file: String,
    moire: Option<usize>,
    /// `trace` or `retrace`.
    line: Option<String>,
}

async fn residual(State(app): Shared, Path(id): Id, Query(of): Query<OfFile>) -> Answer {
    let shown = fit_shown(app, id, of).await?;
    let residual = shown.residual;
    binary::image(&residual.ok_or_else(|| Problem::missing("this method fits no waves"))?)
}

async fn cell(State(app): Shared, Path(id): Id, Query(of): Query<OfFile>) -> Answer {
    binary::image(&fit_shown(app, id, of).await?.cell)
}

/// The fit of a scan of the last result, made again.
async fn fit_shown(app: Arc<App>, id: String, of: OfFile) -> Answer<FitView> {
    beside(move || {
        let (done, outcomes) = app.works.get(&id)?.outcomes()?;
        let all = &done.asked.files;
        let named = all.iter().find(|file| file.id == of.file);
        let named =
            named.ok_or_else(|| Problem::missing("no such file in this work").at("file"))?;
        app.roots.file(&named.id)?;
        let known = known(all, &done.asked.known)?;
        let line = match of.line.as_deref() {
            Some("retrace") => LineDirection::Retrace,
            _ => LineDirection::Trace,
        };
        // The channel that was chosen in the end.
        let settings = outcomes.first();
        let settings = settings.map_or(&done.asked.settings, |o| &o.analysis.settings);
        let shown = fit_of(&named.name, settings, &known, line);
        let shown = shown.map_err(|e| Problem::unusable(&e).at("file"))?;
        shown.ok_or_else(|| Problem::missing("nothing was measured in this line").at("line"))
    })
    .await
}

/// The names under which the lattice can be read, with the setting that chooses each.
async fn names(
    State(app): Shared,
    Path(id): Id,
    Query(moire): Query<OfMoire>,
) -> Answer<Json<Value>> {
    beside(move || {
        let (_, outcomes) = app.works.get(&id)?.outcomes()?;
        let outcome = moire.of(&outcomes)?;
        Ok(Json(json!(choices::names(&outcome.analysis))))
    })
    .await
}

/// What is drawn on a scan: one for each line direction; and the grains beside the one that was measured.
async fn overlay(
    State(app): Shared,
    Path(id): Id,
    Query(of): Query<OfFile>,
) -> Answer<Json<Value>> {
    beside(move || {
        let (done, outcomes) = app.works.get(&id)?.outcomes()?;
        let file = done.asked.files.iter().find(|file| file.id == of.file);
        let file = file.ok_or_else(|| Problem::missing("no such file in this work").at("file"))?;
        let name = moiregauge_pipeline::names::in_words(&file.name);
        let outcome = OfMoire { moire: of.moire }.of(&outcomes)?;
        let lines = overlays(&outcome.analysis, &name);
        let grains = grains(&outcome.analysis, &name);
        Ok(Json(
            json!({"file": of.file, "lines": lines, "grains": grains}),
        ))
    })
    .await
}

async fn outputs(State(app): Shared, Path(id): Id) -> Answer<Json<Value>> {
    beside(move || {
        let (done, kept) = app.works.get(&id)?.done()?;
        Ok(written::listed(&*done.written(app.options.advice, &kept)?))
    })
    .await
}

async fn output(State(app): Shared, Path((id, name)): Path<(String, String)>) -> Answer {
    beside(move || {
        let (done, kept) = app.works.get(&id)?.done()?;
        written::one(&*done.written(app.options.advice, &kept)?, &name)
    })
    .await
}

async fn zip(State(app): Shared, Path(id): Id) -> Answer {
    beside(move || {
        let (done, kept) = app.works.get(&id)?.done()?;
        let all = done.written(app.options.advice, &kept)?;
        written::zipped(&all, "attachment; filename=\"moiregauge.zip\"")
    })
    .await
}

async fn command_line(State(app): Shared, Path(id): Id) -> Answer<Json<Value>> {
    let asked = app.works.get(&id)?.asked();
    let command = command(&asked)?;
    Ok(Json(json!({
        "command": command.trim_end(),
        "settings": asked.settings_file()?,
    })))
}

async fn settings(State(app): Shared, Path(id): Id) -> Answer {
    let asked = app.works.get(&id)?.asked();
    let text = asked.settings_file()?.unwrap_or_default();
    let headers = [
        (header::CONTENT_TYPE, "application/toml"),
        (
            header::CONTENT_DISPOSITION,
            "attachment; filename=\"settings.toml\"",
        ),
    ];
    Ok((headers, text).into_response())
}
