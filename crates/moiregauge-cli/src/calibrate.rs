//! `moiregauge calibrate`: images of a known lattice → the calibration of a scanner.

pub(crate) mod file;
mod run;
mod words;

pub(crate) use run::{CalibrateArgs, run};
