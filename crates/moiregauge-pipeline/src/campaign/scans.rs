//! Analysed scans, and where their pixels are.

use std::path::PathBuf;

use moiregauge::campaign::Analysis;

use super::failure::Advice;
use crate::known::Known;

/// Analysed scans whose pixels can be read again.
#[derive(Clone, Copy, Debug)]
pub struct Scans<'a> {
    /// What was found in them.
    pub analysis: &'a Analysis,
    /// The files.
    pub inputs: &'a [PathBuf],
    /// What is known of them.
    pub known: &'a Known,
    /// What helps against errors.
    pub advice: Advice,
}
