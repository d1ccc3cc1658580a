//! Parts → the table of all samples, that of what failed, and the page.

use std::path::Path;

use moiregauge_report::{SampleRow, SamplesPage, failed_csv, samples_csv, samples_page};

use super::done::SamplesDone;
use super::error::SamplesError;
use super::list::{List, PARTS};
use super::part::{Part, picture_name};
use crate::sink::{FolderSink, Target};

/// What is written beside the parts.
const NAMES: [&str; 4] = [
    "samples.csv",
    "samples.parquet",
    "failed.csv",
    "campaign.html",
];

/// Makes the folder ready. Tables of an earlier run are replaced; a file of somebody else of one of the names is
/// refused.
pub(super) fn sink(folder: &Path) -> Result<FolderSink, SamplesError> {
    Ok(FolderSink::open(&Target {
        folder,
        kind: "campaign",
        names: &NAMES.map(str::to_owned),
        inputs: &[],
        force: true,
    })?)
}

/// Writes the tables of all samples of a list, whose parts are in the folder.
pub(super) fn write(
    folder: &Path,
    list: &List,
    sink: FolderSink,
) -> Result<SamplesDone, SamplesError> {
    let (rows, pictures) = read(folder, list)?;
    sink.write("samples.csv", &samples_csv(&rows))?;
    sink.write("failed.csv", &failed_csv(&rows))?;
    #[cfg(feature = "parquet")]
    sink.write(
        "samples.parquet",
        &moiregauge_report::samples_parquet(&rows)?,
    )?;
    let page = samples_page(&SamplesPage {
        settings: &list.asked.settings,
        version: &list.asked.version,
        rows: &rows,
        pictures: &pictures,
    })?;
    sink.write("campaign.html", &page)?;
    sink.commit()?;
    Ok(SamplesDone::of(&rows))
}

/// The rows of a list, and for each the name of its picture within the folder.
pub(super) fn read(
    folder: &Path,
    list: &List,
) -> Result<(Vec<SampleRow>, Vec<Option<String>>), SamplesError> {
    let parts = folder.join(PARTS);
    let (mut rows, mut pictures) = (Vec::<SampleRow>::new(), Vec::new());
    for listed in &list.samples {
        let part = Part::read(&parts, &listed.key)?.ok_or_else(|| SamplesError::Damaged {
            path: parts.join(super::part::part_name(&listed.key)),
            reason: "a list names it, but it does not exist".to_owned(),
        })?;
        let picture = part
            .picture
            .then(|| format!("{PARTS}/{}", picture_name(&listed.key)));
        let count = part.rows.len();
        rows.extend(part.rows);
        pictures.push(picture);
        // The first moiré has the picture of all.
        pictures.resize(pictures.len() + count - 1, None);
    }
    Ok((rows, pictures))
}
