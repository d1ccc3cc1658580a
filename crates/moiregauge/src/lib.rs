//! The strain gauge for moiré superlattices: [`spmfile::Scan`] → numbers.
//!
//! No files, no clock, no printing. Inside: nm, s, rad; x right, y up, angles counter-clockwise.

pub mod calibration;
pub mod campaign;
pub mod caveat;
pub mod domains;
pub mod drift;
pub mod frame;
pub mod lattice;
pub mod map;
pub mod meaning;
pub mod numbers;
pub mod plan;
pub mod region;
pub mod scan;
pub mod settings;
pub mod simulate;
pub mod spectrum;
pub mod stripes;
pub mod survey;
pub mod window;

/// The example of the README, compiled.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
