//! Lattice vectors of one image.
//!
//! In: an image and its geometry. Out: two primitive vectors with their covariance, in pixels. The
//! image is a lattice of pixels under an affine map, so the lattice is measured in pixels and the
//! vectors are mapped; nothing is resampled (but by the published method, for reproduction).

pub(crate) mod autocorrelation;
pub(crate) mod beside;
pub(crate) mod by_hand;
pub(crate) mod common;
pub(crate) mod find;
pub(crate) mod fit;
pub(crate) mod fourier;
pub(crate) mod ground;
pub(crate) mod lag_noise;
pub(crate) mod measure;
pub(crate) mod measured;
pub(crate) mod paper;
pub(crate) mod predicted;
pub(crate) mod several;
pub(crate) mod start;

pub use crate::explain::beside::WaveBeside;
pub use common::Common;
pub use find::measure;
pub use fit::{Closure, FittedHarmonic, Inhomogeneity, LatticeFit};
pub use measured::{Atoms, Candidate, Evidence, MeasuredLattice};
pub use paper::PublishedPeaks;
pub use several::measure_several;
pub use start::Start;
