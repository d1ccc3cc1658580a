//! The atoms of a layer in other frames of the same scanner → its calibration.

use std::path::PathBuf;

use moiregauge::calibration::{Calibration, KnownLattice};
use moiregauge::settings::{RulerLayer, Settings};
use moiregauge::spectrum::Method;
use moiregauge_report::results::UserSpecified;

use super::document::Unusable;
use super::run::{CalibrateRequest, NotCalibrated, NotMeasured, calibrate};
use crate::job::Job;
use crate::known::Known;
use crate::names::in_words;
use crate::opened::InputError;

/// Why other frames are no ruler.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NoRuler {
    /// One of them was not measured.
    #[error("{file}")]
    File {
        /// Its name.
        file: String,
        /// Why not.
        source: InputError,
    },
    /// There is no calibration.
    #[error(transparent)]
    NotCalibrated(#[from] NotCalibrated),
    /// It is not to be used.
    #[error("the atoms calibrate nothing: {0}")]
    Unusable(#[from] Unusable),
}

/// The scanner by frames that show the atoms of a layer, at the scan angle of the scans and at another magnification: those of the ruler
/// that the settings name, of layer 2 where they name none. They are read in the channel of the scans. What is told of the size
/// and the part of the scans is not of them.
///
/// The covariance has the strain that the layer may have itself, and the change of the gains with magnification, for x and for y.
///
/// # Errors
/// [`NoRuler`].
pub fn ruler_from(
    files: &[PathBuf],
    told: &UserSpecified,
    settings: &Settings,
    job: &Job,
) -> Result<Calibration, NoRuler> {
    let layers = settings.bilayer();
    let layer = match settings.ruler {
        RulerLayer::First => layers.reference,
        _ => layers.stretched,
    };
    let told = UserSpecified {
        size_nm: None,
        crop: None,
        ..told.clone()
    };
    let request = CalibrateRequest {
        lattice: KnownLattice::of_layer(layer),
        drift_sigma_nm_per_min: settings.drift_prior_nm_per_min,
        settings: Settings {
            channel: settings.channel.clone(),
            image: settings.image,
            line: settings.line,
            background: settings.background,
            method: Method::Lattice,
            ..Settings::default()
        },
    };
    let of_file = |lost: Vec<NotMeasured>| {
        lost.into_iter().next().map(|lost| NoRuler::File {
            file: in_words(&lost.file),
            source: lost.error,
        })
    };
    let (found, lost) =
        calibrate(files, &Known::new(&told, files), &request, job).map_err(|mut why| {
            of_file(std::mem::take(&mut why.failed)).unwrap_or(NoRuler::NotCalibrated(why))
        })?;
    if let Some(why) = of_file(lost) {
        return Err(why);
    }
    found.document()?;
    let mut calibration = found.found.calibration;
    let strain = settings.ruler_strain_percent.powi(2);
    let along = strain + settings.ruler_magnification_percent.powi(2);
    // Of x and of y by itself: half the sum, the difference, twice the shear. A per cent is 10 mrad.
    for (i, variance) in [along / 2.0, 2.0 * along, 200.0 * strain]
        .into_iter()
        .enumerate()
    {
        calibration.covariance[i][i] += variance;
    }
    // Its errors are those at the size of the scans.
    calibration.sizes_nm.clear();
    // A drift that changes bends a small frame as well, and would bend a large one by the square of their sizes.
    calibration.curvature = None;
    Ok(calibration)
}
