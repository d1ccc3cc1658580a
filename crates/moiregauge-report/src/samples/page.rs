//! The page of all samples.

use heterostrain::Estimate;
use moiregauge::settings::Settings;
use serde::Serialize;

use super::row::{SampleRow, SampleStatus};
use crate::error::ReportError;
use crate::format::plus_minus;
use crate::html::{layers, rendered};

/// What the page says beside the rows.
#[derive(Clone, Copy, Debug)]
pub struct SamplesPage<'a> {
    /// The settings that all samples share.
    pub settings: &'a Settings,
    /// Version of the program.
    pub version: &'a str,
    /// The rows, sorted.
    pub rows: &'a [SampleRow],
    /// The picture of each row, seen from the page; `None` where there is none.
    pub pictures: &'a [Option<String>],
}

#[derive(Serialize)]
struct Content {
    layers: String,
    version: String,
    seed: u64,
    samples: usize,
    ok: usize,
    doubtful: usize,
    failed: usize,
    rows: Vec<Row>,
    failures: Vec<Failure>,
}

#[derive(Serialize)]
struct Row {
    picture: Option<String>,
    sample: String,
    moire: usize,
    status: &'static str,
    scans: usize,
    twist: String,
    strain: String,
    drift: String,
    caveats: String,
}

#[derive(Serialize)]
struct Failure {
    sample: String,
    file: String,
    error: String,
}

/// `campaign.html`: a small picture and the numbers of each sample, and what failed.
///
/// # Errors
/// None in practice: everything is written into memory.
pub fn samples_page(page: &SamplesPage) -> Result<Vec<u8>, ReportError> {
    let firsts = || page.rows.iter().filter(|row| row.moire == 1);
    let count = |status| firsts().filter(|row| row.status == status).count();
    let rows = page.rows.iter().zip(page.pictures);
    let failures = firsts().flat_map(|row| {
        row.failed.iter().map(|failed| Failure {
            sample: row.sample.clone(),
            file: failed.file.clone(),
            error: failed.error.clone(),
        })
    });
    let content = Content {
        layers: layers(page.settings),
        version: page.version.to_owned(),
        seed: page.settings.seed,
        samples: firsts().count(),
        ok: count(SampleStatus::Ok),
        doubtful: count(SampleStatus::Doubtful),
        failed: count(SampleStatus::Failed),
        rows: rows
            .map(|(row, picture)| shown(row, picture.as_ref()))
            .collect(),
        failures: failures.collect(),
    };
    rendered(include_str!("../html/samples.html"), content)
}

fn shown(row: &SampleRow, picture: Option<&String>) -> Row {
    let words = |value: Option<f64>, total: Option<f64>, part: Option<f64>| {
        value.map_or_else(String::new, |value| {
            let sigma = total.or(part).unwrap_or(f64::NAN);
            plus_minus(Estimate::new(value, sigma))
        })
    };
    let x = words(row.drift_x_nm_per_min, None, row.drift_x_sigma_nm_per_min);
    let y = words(row.drift_y_nm_per_min, None, row.drift_y_sigma_nm_per_min);
    Row {
        picture: picture.cloned(),
        sample: row.sample.clone(),
        moire: row.moire,
        status: row.status.name(),
        scans: row.scans,
        twist: words(
            row.twist_deg,
            row.twist_sigma_total_deg,
            row.twist_sigma_deg,
        ),
        strain: words(
            row.heterostrain_percent,
            row.heterostrain_sigma_total_percent,
            row.heterostrain_sigma_percent,
        ),
        drift: if x.is_empty() { x } else { format!("{x}, {y}") },
        caveats: row.caveats.join(", "),
    }
}
