//! Images of a known lattice, measured → the calibration.

use std::path::{Path, PathBuf};

use heterostrain::material::Material;
use moiregauge::calibration::KnownLattice;
use moiregauge::campaign::{CalibrateError, Calibrated};
use moiregauge::numbers::interrupt;
use moiregauge::scan::{MeasureError, MeasuredScan, measure_known};
use moiregauge::settings::{Grouping, Settings, SettingsError};
use moiregauge_report::InputFile;
use nalgebra::Matrix2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::campaign::given_again;
use crate::job::{Cancelled, Job};
use crate::known::Known;
use crate::opened::{InputError, Reading, read_scan};
use crate::twice::distinct;

/// Drifts that frames cannot tell, nm/min.
const DRIFT_SIGMA: [f64; 2] = [0.0, 1e6];

/// What the images show, and how they are read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CalibrateRequest {
    /// The lattice.
    pub lattice: KnownLattice,
    /// Standard deviation of each component of a drift that the frames cannot tell.
    pub drift_sigma_nm_per_min: f64,
    /// Channel, image, line directions and background; the other settings are of no meaning here.
    pub settings: Settings,
}

impl Default for CalibrateRequest {
    /// Graphite, in the usual channel.
    fn default() -> Self {
        let graphite = KnownLattice::named("graphite");
        let graphene = || KnownLattice::of_layer(&Material::graphene());
        Self {
            lattice: graphite.unwrap_or_else(graphene),
            drift_sigma_nm_per_min: 1.0,
            settings: Settings::default(),
        }
    }
}

impl CalibrateRequest {
    /// Refuses what cannot be calibrated with.
    ///
    /// # Errors
    /// The first number that makes no sense, by its name.
    pub fn check(&self) -> Result<(), SettingsError> {
        self.settings.check()?;
        if let Some(reason) = self.lattice.problem() {
            let setting = "lattice";
            return Err(SettingsError { setting, reason });
        }
        let [low, high] = DRIFT_SIGMA;
        let sigma = self.drift_sigma_nm_per_min;
        if !(low..=high).contains(&sigma) {
            return Err(SettingsError {
                setting: "drift_sigma_nm_per_min",
                reason: format!(
                    "drift_sigma_nm_per_min: expected a number from {low} to {high:e}, found {sigma}"
                ),
            });
        }
        Ok(())
    }
}

/// A surface or a layer by its name, one of the user's `own` layers first.
pub fn known_lattice(name: &str, own: &[Material]) -> Option<KnownLattice> {
    let of_user = own
        .iter()
        .find(|m| m.name.eq_ignore_ascii_case(name.trim()));
    if let Some(layer) = of_user {
        return Some(KnownLattice::of_layer(layer));
    }
    let layer = || Some(KnownLattice::of_layer(&Material::named(name)?));
    KnownLattice::named(name).or_else(layer)
}

/// A calibration and what it is of.
#[derive(Clone, Debug)]
pub struct CalibrationFound {
    /// The calibration, the sets behind it, and doubts.
    pub found: Calibrated,
    /// The lattice.
    pub lattice: KnownLattice,
    /// Of a drift that the frames could not tell.
    pub drift_sigma_nm_per_min: f64,
    /// The files that were measured.
    pub files: Vec<InputFile>,
}

/// A file that was not measured.
#[derive(Debug)]
pub struct NotMeasured {
    /// Its name.
    pub file: PathBuf,
    /// Why not.
    pub error: InputError,
}

impl NotMeasured {
    /// Whether it was read and shows no lattice of about that size.
    pub fn shows_none(&self) -> bool {
        matches!(
            self.error,
            InputError::Measure(MeasureError::Lattice { .. })
        )
    }
}

/// No calibration.
#[derive(Debug, thiserror::Error)]
#[error("{why}")]
pub struct NotCalibrated {
    /// Why not.
    #[source]
    pub why: WhyNotCalibrated,
    /// Files that were not measured.
    pub failed: Vec<NotMeasured>,
}

/// Why there is no calibration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WhyNotCalibrated {
    /// It was stopped.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A number of the request.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Its two vectors are parallel.
    #[error("the vectors of the known lattice are parallel; expected two different directions")]
    NoArea,
    /// No file.
    #[error("no image could be read, so the lattice of {0} cannot be found")]
    NothingRead(String),
    /// No lattice.
    #[error("no image shows the lattice of {0}")]
    NotSeen(String),
    /// What the images show does not belong together.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
}

impl From<WhyNotCalibrated> for NotCalibrated {
    fn from(why: WhyNotCalibrated) -> Self {
        let failed = Vec::new();
        Self { why, failed }
    }
}

