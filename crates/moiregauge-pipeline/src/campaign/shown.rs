//! The scans that are shown in detail.

use std::path::PathBuf;

use moiregauge::campaign::{Analysis, illustrate};
use moiregauge::numbers::interrupt;
use moiregauge::settings::Settings;
use rayon::prelude::*;

use crate::known::Known;
use crate::names;
use crate::opened::read_shown;

/// Puts the first scan of every set into the analysis as it is shown. Its file is read again for that: no other scan
/// need stay in memory.
pub(super) fn show(
    analysis: &mut Analysis,
    inputs: &[PathBuf],
    settings: &Settings,
    known: &Known,
) {
    analysis.sets.par_iter_mut().for_each(|set| {
        interrupt::check();
        set.illustration = set.scans.first().and_then(|first| {
            let path = names::with_words(inputs, &first.file)?;
            let scan = read_shown(path, settings, known)?;
            illustrate(&scan, first, settings)
        });
    });
}
