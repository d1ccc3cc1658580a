//! Why nothing comes out.

use std::fmt;

use moiregauge::campaign::AtomicError;
use moiregauge_report::FailedInput;

use crate::job::Cancelled;
use crate::opened::InputError;

/// Why an analysis has no outcome.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnalyseError {
    /// It was stopped; what was measured is kept.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// No file could be measured.
    #[error("nothing could be analysed")]
    Nothing {
        /// Why not, file by file.
        failed: Vec<FailedInput>,
    },
    /// Only what all scans show was to be used.
    #[error("the scans have no region in common")]
    NoCommonRegion {
        /// What failed beside that.
        failed: Vec<FailedInput>,
    },
    /// Every scan was left out.
    #[error("{0}")]
    NothingLeft(String),
    /// A file beside the scans cannot be used.
    #[error("{file}")]
    Beside {
        /// What it is for.
        place: Place,
        /// Its name.
        file: String,
        /// Why not.
        source: InputError,
    },
    /// The image of a larger area.
    #[error("{file}: it has no image with a size and a position")]
    NoPicture {
        /// Its name.
        file: String,
    },
    /// The images of the atoms.
    #[error(transparent)]
    Atomic(#[from] AtomicError),
    /// The images of the atoms have no error that could be known.
    #[error("the images do not show the orientation")]
    NoOrientation,
    /// The settings, with what the images of the atoms told.
    #[error(transparent)]
    Settings(#[from] moiregauge::settings::SettingsError),
}

impl AnalyseError {
    /// Whether it is the scans that show nothing.
    pub fn is_of_scans(&self) -> bool {
        matches!(self, Self::Nothing { .. } | Self::NoCommonRegion { .. })
    }
}

/// What a file beside the scans is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Place {
    /// An image of the atoms.
    Atomic,
    /// The image of a larger area.
    Survey,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Atomic => "image of the atoms",
            Self::Survey => "image of a larger area",
        })
    }
}
