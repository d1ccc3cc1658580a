//! Maps of the local lattice: twist, strain and wavelength from place to place.
//!
//! In: an image without background, and the lattice of the whole image as a start. Out: local wave
//! vectors on a grid of nodes with their covariance and a mask (pixels), which one linear map takes to the sample.
//!
//! Each harmonic g of the lattice is demodulated with a Gaussian window of width w:
//! `C(r) = Σ_n w(n − r) I(n) e^{−ig·n}`, local wave vector `g + Im(∇C/C)`. Noise of each component:
//! `σ_g = (σ/A)/(2√(πρ) w²)` for a cosine of amplitude A in noise of σ per pixel, ρ pixels per nm².
//! Resolution (full width at half maximum): 2.35 w.
//!
//! # References
//! Phase demodulation: Hÿtch, Snoeck and Kilaas, Ultramicroscopy 74, 131 (1998); for moirés: Benschop et
//! al., Phys. Rev. Research 3, 013153 (2021).

pub(crate) mod cell;
pub(crate) mod combine;
pub(crate) mod defects;
pub(crate) mod demodulate;
pub(crate) mod displacement;
pub(crate) mod drift_change;
pub(crate) mod followed;
pub(crate) mod gauge;
pub(crate) mod local;
pub(crate) mod mosaic;
pub(crate) mod nodes;
pub(crate) mod one_gauge;
#[cfg(test)]
mod pattern_tests;
pub(crate) mod phase_blur;
pub(crate) mod pilot;
pub(crate) mod quantities;
pub(crate) mod register;
pub(crate) mod registry;
pub(crate) mod ruler;
pub(crate) mod sample;
pub(crate) mod scanner;
pub(crate) mod summary;
pub(crate) mod survey;
#[cfg(test)]
pub(crate) mod tests;
pub(crate) mod undistorted;
pub(crate) mod view;
pub(crate) mod waves;

pub use cell::MeanCell;
pub use combine::{Agreement, combine, combine_frames};
pub use drift_change::{DriftChange, drift_change};
pub use gauge::Gauge;
pub use local::local_lattices;
pub use nodes::{Grid, LatticeNode};
pub use quantities::{Plane, TwistStrainMap};
pub use register::{Registration, register};
pub use registry::RegistryMap;
pub use sample::LatticeMap;
pub use summary::Spread;
pub use survey::Survey;
pub use undistorted::Undistorted;
