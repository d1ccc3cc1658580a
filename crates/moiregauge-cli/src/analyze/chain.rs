//! Files → analysis: measured, then every moiré by itself.

use std::path::PathBuf;

use moiregauge::analysis::Analysis;
use moiregauge::series::{analyse, illustrate, sorted_moires};
use moiregauge::settings::Settings;
use moiregauge_pipeline::{Known, distinct, names};
use moiregauge_report::results::NamedSet;
use moiregauge_report::{FailedInput, Provenance};
use rayon::prelude::*;

use super::channel::Other;
use super::measure::{Measured, given_again, measured};
use crate::reading::read_shown;

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
    let Measured { files, other } = match measured(&inputs, sets, (settings, known), loud) {
        Ok(measured) => measured,
        Err(why) => {
            failed.push(why);
            return Err(failed);
        }
    };
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

/// Puts the first scan of every set into the analysis as it is shown. Its file is read again for that: no other scan
/// need stay in memory.
fn show(analysis: &mut Analysis, inputs: &[PathBuf], (settings, known): (&Settings, &Known)) {
    analysis.sets.par_iter_mut().for_each(|set| {
        set.illustration = set.scans.first().and_then(|first| {
            let scan = read_shown(inputs, &first.file, settings, known)?;
            illustrate(&scan, first, settings)
        });
    });
}
