//! `moiregauge calibrate`: images of a known lattice → the calibration of a scanner.

mod run;
mod words;

pub(crate) use run::{CalibrateArgs, run};
