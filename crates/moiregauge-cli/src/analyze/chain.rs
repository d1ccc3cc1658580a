//! Files → measured scans → analysis, one file in memory per thread.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use moiregauge::analysis::Analysis;
use moiregauge::caveat::{Caveat, FileDoubt};
use moiregauge::lattice::LatticeError;
use moiregauge::series::{
    MeasureError, MeasuredScan, Window, about_repeat, amplitude_of, analyse, choose_channel,
    common_window, illustrate, measure_moires, sorted_moires, unusual_channels,
};
use moiregauge::settings::Settings;
use moiregauge_pipeline::{Repeated, distinct, hexadecimal, names, set_of};
use moiregauge_report::results::NamedSet;
use moiregauge_report::{FailedInput, InputFile, Provenance};
use rayon::prelude::*;
use sha2::{Digest as _, Sha256};
use spmfile::{ChannelInfo, Scan, sensor_axis};

use super::channel;
use crate::input::{Known, with_option};

/// What came out, and of what.
pub(crate) struct Outcome {
    pub(crate) analysis: Analysis,
    pub(crate) provenance: Provenance,
}

/// Analyses files, every moiré that they show by itself; the failed ones among them join `failed`.
///
/// # Errors
/// All failures, where nothing could be analysed.
pub(crate) fn analyse_files(
    inputs: &[PathBuf],
    sets: &[NamedSet],
    (settings, known): (&Settings, &Known),
    mut failed: Vec<FailedInput>,
    illustrated: bool,
    loud: bool,
) -> Result<Vec<Outcome>, Vec<FailedInput>> {
    let (inputs, repeated) = distinct(inputs);
    let inputs = inputs.as_slice();
    let window = match settings.overlap.then(|| overlap(inputs, settings, known)) {
        None => None,
        Some(Some(window)) => Some(window),
        Some(None) => {
            failed.push(FailedInput {
                file: "--overlap".to_owned(),
                error: "the scans have no region in common".to_owned(),
            });
            return Err(failed);
        }
    };
    let window = window.as_ref();
    let measured = measure_all(inputs, sets, (settings, known), window, loud);
    let (other, measured) = match channel::another(inputs, &measured, (settings, known)) {
        Some(others) => others
            .into_iter()
            .find_map(|other| {
                let with = (&other.settings, known);
                let measured = measure_all(inputs, sets, with, window, loud);
                measured
                    .iter()
                    .any(Result::is_ok)
                    .then_some((Some(other), measured))
            })
            .unwrap_or((None, measured)),
        None => (None, measured),
    };
    let settings = other.as_ref().map_or(settings, |other| &other.settings);
    let (mut scans, mut files) = (Vec::new(), Vec::new());
    for (path, result) in inputs.iter().zip(measured) {
        match result {
            Ok((moires, file)) => {
                scans.push(moires);
                files.push(file);
            }
            Err(error) => failed.push(FailedInput {
                file: names::in_words(path),
                error: format!("{error:#}"),
            }),
        }
    }
    if scans.is_empty() {
        return Err(failed);
    }
    let provenance = Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: settings.seed,
        inputs: files,
        failed,
        run: None,
    };
    let outcomes = sorted_moires(scans)
        .into_iter()
        .enumerate()
        .map(|(moire, scans)| {
            let settings = &settings.of_moire(moire);
            let mut analysis = analyse(scans, settings);
            analysis.caveats.extend(given_again(&repeated));
            analysis
                .caveats
                .extend(other.as_ref().map(channel::Other::caveat));
            if illustrated {
                analysis.sets.par_iter_mut().for_each(|set| {
                    set.illustration = set.scans.first().and_then(|first| {
                        let path = names::with_words(inputs, &first.file)?;
                        let reading = read_shown(path, settings, known).ok()?;
                        illustrate(&reading.scan, first, settings)
                    });
                });
            }
            Outcome {
                analysis,
                provenance: provenance.clone(),
            }
        });
    Ok(outcomes.collect())
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

