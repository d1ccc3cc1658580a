//! A finished folder of many samples, to be shown.

use std::path::Path;

use moiregauge_report::{SampleRow, samples_csv};
use serde::Serialize;

use super::error::SamplesError;
use super::list::{List, lists_in};
use super::tables;

/// The table of many samples.
#[derive(Clone, Debug, Serialize)]
pub struct SamplesShown {
    /// Names of the columns of `samples.csv`.
    pub columns: Vec<String>,
    /// The rows.
    pub rows: Vec<SampleRow>,
    /// For each row the name of its picture within the folder.
    pub pictures: Vec<Option<String>>,
}

/// Reads the table of a folder of results; of shards that are not merged yet those that are done.
///
/// # Errors
/// There are no parts, or damaged ones.
pub fn samples_shown(folder: &Path) -> Result<SamplesShown, SamplesError> {
    let (mut rows, mut pictures) = (Vec::new(), Vec::new());
    for path in lists_in(folder)? {
        let (more, shown) = tables::read(folder, &List::read(&path)?)?;
        rows.extend(more);
        pictures.extend(shown);
    }
    let csv = samples_csv(&rows);
    let head = csv.split(|b| *b == b'\n').next().unwrap_or_default();
    let head = String::from_utf8_lossy(head);
    let names = head.trim_start_matches('\u{feff}').trim().split([',', ';']);
    Ok(SamplesShown {
        columns: names.map(str::to_owned).collect(),
        rows,
        pictures,
    })
}
