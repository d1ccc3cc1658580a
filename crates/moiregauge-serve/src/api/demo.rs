//! Scans to try the page on: the sets of `moiregauge demo`, simulated into the folder of what was dropped.

use axum::Json;
use axum::extract::State;
use moiregauge::simulate::Simulator;
use moiregauge_pipeline::simulate::paper_sets;
use moiregauge_pipeline::sink::MemorySink;
use moiregauge_pipeline::{Job, simulate};
use serde_json::{Value, json};

use crate::app::Shared;
use crate::host::{beside, put};
use crate::problem::{Answer, Problem};
use crate::roots::DROPPED;

/// Where they lie.
const DROP: &str = "demo";
/// The seed of the program.
const SEED: u64 = 1;

/// The scans, as files that were dropped.
pub(super) async fn demo(State(app): Shared) -> Answer<Json<Value>> {
    beside(move || {
        let job = Job::quiet(None).map_err(Problem::fault)?;
        let mut files = Vec::new();
        for set in paper_sets(SEED) {
            let sink = MemorySink::new();
            simulate(&set, &sink, &job).map_err(|e| Problem::unusable(&e))?;
            let written = sink.commit("simulate").map_err(Problem::fault)?;
            // Not the truth beside them, nor the list of all.
            let scans = (0..set.raster.scans).map(Simulator::file_name);
            for scan in scans {
                let bytes = written.get(&scan).map_or(&[][..], Vec::as_slice);
                let name = format!("{}/{scan}", set.name);
                let place = app.roots.drop_place(DROP, &name)?;
                let folder = place.parent().unwrap_or(&place);
                std::fs::create_dir_all(folder).map_err(Problem::fault)?;
                put(folder, &scan, bytes).map_err(Problem::fault)?;
                let shown = app.roots.show(DROPPED, &place);
                let shown = shown.ok_or_else(|| Problem::fault("the file was deleted"))?;
                files.push(json!({"file": shown.id, "name": name, "bytes": bytes.len()}));
            }
        }
        Ok(Json(json!({ "files": files })))
    })
    .await
}
