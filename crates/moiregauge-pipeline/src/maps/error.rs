//! Why there is no map.

use std::path::PathBuf;

use moiregauge::settings::SettingsError;
use moiregauge::survey::{StripeError, SurveyError};
use moiregauge_report::FailedInput;
use spmfile::ReadError;

use super::ask::{NameTwice, OutsideOfMap};
use crate::campaign::AnalyseError;
use crate::job::Cancelled;
use crate::known::KnownError;
use crate::opened::InputError;
use crate::reading::FileError;
use crate::sink::SinkError;

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NotMapped {
    /// It was stopped; what was measured is kept.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A number of the request.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Two regions or two lines of one name.
    #[error(transparent)]
    NameTwice(#[from] NameTwice),
    /// A region or line beyond the map.
    #[error(transparent)]
    Outside(#[from] OutsideOfMap),
    /// Maps are made of one moiré.
    #[error("maps are made of one moiré, found {0}")]
    SeveralMoires(usize),
    /// The scans show no lattice.
    #[error("{why}")]
    NoLattice {
        /// What the analysis says.
        #[source]
        why: Box<AnalyseError>,
        /// Why stripes that one of them shows are not mapped either.
        stripes: Option<Box<NoStripes>>,
    },
    /// The scans cannot be analysed.
    #[error(transparent)]
    Analyse(Box<AnalyseError>),
    /// Every scan was left out.
    #[error("{0}")]
    NothingLeft(String),
    /// No image gave a map.
    #[error("no image gave a map")]
    Nothing {
        /// Why not, file by file.
        failed: Vec<FailedInput>,
    },
    /// Sets beside images that lie side by side.
    #[error("images that are mapped in bands lie side by side in one map and form no sets")]
    SetsInBands,
    /// A large image.
    #[error("{}", file.display())]
    Band {
        /// Its name.
        file: PathBuf,
        /// Why not.
        source: Box<NoBands>,
    },
    /// The map cannot be written.
    #[error(transparent)]
    Sink(#[from] SinkError),
}

/// Why an image cannot be mapped in bands.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NoBands {
    /// It cannot be read.
    #[error(transparent)]
    Input(#[from] InputError),
    /// It does not hold what was told of it.
    #[error(transparent)]
    Known(#[from] KnownError),
    /// Its header.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Its bytes.
    #[error(transparent)]
    File(#[from] FileError),
    /// Position sensors were given.
    #[error(
        "an image that is mapped in bands has nominal positions; position sensors are not used"
    )]
    Sensors,
    /// It has no size.
    #[error("the file gives no scan size")]
    NoSize,
    /// It has no image, or no lines.
    #[error("{0}")]
    Nothing(&'static str),
    /// Its lattice.
    #[error(transparent)]
    Survey(#[from] SurveyError),
    /// Finished bands cannot be kept.
    #[error(transparent)]
    Sink(#[from] SinkError),
}

/// Why stripes are not mapped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NoStripes {
    /// There are several files.
    #[error("no scan shows a lattice. A map of stripes is made from one file, found {0} files")]
    SeveralFiles(usize),
    /// Questions that need twist and strain.
    #[error(
        "{} shows stripes and no lattice. Regions, profiles, devices and tiles need twist and strain, which one wave \
         vector does not determine",
        .0.display()
    )]
    NoTwist(PathBuf),
    /// It cannot be read.
    #[error(transparent)]
    Input(#[from] InputError),
    /// Waves that are no stripes.
    #[error("{}", file.display())]
    Stripes {
        /// Its name.
        file: PathBuf,
        /// Why not.
        source: StripeError,
    },
}