fn measure_all(
    inputs: &[PathBuf],
    sets: &[NamedSet],
    with: (&Settings, &Known),
    window: Option<&Window>,
    loud: bool,
) -> Vec<anyhow::Result<(Vec<MeasuredScan>, InputFile)>> {
    let progress = progress(inputs.len(), loud);
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

pub(crate) fn progress(files: usize, loud: bool) -> ProgressBar {
    if !loud {
        return ProgressBar::hidden();
    }
    // Draws on a terminal only.
    let style = ProgressStyle::with_template("measuring {bar:30} {pos}/{len} scans, {eta} left");
    let bar = ProgressBar::new(files as u64);
    match style {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
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

/// A file as the analysis reads it.
pub(crate) struct Reading {
    pub(crate) scan: Scan,
    pub(crate) input: InputFile,
    /// What the user's options replaced in it, and what its reader doubts.
    pub(crate) caveats: Vec<Caveat>,
}

/// Reads what the analysis needs of a file: the chosen channel and the position sensors; not more than the memory
/// holds while it is analysed.
pub(crate) fn read(path: &Path, settings: &Settings, known: &Known) -> anyhow::Result<Reading> {
    let reading = read_any(path, settings, known)?;
    moiregauge_pipeline::enough_for(&reading.scan)?;
    Ok(reading)
}

/// The same and what is shown beside it: the amplitude of a phase.
fn read_shown(path: &Path, settings: &Settings, known: &Known) -> anyhow::Result<Reading> {
    read_more(path, settings, known, amplitude_of)
}

/// The same of an image of any size, for surveys.
pub(crate) fn read_any(path: &Path, settings: &Settings, known: &Known) -> anyhow::Result<Reading> {
    read_more(path, settings, known, |_| None)
}

fn read_more(
    path: &Path,
    settings: &Settings,
    known: &Known,
    companion: impl Fn(&str) -> Option<String>,
) -> anyhow::Result<Reading> {
    let bytes = moiregauge_pipeline::read(known.place(path))?;
    let channels = channel::names(path, &bytes, known)?;
    let names: Vec<_> = channels
        .iter()
        .map(|(a, b)| (a.as_str(), b.as_str()))
        .collect();
    let chosen = choose_channel(&names, settings.channel.as_deref()).map(str::to_owned);
    let beside = chosen.as_deref().and_then(companion);
    let wanted = |channel: &ChannelInfo| {
        chosen.as_ref().is_none_or(|name| *name == channel.name)
            || beside.as_ref() == Some(&channel.name.to_lowercase())
            || sensor_axis(&channel.name, &channel.internal_name).is_some()
    };
    let (scan, replaced) = known.read(path, &bytes, &wanted).map_err(with_option)?;
    let hash = Sha256::digest(&bytes);
    let input = InputFile {
        file: names::in_words(path),
        sha256: hexadecimal(&hash),
        bytes: bytes.len() as u64,
    };
    let several = unusual_channels(&names, settings.channel.as_deref());
    let several = several.map(FileDoubt::SeveralImages);
    let replaced = replaced.into_iter().map(FileDoubt::GivenByUser);
    let doubts = scan.notes.iter().cloned().map(FileDoubt::ReaderDoubt);
    let all = several.into_iter().chain(replaced).chain(doubts);
    Ok(Reading {
        caveats: all
            .map(|doubt| Caveat::new(doubt, input.file.as_str()))
            .collect(),
        scan,
        input,
    })
}

/// Reads an input again that the results know by the words of its path.
pub(crate) fn read_again(
    inputs: &[PathBuf],
    words: &str,
    settings: &Settings,
    known: &Known,
) -> anyhow::Result<Reading> {
    let path = names::with_words(inputs, words).context("it is none of the inputs")?;
    read(path, settings, known)
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
