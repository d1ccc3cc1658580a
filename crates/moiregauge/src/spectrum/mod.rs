//! Where a lattice is in the spectrum of an image: transform, peaks, and which of them belong together.

pub(crate) mod error;
pub(crate) mod fourier;
pub(crate) mod hann;
pub(crate) mod harmonics;
pub(crate) mod high_orders;
pub(crate) mod known;
pub(crate) mod lags;
pub(crate) mod look;
pub(crate) mod method;
pub(crate) mod model;
pub(crate) mod noise;
pub(crate) mod noise_map;
pub(crate) mod phases;
pub(crate) mod pictures;
pub(crate) mod prepare;
pub(crate) mod rescue;
pub(crate) mod rivals;
pub(crate) mod select;
pub(crate) mod shells;
pub(crate) mod transform;
pub(crate) mod verdict;

pub use error::LatticeError;
pub use method::Method;
pub use phases::Phases;
pub use pictures::log_power;