/// Measures images of a known lattice, at any orientation, and what is left against it: the distortion of the
/// scanner. Frames up and down (or of both slow axes, or of two line rates) separate the drift. Beside the calibration
/// come the files that were not measured.
///
/// # Errors
/// [`NotCalibrated`].
///
/// ```no_run
/// use moiregauge_pipeline::calibrate::{CalibrateRequest, calibrate};
/// use moiregauge_pipeline::{Job, Known};
///
/// let files = ["up.spm", "down.spm"].map(Into::into);
/// let (found, failed) = calibrate(&files, &Known::default(), &CalibrateRequest::default(), &Job::quiet(None)?)?;
/// println!("gain {} %, {} files not used", found.found.calibration.gain_percent, failed.len());
/// std::fs::write("scanner.toml", found.document()?.to_toml("Calibration of a scanner.")?)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn calibrate(
    files: &[PathBuf],
    known: &Known,
    request: &CalibrateRequest,
    job: &Job,
) -> Result<(CalibrationFound, Vec<NotMeasured>), NotCalibrated> {
    let lattice = &request.lattice;
    let cell = lattice.cell().ok_or(WhyNotCalibrated::NoArea)?;
    request.check().map_err(WhyNotCalibrated::Settings)?;
    let (inputs, repeated) = distinct(files);
    let stage = job.stage("measuring", "scans", inputs.len());
    let one = |path: &PathBuf| {
        interrupt::check();
        let result = measured(path, &request.settings, known, &cell);
        stage.step();
        result
    };
    let all: Vec<_> = job
        .run(|| inputs.par_iter().map(one).collect())
        .map_err(WhyNotCalibrated::Cancelled)?;
    drop(stage);
    let (mut scans, mut files, mut failed) = (Vec::new(), Vec::new(), Vec::new());
    for (path, result) in inputs.iter().zip(all) {
        match result {
            Ok((scan, file)) => {
                scans.push(scan);
                files.push(file);
            }
            Err(error) => failed.push(NotMeasured {
                file: path.clone(),
                error,
            }),
        }
    }
    let not = |why, failed| Err(NotCalibrated { why, failed });
    if scans.is_empty() {
        let name = lattice.name.clone();
        return if failed.iter().any(NotMeasured::shows_none) {
            not(WhyNotCalibrated::NotSeen(name), failed)
        } else {
            not(WhyNotCalibrated::NothingRead(name), failed)
        };
    }
    let sigma = request.drift_sigma_nm_per_min / 60.0;
    let together = || moiregauge::campaign::calibrate(scans, lattice, sigma, Grouping::Auto);
    let mut found = match job.run(together) {
        Ok(Ok(found)) => found,
        Ok(Err(why)) => return not(why.into(), failed),
        Err(cancelled) => return not(cancelled.into(), failed),
    };
    found.caveats.extend(given_again(&repeated));
    let found = CalibrationFound {
        found,
        lattice: lattice.clone(),
        drift_sigma_nm_per_min: request.drift_sigma_nm_per_min,
        files,
    };
    Ok((found, failed))
}

/// One image of the known cell.
fn measured(
    path: &Path,
    settings: &Settings,
    known: &Known,
    cell: &Matrix2<f64>,
) -> Result<(MeasuredScan, InputFile), InputError> {
    let Reading {
        scan,
        input,
        caveats,
    } = read_scan(path, settings, known)?;
    let mut measured = measure_known(&input.file, &scan, settings, cell)?;
    measured.caveats.extend(caveats);
    measured.digest = Some(input.sha256.clone());
    Ok((measured, input))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_and_layers_have_names() {
        let named = |name| known_lattice(name, &[]).unwrap();
        assert_eq!(named("Si111-7x7").a_nm, 2.688);
        assert_eq!(named("hbn").a_nm, 0.2504);
        // Not all layers are hexagonal.
        let telluride = named("WTe2 1T'");
        assert_eq!(telluride.angle_deg, 90.0);
        assert!(telluride.b_nm > 1.7 * telluride.a_nm);
        let mine = Material {
            name: "graphite".to_owned(),
            lattice_constant_nm: 0.2461,
            ..Material::graphene()
        };
        assert_eq!(known_lattice("graphite", &[mine]).unwrap().a_nm, 0.2461);
        assert_eq!(known_lattice("cheese", &[]), None);
    }

    #[test]
    fn requests_are_checked_before_any_file() {
        let job = Job::quiet(Some(1)).unwrap();
        let of = |request| {
            calibrate(&[], &Known::default(), &request, &job)
                .unwrap_err()
                .why
        };
        let nan = CalibrateRequest {
            drift_sigma_nm_per_min: f64::NAN,
            ..CalibrateRequest::default()
        };
        assert!(matches!(of(nan), WhyNotCalibrated::Settings(_)));
        assert!(matches!(
            of(CalibrateRequest::default()),
            WhyNotCalibrated::NothingRead(name) if name == "graphite"
        ));
    }
}
