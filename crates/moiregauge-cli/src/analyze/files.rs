//! Where results go.

use std::path::{Path, PathBuf};

use moiregauge_pipeline::sink::{FolderSink, Target};

use super::export::Export;

/// What may be written at the top of the folder of results; folders end with a slash.
const NAMES: [&str; 12] = [
    "results.json",
    "report.html",
    "columns.md",
    "vectors.csv",
    "vectors.parquet",
    "scans.csv",
    "scans.parquet",
    "sets.csv",
    "sets.parquet",
    "budget.csv",
    "budget.parquet",
    "figures/",
];

/// Makes the folder of results ready, before the work.
pub(super) fn sink(
    (out, force): (&Path, bool),
    exports: &[Export],
    inputs: &[PathBuf],
) -> anyhow::Result<FolderSink> {
    let moires = (1..=6).map(|n| format!("moire-{n}/"));
    let exported = exports.iter().map(|e| format!("{}/", e.folder()));
    let names: Vec<String> = report_names().chain(moires).chain(exported).collect();
    crate::outputs::folder(&Target {
        folder: out,
        kind: "analyze",
        names: &names,
        inputs,
        force,
    })
}

/// What the report of an analysis consists of.
pub(crate) fn report_names() -> impl Iterator<Item = String> {
    NAMES.map(str::to_owned).into_iter()
}

/// Where the results of each of `moires` moirés go within the folder.
pub(super) fn within(moires: usize) -> Vec<String> {
    if moires == 1 {
        return vec![String::new()];
    }
    (1..=moires).map(|n| format!("moire-{n}/")).collect()
}

/// The file to open first.
pub(super) fn main_file(out: &Path, files: &[(String, Vec<u8>)]) -> PathBuf {
    let report = files.iter().any(|(name, _)| name == "report.html");
    out.join(if report {
        "report.html"
    } else {
        "results.json"
    })
}
