//! The images behind the numbers of an analysis, corrected, in formats of other programs.

use std::collections::HashSet;
use std::path::Path;

use moiregauge::campaign::ScanAnalysis;
use moiregauge::numbers::interrupt;
use moiregauge::survey::corrected_images;
use moiregauge_report::FailedInput;
use rayon::prelude::*;
use spmfile::{ExportError, LineDirection, WritableFormat};

use super::failure::in_words;
use super::scans::Scans;
use crate::job::{Cancelled, Job};
use crate::opened::{InputError, read_again};
use crate::sink::{Sink, SinkError};

/// A folder of corrected images, and their format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Export {
    /// The folder within the sink.
    pub folder: String,
    /// The format.
    pub format: WritableFormat,
}

/// Why a scan has no corrected image.
#[derive(Debug, thiserror::Error)]
enum NotCorrected {
    #[error(transparent)]
    Input(#[from] InputError),
    #[error("no image could be corrected")]
    Nothing,
    #[error(transparent)]
    Export(#[from] ExportError),
    #[error(transparent)]
    Sink(#[from] SinkError),
}

/// Writes one image for each scan and line direction: in nm, at rest, turned into laboratory axes. What failed comes
/// back. Files are read again for that, and only for that.
///
/// # Errors
/// [`Cancelled`].
pub fn write_corrected(
    scans: &Scans,
    exports: &[Export],
    sink: &dyn Sink,
    job: &Job,
) -> Result<Vec<FailedInput>, Cancelled> {
    if exports.is_empty() {
        return Ok(Vec::new());
    }
    let mut names = HashSet::new();
    let all: Vec<(String, &ScanAnalysis)> = scans
        .analysis
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
    let failed = |(name, scan): &(String, &ScanAnalysis)| {
        interrupt::check();
        let error = one(scans, exports, (name, scan), sink).err()?;
        Some(FailedInput {
            file: scan.file.clone(),
            error: match &error {
                NotCorrected::Input(error) => in_words(error, scans.advice),
                other => other.to_string(),
            },
        })
    };
    job.run(|| all.par_iter().filter_map(failed).collect())
}

fn one(
    scans: &Scans,
    exports: &[Export],
    (name, analysed): (&str, &ScanAnalysis),
    sink: &dyn Sink,
) -> Result<(), NotCorrected> {
    let settings = &scans.analysis.settings;
    let scan = read_again(scans.inputs, &analysed.file, settings, scans.known)?;
    let images = corrected_images(&scan, analysed, settings);
    if images.is_empty() {
        return Err(NotCorrected::Nothing);
    }
    for image in images {
        let line = match image.line {
            LineDirection::Trace => "trace",
            LineDirection::Retrace => "retrace",
        };
        let mut log = image.log;
        log.insert(0, format!("moiregauge {}", env!("CARGO_PKG_VERSION")));
        for Export { folder, format } in exports {
            let stem = format!("{folder}/{name}-{line}");
            for (file, bytes) in
                spmfile::write_between(&image.scan, *format, &stem, &log, &interrupt::check)?
            {
                sink.write(&file, &bytes)?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::campaign::no_advice;
    use crate::known::Known;
    use crate::sink::MemorySink;
    use moiregauge::campaign::analyse;
    use moiregauge::scan::measure_moires;
    use moiregauge::settings::Settings;
    use moiregauge::simulate::{Simulation, Simulator};

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
        let (sink, job) = (MemorySink::new(), Job::quiet(Some(1)).unwrap());
        let scans = Scans {
            analysis: &analysis,
            inputs: &files,
            known: &Known::default(),
            advice: no_advice,
        };
        let failed = |exports: &[Export]| write_corrected(&scans, exports, &sink, &job).unwrap();
        assert!(failed(&[]).is_empty());
        let gwy = Export {
            folder: "corrected".to_owned(),
            format: WritableFormat::Gwy,
        };
        assert_eq!(failed(&[gwy]).len(), 2);
    }
}
