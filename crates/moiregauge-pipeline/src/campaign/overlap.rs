//! The region that all scans have in common.

use std::path::PathBuf;

use moiregauge::numbers::interrupt;
use moiregauge::scan::{Window, common_window};
use moiregauge::settings::Settings;
use rayon::prelude::*;

use crate::known::Known;
use crate::opened::read_scan;

/// The region common to all files that can be read.
pub(super) fn overlap(inputs: &[PathBuf], settings: &Settings, known: &Known) -> Option<Window> {
    let windows: Vec<Option<Window>> = inputs
        .par_iter()
        .map(|path| {
            interrupt::check();
            Window::of(&read_scan(path, settings, known).ok()?.scan, settings)
        })
        .collect();
    let windows: Vec<Window> = windows.into_iter().flatten().collect();
    common_window(&windows)
}
