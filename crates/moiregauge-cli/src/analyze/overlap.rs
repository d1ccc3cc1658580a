//! The region that all scans have in common.

use std::path::PathBuf;

use moiregauge::scan::{Window, common_window};
use moiregauge::settings::Settings;
use moiregauge_pipeline::Known;
use rayon::prelude::*;

use crate::reading::read;

/// The region common to all files that can be read.
pub(super) fn overlap(inputs: &[PathBuf], settings: &Settings, known: &Known) -> Option<Window> {
    let windows: Vec<Option<Window>> = inputs
        .par_iter()
        .map(|path| Window::of(&read(path, settings, known).ok()?.scan, settings))
        .collect();
    let windows: Vec<Window> = windows.into_iter().flatten().collect();
    common_window(&windows)
}
