//! The strain gauge for moiré superlattices: [`spmfile::Scan`] → numbers.
//!
//! No files, no clock, no printing. Inside: nm, s, rad; x right, y up, angles counter-clockwise.

pub mod analysis;
pub mod background;
pub mod bound;
pub mod budget;
pub mod calibration;
pub mod caveat;
pub mod cell;
mod chi2;
pub mod domains;
pub mod drift;
pub mod estimate;
pub mod geometry;
pub mod image;
pub mod joint;
pub mod lattice;
pub mod map;
pub mod material;
pub mod plan;
pub mod readings;
pub mod region;
pub mod resample;
pub mod rng;
pub mod series;
pub mod settings;
pub mod simulate;
pub mod strain;
pub mod words;

/// The example of the README, compiled.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
