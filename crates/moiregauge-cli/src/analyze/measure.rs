//! Files → measured scans, one file in memory per thread.

use std::path::{Path, PathBuf};

use moiregauge::caveat::Caveat;
use moiregauge::series::{
    MeasureError, MeasuredScan, Window, about_repeat, common_window, measure_moires,
};
use moiregauge::settings::Settings;
use moiregauge_pipeline::{Known, Repeated, set_of};
use moiregauge_report::results::NamedSet;
use moiregauge_report::{FailedInput, InputFile};
use rayon::prelude::*;

use super::channel::{Other, others};
use crate::progress::bar;
use crate::reading::{Reading, read};

/// What was measured.
pub(super) struct Measured {
    /// In the order of the files: the moirés of each, and what identifies it.
    pub(super) files: Vec<anyhow::Result<(Vec<MeasuredScan>, InputFile)>>,
    /// Where the usual channel shows no lattice: the one that was measured.
    pub(super) other: Option<Other>,
}

/// Measures all files, in their common region where that is wanted; in another channel, where none shows a lattice in
/// the usual one.
///
/// # Errors
/// The files have no region in common.
pub(super) fn measured(
    inputs: &[PathBuf],
    sets: &[NamedSet],
    (settings, known): (&Settings, &Known),
    loud: bool,
) -> Result<Measured, FailedInput> {
    let window = if settings.overlap {
        let nothing = || FailedInput {
            file: "--overlap".to_owned(),
            error: "the scans have no region in common".to_owned(),
        };
        Some(overlap(inputs, settings, known).ok_or_else(nothing)?)
    } else {
        None
    };
    let all =
        |settings: &Settings| measure_all(inputs, sets, (settings, known), window.as_ref(), loud);
    let files = all(settings);
    for other in others(inputs, &files, (settings, known)) {
        let files = all(&other.settings);
        if files.iter().any(Result::is_ok) {
            let other = Some(other);
            return Ok(Measured { files, other });
        }
    }
    Ok(Measured { files, other: None })
}

/// All files, each its moirés and what identifies it.
fn measure_all(
    inputs: &[PathBuf],
    sets: &[NamedSet],
    with: (&Settings, &Known),
    window: Option<&Window>,
    loud: bool,
) -> Vec<anyhow::Result<(Vec<MeasuredScan>, InputFile)>> {
    let progress = bar("measuring", "scans", inputs.len(), loud);
    let measured = inputs
        .par_iter()
        .map(|path| {
            let result = measure_file(path, sets, with, window);
            progress.inc(1);
            result
        })
        .collect();
    progress.finish_and_clear();
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
        let several = |c: &&mut Caveat| c.code == "several-images";
        for caveat in measured.caveats.iter_mut().filter(several) {
            caveat.message += "; --image N says which one";
        }
        measured.caveats.extend(caveats.iter().cloned());
        measured.set.clone_from(&set);
        measured.digest = Some(input.sha256.clone());
    }
    Ok((moires, input))
}

/// The error, with the option that helps against it.
pub(crate) fn with_hint(error: MeasureError) -> anyhow::Error {
    let hint = match error {
        MeasureError::NoSize => Some("give the size, as in --size 70nm×70nm"),
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

/// The region common to all files that can be read.
fn overlap(inputs: &[PathBuf], settings: &Settings, known: &Known) -> Option<Window> {
    let windows: Vec<Option<Window>> = inputs
        .par_iter()
        .map(|path| Window::of(&read(path, settings, known).ok()?.scan, settings))
        .collect();
    let windows: Vec<Window> = windows.into_iter().flatten().collect();
    common_window(&windows)
}
