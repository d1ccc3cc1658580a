//! Doubts about the calibration of the scanner.

use crate::calibration::Coordinates;
use crate::caveat::explained::explain;

/// The calibration of the scanner.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationDoubt {
    /// Sensors were calibrated and nominal coordinates are used, or the other way round.
    #[error(
        "lengths and strain may be wrong by several per cent: the calibration was made with {}, but the scan has {}. \
         Calibrate with images of the same kind",
        coordinates(*.calibrated), other_than(*.calibrated)
    )]
    OfOtherCoordinates {
        /// What was calibrated.
        calibrated: Coordinates,
    },
    /// The scan is far from the conditions of the calibration.
    #[error(
        "the errors lack the change of hysteresis, creep and lag with size and rate: the {} of the scan differs by \
         more than a factor of {factor} from that of the calibration images. Calibrate with images like the scans",
        conditions(*.size, *.line_rate)
    )]
    Extrapolated {
        /// Whether the size is another one.
        size: bool,
        /// Whether the line rate is another one.
        line_rate: bool,
        /// By more than this factor.
        factor: f64,
    },
    /// The sets of known lattices do not agree.
    #[error(
        "the errors were enlarged, since the sets differ {times:.1} times more than their errors allow. Possible \
         causes: lag or hysteresis of the fast axis, a drift that changes, strain of the sample"
    )]
    SetsDiffer {
        /// Root of χ² per degree of freedom.
        times: f64,
    },
    /// No scanner is like that.
    #[error("the calibration was not used, since it is not plausible for a scanner: {reason}")]
    Implausible {
        /// What is beyond all scanners.
        reason: String,
    },
    /// Few scanners are like that.
    #[error(
        "the calibration may be wrong: a scanner rarely has a {what}. Check that the images show the known lattice and \
         that their size is right"
    )]
    Unusual {
        /// What is rare, with its number.
        what: String,
    },
    /// Two names of the vectors explain the image about as well.
    #[error(
        "the calibration may be wrong: two assignments of the lattice vectors explain the image, with similar \
         distortions ({:.1} % and {:.1} % between two axes). The smaller one was taken. Take frames up and down",
        200.0 * .distortion, 200.0 * .next
    )]
    Ambiguous {
        /// |q|/|p| of the name that is taken.
        distortion: f64,
        /// That of the next one.
        next: f64,
    },
    /// Frames of one slow direction do not tell drift from gain.
    #[error(
        "gain of the slow axis and shear contain the drift, since all frames have the same slow direction. {}. Take \
         frames up and down",
        what_drift_does(*.gradient, *.sigma)
    )]
    DriftNotSeparated {
        /// Size of the time gradient, s/nm; `None` without a line rate.
        gradient: Option<f64>,
        /// Standard deviation of the drift that is assumed, nm/s.
        sigma: f64,
    },
}

fn coordinates(of: Coordinates) -> &'static str {
    match of {
        Coordinates::Sensors => "position sensors",
        Coordinates::Nominal => "nominal coordinates",
    }
}

fn other_than(of: Coordinates) -> &'static str {
    coordinates(match of {
        Coordinates::Sensors => Coordinates::Nominal,
        Coordinates::Nominal => Coordinates::Sensors,
    })
}

fn conditions(size: bool, line_rate: bool) -> &'static str {
    match (line_rate, size) {
        (true, true) => "size and line rate",
        (true, false) => "line rate",
        _ => "size",
    }
}

fn what_drift_does(gradient: Option<f64>, sigma: f64) -> String {
    let per_minute = sigma * 60.0;
    match gradient {
        Some(gradient) => format!(
            "A drift of 1 nm/min makes {:.2} % along the slow axis, or {:.1} mrad of shear. The errors assume a drift \
             of 0 ± {per_minute} nm/min",
            100.0 * gradient / 60.0,
            1000.0 * gradient / 60.0
        ),
        None => "The line rate is not known, so the size of this effect is not known, and it is not in the errors"
            .to_owned(),
    }
}

explain! { CalibrationDoubt:
    OfOtherCoordinates "calibration-of-other-coordinates" Serious
        "The scanner was calibrated by its position sensors and the scan has none, or the other way round. The \
         correction does not apply to this scan. Lengths and strain may be wrong by several per cent."
        "Calibrate with images of the same kind as the scans: both with position sensors, or both without."
    Extrapolated "calibration-extrapolated" Warning
        "The size or line rate of the scan is far from that of the calibration. Hysteresis, creep and lag change with \
         size and rate; this change is not in the errors."
        "Calibrate with images of about the size and line rate of the scans."
    SetsDiffer "calibrations-differ" Warning
        "The sets of images of the known lattice give calibrations that differ by more than their errors. The errors of \
         the mean were enlarged to match."
        "Take more sets, at other places and with the axes exchanged, and look for the set that stands out."
    Implausible "calibration-implausible" Serious
        "The calibration is not plausible for a scanner, or too uncertain. It is not used."
        "Check that the images show the lattice that was named, that their size is right, and that there are frames up \
         and down."
    Unusual "calibration-unusual" Warning
        "The calibration is possible but unusual. Often the reason is that the images show another lattice, or that \
         their size is wrong."
        "Compare the period with that of the known lattice, and repeat the calibration at another place."
    Ambiguous "calibration-ambiguous" Warning
        "Two assignments of the lattice vectors explain the images, with similar distortions. The smaller distortion \
         was taken. It may be the wrong one."
        "Take frames up and down, or faster and smaller ones, so that drift distorts them less."
    DriftNotSeparated "drift-not-separated" Warning
        "All frames have the same slow direction. There, drift looks like a wrong gain or a shear of the scanner. If \
         the line rate is known, the errors include an assumed drift."
        "Take frames up and down of the known lattice."
}
