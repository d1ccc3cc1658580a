//! The figures, one short file each: an analysis goes in, an SVG and its caption come out.
//!
//! A figure whose data are absent is left out and says why. Marker and colour of each lattice
//! vector, and filled symbols for up scans, open ones for down scans, are the same everywhere.

mod all;
mod amplitude;
mod budget;
mod cell;
mod comparison;
mod curved;
mod drift;
mod error_relation;
mod figure;
mod layout;
mod map;
mod map_domains;
mod map_fields;
mod map_histograms;
mod map_image;
mod map_mask;
mod map_panel;
mod map_pattern;
mod map_profiles;
mod map_stripes;
mod parameters;
mod picture;
mod pulls;
mod residuals;
mod scan;
mod sensor_line;
mod sets;
mod subject;
mod survey;
mod transforms;
mod twist_strain;
mod twist_wavelength;
mod velocities;
mod wavelengths;
mod wavelengths_nominal;
mod window;

pub use all::figures;
pub use cell::cell as cell_figure;
pub use figure::{Drawing, Figure};
pub use map::map_figures;
pub use map_stripes::stripe_figures;
pub use pulls::pulls;
