//! Files → measured scans, one file in memory per thread.

use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use moiregauge::campaign::about_repeat;
use moiregauge::caveat::Caveat;
use moiregauge::scan::{MeasureError, MeasuredScan, Window, measure_moires};
use moiregauge::settings::Settings;
use moiregauge::spectrum::LatticeError;
use moiregauge_pipeline::{Known, Repeated, set_of};
use moiregauge_report::InputFile;
use moiregauge_report::results::NamedSet;
use rayon::prelude::*;

use super::channel::{Other, others};
use crate::reading::{Reading, read};

/// What was measured.
pub(super) struct Measured {
    /// In the order of the files: the moirés of each, and what identifies it.
    pub(super) files: Vec<anyhow::Result<(Vec<MeasuredScan>, InputFile)>>,
    /// Where the usual channel shows no lattice: the one that was measured.
    pub(super) other: Option<Other>,
}

/// Measures all files, in the window if there is one; in another channel, where none shows a lattice in
/// the usual one.
pub(super) fn measured(
    inputs: &[PathBuf],
    sets: &[NamedSet],
    (settings, known): (&Settings, &Known),
    window: Option<&Window>,
    bar: &ProgressBar,
) -> Measured {
    let all = |settings: &Settings| measure_all(inputs, sets, (settings, known), window, bar);
    let files = all(settings);
    for other in others(inputs, &files, (settings, known)) {
        let files = all(&other.settings);
        if files.iter().any(Result::is_ok) {
            let other = Some(other);
            return Measured { files, other };
        }
    }
    Measured { files, other: None }
}

/// All files, each its moirés and what identifies it.
fn measure_all(
    inputs: &[PathBuf],
    sets: &[NamedSet],
    with: (&Settings, &Known),
    window: Option<&Window>,
    bar: &ProgressBar,
) -> Vec<anyhow::Result<(Vec<MeasuredScan>, InputFile)>> {
    bar.reset();
    let measured = inputs
        .par_iter()
        .map(|path| {
            let result = measure_file(path, sets, with, window);
            bar.inc(1);
            result
        })
        .collect();
    bar.finish_and_clear();
    measured
}

/// One file: its moirés and what identifies it.
pub(crate) fn measure_file(
    path: &Path,
    sets: &[NamedSet],
    (settings, known): (&Settings, &Known),
    window: Option<&Window>,
) -> anyhow::Result<(Vec<MeasuredScan>, InputFile)> {
    let Reading {
        scan,
        input,
        caveats,
    } = read(path, settings, known)?;
    let mut moires = measure_moires(&input.file, &scan, settings, window).map_err(with_hint)?;
    let set = set_of(sets, path).map(str::to_owned);
    for measured in &mut moires {
        measured.caveats.extend(caveats.iter().cloned());
        measured.set.clone_from(&set);
        measured.digest = Some(input.sha256.clone());
    }
    Ok((moires, input))
}

/// The error, with the option that helps against it.
pub(crate) fn with_hint(error: MeasureError) -> anyhow::Error {
    let hint = match &error {
        MeasureError::NoSize => Some("give the size, as in --size 70nm×70nm".to_owned()),
        MeasureError::Lattice { error, .. } => match error {
            LatticeError::NoPeaks { .. } => Some("try --method fourier".to_owned()),
            LatticeError::FewerLattices { found, .. } => {
                Some(format!("--moires {found} measures what is there"))
            }
            _ => None,
        },
        _ => None,
    };
    let error = anyhow::Error::new(error);
    match hint {
        Some(hint) => error.context(hint),
        None => error,
    }
}

/// What has to be said of files that were named more than once.
pub(crate) fn given_again(repeated: &[Repeated]) -> Vec<Caveat> {
    let words = |again: &Repeated| {
        let of = again.of.display().to_string();
        about_repeat(&again.path.display().to_string(), &of)
    };
    let mut caveats: Vec<Caveat> = repeated.iter().map(words).collect();
    caveats.dedup();
    caveats
}
