//! Files → analysis: measured, then every moiré by itself.

use std::path::PathBuf;

use moiregauge::campaign::Analysis;
use moiregauge::campaign::analyse;
use moiregauge::scan::sorted_moires;
use moiregauge::settings::Settings;
use moiregauge_pipeline::{Known, distinct, names};
use moiregauge_report::results::NamedSet;
use moiregauge_report::{FailedInput, Provenance};

use super::channel::Other;
use super::measure::{Measured, given_again, measured};
use super::overlap::overlap;
use super::shown::show;
use crate::progress::bar;

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
    let bar = bar("measuring", "scans", inputs.len(), loud);
    let window = settings.overlap.then(|| overlap(&inputs, settings, known));
    if let Some(None) = window {
        failed.push(FailedInput {
            file: "--overlap".to_owned(),
            error: "the scans have no region in common".to_owned(),
        });
        return Err(failed);
    }
    let window = window.flatten();
    let with = (settings, known);
    let Measured { files, other } = measured(&inputs, sets, with, window.as_ref(), &bar);
    let settings = other.as_ref().map_or(settings, |other| &other.settings);
    let (mut scans, mut identities) = (Vec::new(), Vec::new());
    for (path, result) in inputs.iter().zip(files) {
        match result {
            Ok((moires, file)) => {
                scans.push(moires);
                identities.push(file);
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
        inputs: identities,
        failed,
        run: None,
    };
    let mut caveats = given_again(&repeated);
    caveats.extend(other.as_ref().map(Other::caveat));
    let outcomes = sorted_moires(scans)
        .into_iter()
        .enumerate()
        .map(|(moire, scans)| {
            let settings = &settings.of_moire(moire);
            let mut analysis = analyse(scans, settings);
            analysis.caveats.extend(caveats.iter().cloned());
            if illustrated {
                show(&mut analysis, &inputs, (settings, known));
            }
            Outcome {
                analysis,
                provenance: provenance.clone(),
            }
        });
    Ok(outcomes.collect())
}
