//! Channels to be looked at.

use std::sync::Arc;

use axum::extract::{Query, State};
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use moiregauge_pipeline::view::{self, Part, blocks, little, whole};
use moiregauge_report::ColorMap;
use serde::Deserialize;
use spmfile::{Channel, Scan};

use super::binary;
use super::files::known_of;
use crate::app::{App, Shared};
use crate::host::beside;
use crate::problem::{Answer, Problem};

/// Pixels along the side of a thumbnail.
const SIDES: std::ops::RangeInclusive<usize> = 16..=512;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OfThumb {
    file: String,
    channel: usize,
    size: Option<usize>,
    colours: Option<ColorMap>,
    known: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OfImage {
    file: String,
    channel: usize,
    #[serde(default)]
    step: usize,
    #[serde(default)]
    x: usize,
    #[serde(default)]
    y: usize,
    w: Option<usize>,
    h: Option<usize>,
    known: Option<String>,
}

/// A file as it is decoded.
pub(super) fn scan(app: &App, file: &str, told: Option<&str>) -> Answer<Arc<Scan>> {
    let file = app.roots.file(file)?;
    let known = known_of(&file, told)?;
    let decode = || whole(&file.name, &known).map_err(|e| Problem::unusable(&e).at(&file.id));
    match told {
        None => app.scans.of(&file.place, decode),
        // What is told may change the scan.
        Some(_) => decode().map(Arc::new),
    }
}

/// One of its channels.
pub(super) fn channel(scan: &Scan, number: usize) -> Answer<&Channel> {
    scan.channels.get(number).ok_or_else(|| {
        let count = scan.channels.len();
        Problem::missing("no such channel")
            .what(format!("found {count}, counted from 0"))
            .at("channel")
    })
}

/// A channel in little.
pub(super) async fn thumb(State(app): Shared, Query(asked): Query<OfThumb>) -> Answer<Response> {
    let side = asked
        .size
        .unwrap_or(160)
        .clamp(*SIDES.start(), *SIDES.end());
    let png = beside(move || {
        let scan = scan(&app, &asked.file, asked.known.as_deref())?;
        let channel = channel(&scan, asked.channel)?;
        little(channel, side, asked.colours.unwrap_or_default()).map_err(Problem::fault)
    })
    .await?;
    Ok(([(header::CONTENT_TYPE, "image/png")], png).into_response())
}

/// The values of a channel.
pub(super) async fn image(State(app): Shared, Query(asked): Query<OfImage>) -> Answer {
    beside(move || {
        let scan = scan(&app, &asked.file, asked.known.as_deref())?;
        let part = Part {
            column: asked.x,
            row: asked.y,
            columns: asked.w,
            rows: asked.h,
            step: asked.step,
        };
        binary::image(&blocks(channel(&scan, asked.channel)?, &part))
    })
    .await
}

/// The power of a channel.
pub(super) async fn spectrum(State(app): Shared, Query(asked): Query<OfThumb>) -> Answer {
    beside(move || {
        let scan = scan(&app, &asked.file, asked.known.as_deref())?;
        let channel = channel(&scan, asked.channel)?;
        let (view, per_pixel) = view::spectrum(channel);
        binary::spectrum(&view, per_pixel, channel.pitch_nm())
    })
    .await
}
