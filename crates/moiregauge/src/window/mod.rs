//! Waves under a window: demodulation of any waves of an image, node by node, with their noise.
//!
//! What maps of lattices ([`crate::map`]) and of stripes ([`crate::stripes`]) have in common: images levelled, mixed with a
//! carrier, averaged in blocks, smoothed with a Gaussian window, freed of the leaks of other waves, and their noise.

pub(crate) mod blocks;
pub(crate) mod blur;
pub(crate) mod carrier;
pub(crate) mod leaks;
pub(crate) mod lines;
pub(crate) mod mask;
pub(crate) mod mixed;
pub(crate) mod noise;
pub(crate) mod setting;
pub(crate) mod smooth;
pub(crate) mod types;
pub(crate) mod widths;

pub use mask::Mask;
pub use types::{Reference, Resolution, ResolutionError, UsedHarmonic, WaveMap, WaveNode};
