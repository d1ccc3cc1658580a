//! `analyze --export`: the images behind the numbers, corrected, in formats of other programs.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use moiregauge::campaign::{Analysis, ScanAnalysis};
use moiregauge::survey::corrected_images;
use moiregauge_pipeline::sink::FolderSink;
use moiregauge_pipeline::{Known, read_again};
use moiregauge_report::FailedInput;
use rayon::prelude::*;
use spmfile::{LineDirection, WritableFormat};

use super::hint::with_advice;
use crate::convert::format_of;
use crate::outputs::write_all;

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

impl Export {
    pub(super) fn folder(&self) -> &str {
        &self.folder
    }
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

/// Writes one image for each scan and line direction; what failed comes back. Files are read again for that, and only
/// for that.
pub(super) fn write(
    sink: &FolderSink,
    exports: &[Export],
    analysis: &Analysis,
    from: (&[PathBuf], &Known),
) -> Vec<FailedInput> {
    if exports.is_empty() {
        return Vec::new();
    }
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
            let result = one(sink, exports, (name, scan), analysis, from);
            result.err().map(|error| FailedInput {
                file: scan.file.clone(),
                error: format!("--export: {error:#}"),
            })
        })
        .collect()
}

fn one(
    sink: &FolderSink,
    exports: &[Export],
    (name, analysed): (&str, &ScanAnalysis),
    analysis: &Analysis,
    (inputs, known): (&[PathBuf], &Known),
) -> anyhow::Result<()> {
    let settings = &analysis.settings;
    let scan = read_again(inputs, &analysed.file, settings, known).map_err(with_advice)?;
    let images = corrected_images(&scan, analysed, settings);
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
            write_all(
                sink,
                "",
                &spmfile::write(&image.scan, *format, &stem, &log)?,
            )?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use moiregauge::campaign::analyse;
    use moiregauge::scan::measure_moires;
    use moiregauge::settings::Settings;
    use moiregauge::simulate::{Simulation, Simulator};
    use moiregauge_pipeline::sink::Target;

    /// The files are gone after they were measured: that is noticed where an export needs them, and not otherwise.
    #[test]
    fn files_are_read_again_only_for_exports() {
        let mut set = Simulation::default();
        set.raster.pixels = [128; 2];
        set.raster.scans = 2;
        let simulator = Simulator::new(set).unwrap();
        let settings = Settings {
            drift_draws: 0,
            strain_draws: 0,
            ..Settings::default()
        };
        let files = [PathBuf::from("gone-1.spm"), PathBuf::from("gone-2.spm")];
        let measured = files.iter().enumerate().map(|(index, file)| {
            let frame = simulator.frame(index);
            let name = file.display().to_string();
            measure_moires(&name, &frame, &settings, None)
                .unwrap()
                .remove(0)
        });
        let analysis = analyse(measured.collect(), &settings);
        let out = tempfile::tempdir().unwrap();
        let sink = crate::outputs::folder(&Target {
            folder: out.path(),
            kind: "analyze",
            names: &[],
            inputs: &[],
            force: false,
        });
        let (sink, known) = (sink.unwrap(), Known::default());
        let failed = |exports: &[Export]| write(&sink, exports, &analysis, (&files, &known)).len();
        assert_eq!(failed(&[]), 0);
        assert_eq!(failed(&[parse("corrected.gwy").unwrap()]), 2);
    }
}
