//! Analysis of all scans together: sets, drift, the joint fit, and the use of atomic images or of a known surface.
//!
//! In: measured scans ([`crate::scan`]). Out: an [`Analysis`]; or the orientation of a layer ([`atomic_orientation`]), or the
//! calibration of a scanner ([`calibrate`]).

pub(crate) mod alike;
pub(crate) mod analyse;
pub(crate) mod analysis;
pub(crate) mod atomic;
pub(crate) mod calibrate;
pub(crate) mod calibrate_doubts;
pub(crate) mod combine;
pub(crate) mod curvature;
pub(crate) mod grains;
pub(crate) mod group;
pub(crate) mod identity;
pub(crate) mod illustrate;
pub(crate) mod means;
pub(crate) mod motion;
pub(crate) mod naming;
pub(crate) mod samples;
pub(crate) mod set;
pub(crate) mod shells;
pub(crate) mod sightings;
pub(crate) mod totals;

pub use crate::caveat::drifting::AssumedDrift;
pub use analyse::{analyse, is_nothing_left, refusal};
pub use analysis::{Analysis, AtomicOrientation, LineAnalysis, Ruled, ScanAnalysis, SetAnalysis};
pub use atomic::{AtomicError, atomic_orientation};
pub use calibrate::{Calibrated, CalibratedSet, calibrate};
pub use calibrate_doubts::CalibrateError;
pub use grains::grains;
pub use group::natural_order;
pub use identity::about_repeat;
pub use illustrate::{amplitude_of, illustrate, picture};
pub use means::{Checks, Combined, Consistency, Residual, Scatter, SetLattice, SetMean};
pub use motion::{Drift, DriftFit, JointTerms, Motion};
