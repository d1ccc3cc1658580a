//! Doubts about a calibration, and what keeps one from being made.

use nalgebra::Vector2;

use crate::calibration::{Calibration, Shown};
use crate::campaign::atomic::AMBIGUOUS;
use crate::caveat::Caveat;
use crate::caveat::calibrating::CalibrationDoubt;
use crate::caveat::sets::{Scattered, SetDoubt};

/// χ²/dof of a set or between sets beyond which its scatter deserves a word: errors wrong by 1.4.
const LARGE_CHI2: f64 = 2.0;

/// Whether a scanner can be like that.
pub(crate) fn about_plausibility(
    calibration: &Calibration,
    known: bool,
    caveats: &mut Vec<Caveat>,
) {
    if let Some(problem) = calibration.problem() {
        caveats.push(Caveat::new(
            CalibrationDoubt::Implausible { reason: problem },
            "calibration",
        ));
    } else if let Some(what) = calibration.unusual().filter(|_| known) {
        caveats.push(Caveat::new(
            CalibrationDoubt::Unusual { what },
            "calibration",
        ));
    }
}

/// Whether the sets scatter more than their errors say.
pub(crate) fn about_differences(chi2: f64, freedom: usize, caveats: &mut Vec<Caveat>) {
    if freedom > 0 && chi2 / freedom as f64 > LARGE_CHI2 {
        let times = (chi2 / freedom as f64).sqrt();
        let doubt = CalibrationDoubt::SetsDiffer { times };
        caveats.push(Caveat::new(doubt, "calibration"));
    }
}

pub(crate) fn about_scatter(name: &str, chi2: f64, freedom: usize, caveats: &mut Vec<Caveat>) {
    if freedom > 0 && chi2 / freedom as f64 > LARGE_CHI2 {
        caveats.push(Caveat::new(
            SetDoubt::Scatter {
                of: Scattered::KnownLattice,
                chi2_per_dof: chi2 / freedom as f64,
                share: None,
            },
            name,
        ));
    }
}

pub(crate) fn about_name(name: &str, found: &Shown, caveats: &mut Vec<Caveat>) {
    if found.next_distortion < found.distortion + AMBIGUOUS {
        caveats.push(Caveat::new(
            CalibrationDoubt::Ambiguous {
                distortion: found.distortion,
                next: found.next_distortion,
            },
            name,
        ));
    }
}

/// Frames of one direction: what drift may have done.
pub(crate) fn about_drift(
    name: &str,
    gradient: Option<Vector2<f64>>,
    drift_sigma: f64,
    caveats: &mut Vec<Caveat>,
) {
    caveats.push(Caveat::new(
        CalibrationDoubt::DriftNotSeparated {
            gradient: gradient.map(|u| u.norm()),
            sigma: drift_sigma,
        },
        name,
    ));
}

/// Why scans give no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrateError {
    /// Nothing to measure.
    #[error("no scan can be used")]
    Nothing,
    /// A cell without area.
    #[error(
        "the known lattice has no area: expected two lengths > 0 and an angle between 0° and 180°"
    )]
    Cell,
    /// Sensors in some scans only.
    #[error(
        "some scans have position sensors and some have not. Calibrate them in two runs: a calibration holds for one \
         kind only"
    )]
    Mixed,
    /// Frames up and down that contradict each other.
    #[error(
        "{set}: with no constant drift do the frames up and down show the same lattice (they differ by \
         {misfit_percent:.0} %). Either one of them shows another lattice, or the drift changed or was too large \
         within a frame. Scan faster lines or smaller frames"
    )]
    Drift {
        /// The set.
        set: String,
        /// What the best drift leaves, as a share of the lattice vectors, per cent.
        misfit_percent: f64,
    },
    /// The vectors of a set cannot be used.
    #[error("{0}: the lattice of these scans cannot be compared with the known one")]
    Lattice(String),
}
