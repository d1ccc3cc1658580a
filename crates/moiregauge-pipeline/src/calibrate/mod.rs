//! Images of a known lattice → gain, mismatch and orthogonality of the scanner.

mod document;
mod ruler;
mod run;

pub use document::{
    CalibratedInput, CalibratedSetResult, CalibrationDocument, CalibrationFileError, Unusable,
    read_calibration,
};
pub use ruler::{NoRuler, ruler_from};
pub use run::{
    CalibrateRequest, CalibrationFound, NotCalibrated, NotMeasured, WhyNotCalibrated, calibrate,
    known_lattice,
};
