//! What is to be watched, and how.

use std::path::PathBuf;

use moiregauge::settings::{Settings, SettingsError};
use moiregauge_report::results::UserSpecified;
use serde::{Deserialize, Serialize};

use super::until::Until;

/// Steps without a change after which an unreadable file is reported: a minute at two seconds a step. Writing
/// pauses for less, and somebody who waits for a frame should not wait longer for the reason.
const PATIENCE: usize = 30;

/// What is to be watched.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WatchRequest {
    /// The folder; its subfolders are not searched.
    pub folder: PathBuf,
    /// Settings of the analysis.
    pub settings: Settings,
    /// What the files do not tell.
    pub told: UserSpecified,
    /// The errors that are wished for.
    pub until: Until,
    /// Steps without a change after which an unreadable file is given up.
    pub patience: usize,
}

impl Default for WatchRequest {
    fn default() -> Self {
        Self {
            folder: PathBuf::new(),
            settings: Settings::default(),
            told: UserSpecified::default(),
            until: Until::default(),
            patience: PATIENCE,
        }
    }
}

/// Why a folder cannot be watched.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WatchError {
    /// Settings, or what is told of the files.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// There is no such folder.
    #[error("{}: expected a folder", .0.display())]
    NoFolder(PathBuf),
}
