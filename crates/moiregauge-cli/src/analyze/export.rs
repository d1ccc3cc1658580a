//! `analyze --export`: the images behind the numbers, corrected, in formats of other programs.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use moiregauge::analysis::{Analysis, ScanAnalysis};
use moiregauge::series::corrected_images;
use moiregauge_report::FailedInput;
use rayon::prelude::*;
use spmfile::{LineDirection, WritableFormat};

use super::chain;
use super::files::write_all;
use crate::convert::format_of;
use crate::input::Known;

/// A folder of corrected images and their format.
#[derive(Clone, Debug)]
pub(super) struct Export {
    folder: String,
    format: WritableFormat,
}

/// All that are wanted.
pub(super) fn all(names: &[String]) -> anyhow::Result<Vec<Export>> {
    names.iter().map(|name| parse(name)).collect()
}

/// `corrected.gwy` as the folder `corrected` and the format.
fn parse(name: &str) -> anyhow::Result<Export> {
    let path = Path::new(name);
    let format = format_of(path).context("--export")?;
    ensure!(
        format != WritableFormat::Gxyzf,
        "--export {name}: a corrected image is no cloud of points; `moiregauge convert` writes those"
    );
    ensure!(
        path.parent().is_none_or(|p| p == Path::new("")),
        "--export {name}: expected a name without folders; it goes into --out"
    );
    Ok(Export {
        folder: path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        format,
    })
}

/// Writes one image for each scan and line direction below `out`; what failed comes back.
pub(super) fn write(
    out: &Path,
    exports: &[Export],
    analysis: &Analysis,
    known: &Known,
) -> Vec<FailedInput> {
    let mut names = HashSet::new();
    let scans: Vec<(String, &ScanAnalysis)> = analysis
        .sets
        .iter()
        .flat_map(|set| &set.scans)
        .map(|scan| {
            let file = Path::new(&scan.file).file_name().unwrap_or_default();
            let file = file.to_string_lossy();
            // Files of the same name in several folders.
            let mut name = file.to_string();
            let mut number = 1;
            while !names.insert(name.to_lowercase()) {
                number += 1;
                name = format!("{file}-{number}");
            }
            (name, scan)
        })
        .collect();
    scans
        .par_iter()
        .filter_map(|(name, scan)| {
            let result = one(out, exports, (name, scan), analysis, known);
            result.err().map(|error| FailedInput {
                file: scan.file.clone(),
                error: format!("--export: {error:#}"),
            })
        })
        .collect()
}

fn one(
    out: &Path,
    exports: &[Export],
    (name, analysed): (&str, &ScanAnalysis),
    analysis: &Analysis,
    known: &Known,
) -> anyhow::Result<()> {
    let settings = &analysis.settings;
    let reading = chain::read(&PathBuf::from(&analysed.file), settings, known)?;
    let images = corrected_images(&reading.scan, analysed, settings);
    ensure!(!images.is_empty(), "no image could be corrected");
    for image in images {
        let line = match image.line {
            LineDirection::Trace => "trace",
            LineDirection::Retrace => "retrace",
        };
        let mut log = image.log;
        log.insert(0, format!("moiregauge {}", env!("CARGO_PKG_VERSION")));
        for Export { folder, format } in exports {
            let stem = format!("{folder}/{name}-{line}");
            write_all(out, &spmfile::write(&image.scan, *format, &stem, &log)?)?;
        }
    }
    Ok(())
}
