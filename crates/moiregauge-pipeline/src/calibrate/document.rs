//! The calibration file: TOML that says what was measured, how, and of which files.

use std::path::Path;

use heterostrain::Estimate;
use moiregauge::calibration::{Calibration, KnownLattice};
use moiregauge_report::results::ResultCaveat;
use serde::{Deserialize, Serialize};

use super::run::CalibrationFound;
use crate::reading::{FileError, read_text};

/// Name and version of the layout.
const SCHEMA: &str = "moiregauge/calibration/1";

const HEAD: &str = "\
#
# What is shown is F times what is true, F = [[1 + s + g/2, c/2], [c/2, 1 + s - g/2]], x to the right, y up:
#   s  gain_percent        lengths are shown too long by this much, mean of x and y
#   g  mismatch_percent    lengths along x are too long by this much more than along y
#   c  orthogonality_mrad  the angle between the axes in the image is 90° less this
# F is symmetric by definition: a known lattice of unknown orientation does not show a turn.
#   curvature, where the position sensors bend: second derivatives of what is shown along x by (xx, xy, yy), then along y, per µm
# covariance is that of (s, g, c) in these units. It holds for scans under the same conditions.

";

/// What stands in the file. Pairs are values with their standard uncertainties.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationDocument {
    /// `moiregauge/calibration/1`.
    pub schema: String,
    /// Version that wrote it.
    pub version: String,
    /// Whether frames told their drift.
    #[serde(default)]
    pub drift_separated: bool,
    /// Of a drift that they could not tell.
    #[serde(default)]
    pub drift_sigma_nm_per_min: f64,
    /// The calibration.
    pub calibration: Calibration,
    /// The lattice that the images show.
    pub known_lattice: KnownLattice,
    /// The sets of scans.
    #[serde(default)]
    pub sets: Vec<CalibratedSetResult>,
    /// The files.
    #[serde(default)]
    pub files: Vec<CalibratedInput>,
    /// Doubts.
    #[serde(default)]
    pub caveats: Vec<ResultCaveat>,
}

/// What one set says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibratedSetResult {
    /// Its name.
    pub name: String,
    /// The channel.
    pub channel: String,
    /// Whether it is in the mean.
    pub used: bool,
    /// Lengths are shown too long by this much.
    pub gain_percent: [f64; 2],
    /// Along x by this much more than along y.
    pub mismatch_percent: [f64; 2],
    /// The axes shown enclose a right angle less this.
    pub orthogonality_mrad: [f64; 2],
    /// Of the known cell's first vector.
    pub orientation_deg: [f64; 2],
    /// Along x and y, where frames tell it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift_nm_per_min: Option<[[f64; 2]; 2]>,
}

/// A file that was measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibratedInput {
    /// Its name.
    pub file: String,
    /// Its hash.
    pub sha256: String,
    /// Its size.
    pub bytes: u64,
}

/// A calibration that nobody could use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Unusable {
    /// Frames of one direction without a line rate.
    #[error(
        "its errors are not known, because the drift cannot be determined from the frames and they have no line rate"
    )]
    NoErrors,
    /// Numbers that make no sense.
    #[error("{0}")]
    Numbers(String),
}

/// Why a calibration file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationFileError {
    /// It cannot be read.
    #[error("cannot read the calibration file {file}")]
    Unreadable {
        /// Its name.
        file: String,
        /// Why not.
        source: FileError,
    },
    /// Not a calibration.
    #[error("in the calibration file {file}")]
    Toml {
        /// Its name.
        file: String,
        /// Where and what.
        source: toml::de::Error,
    },
    /// What stands in it makes no sense.
    #[error("in the calibration file {file}: {reason}")]
    Content {
        /// Its name.
        file: String,
        /// What was expected and what was found.
        reason: String,
    },
}

impl CalibrationFound {
    /// Gain, mismatch (per cent) and deviation from a right angle (mrad); σ is NaN where nobody knows it.
    pub fn estimates(&self) -> [Estimate; 3] {
        self.found.calibration.estimates().map(|e| self.known(e))
    }

    /// By how much lengths are shown too long along x and y, per cent; σ is NaN where nobody knows it.
    pub fn gains(&self) -> [Estimate; 2] {
        let calibration = &self.found.calibration;
        let ([gain, mismatch, _], c) = (calibration.estimates(), &calibration.covariance);
        [1.0, -1.0].map(|sign| {
            let variance = c[0][0] + c[1][1] / 4.0 + sign * c[0][1];
            let value = gain.value + sign * mismatch.value / 2.0;
            self.known(Estimate::from_variance(value, variance))
        })
    }

    fn known(&self, e: Estimate) -> Estimate {
        if self.found.covariance_known {
            e
        } else {
            Estimate::new(e.value, f64::NAN)
        }
    }

    /// What is to be kept of it.
    ///
    /// # Errors
    /// [`Unusable`].
    pub fn document(&self) -> Result<CalibrationDocument, Unusable> {
        let found = &self.found;
        if !found.covariance_known {
            return Err(Unusable::NoErrors);
        }
        if let Some(problem) = found.calibration.problem() {
            return Err(Unusable::Numbers(problem));
        }
        let with_sigma = |e: &Estimate| [e.value, e.sigma];
        let sets = found.sets.iter().map(|set| CalibratedSetResult {
            name: set.name.clone(),
            channel: set.channel.clone(),
            used: set.used,
            gain_percent: with_sigma(&set.estimates[0]),
            mismatch_percent: with_sigma(&set.estimates[1]),
            orthogonality_mrad: with_sigma(&set.estimates[2]),
            orientation_deg: with_sigma(&set.orientation.scaled(1f64.to_degrees())),
            drift_nm_per_min: set.drift.map(|d| d.map(|v| with_sigma(&v.scaled(60.0)))),
        });
        let files = self.files.iter().map(|f| CalibratedInput {
            file: f.file.clone(),
            sha256: f.sha256.clone(),
            bytes: f.bytes,
        });
        Ok(CalibrationDocument {
            schema: SCHEMA.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            drift_separated: found.sets.iter().any(|s| s.drift.is_some()),
            drift_sigma_nm_per_min: self.drift_sigma_nm_per_min,
            calibration: found.calibration.clone(),
            known_lattice: self.lattice.clone(),
            sets: sets.collect(),
            files: files.collect(),
            caveats: found.caveats.iter().map(Into::into).collect(),
        })
    }
}

impl CalibrationDocument {
    /// The file as text: the title and what the numbers mean as comments, then the numbers.
    ///
    /// # Errors
    /// None in practice: every part can be written as TOML.
    pub fn to_toml(&self, title: &str) -> Result<String, toml::ser::Error> {
        Ok(format!("# {title}\n{HEAD}{}", toml::to_string(self)?))
    }
}

/// The calibration in a file.
///
/// # Errors
/// [`CalibrationFileError`].
pub fn read_calibration(path: &Path) -> Result<Calibration, CalibrationFileError> {
    let name = path.display().to_string();
    let text = read_text(path).map_err(|source| CalibrationFileError::Unreadable {
        file: name.clone(),
        source,
    })?;
    let document: CalibrationDocument =
        toml::from_str(&text).map_err(|source| CalibrationFileError::Toml {
            file: name.clone(),
            source,
        })?;
    let wrong = |reason| CalibrationFileError::Content { file: name, reason };
    if document.schema != SCHEMA {
        let found = &document.schema;
        return Err(wrong(format!(
            "expected the schema {SCHEMA:?}, found {found:?}"
        )));
    }
    let lattice = document.known_lattice.problem();
    match document.calibration.problem().or(lattice) {
        Some(problem) => Err(wrong(problem)),
        None => Ok(document.calibration),
    }
}
