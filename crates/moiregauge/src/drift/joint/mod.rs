//! One fit over all scans: lattice, drift, and what else earns its place.
//!
//! Every image gives two things: its reciprocal lattice as it appeared, and the phases of its first
//! harmonics at the middle of the frame. For drift `d(t)` with velocity `D_i = d'(t_i)`,
//!   `K_i = G − u_i (D_i·G)` (exact for constant drift within a frame), and
//!   `Φ_ih = G_h·(r_i − d(t_i) − o_class) + φ_h`,
//! with `r_i` the position of the middle in sensor coordinates, `φ_h` the phase of the harmonic on the
//! sample and o an offset for each class of scans (fast axis, trace or retrace), since a detection
//! delay shifts an image along its fast axis. Wave vectors see the drift within a frame; phases see
//! the displacement from frame to frame and are a hundred times more sensitive.
//!
//! Phases help as far as clocks and sensors allow: frame times are uncertain nuisance parameters, the
//! scatter of the phases about the fit is counted as instability of the positions, and frames are
//! linked only over pauses in which the sample cannot have gone unnoticed by a lattice cell: `φ_h` is
//! one set of constants for each block of linked frames.
//!
//! Units nm, s, rad. Reciprocal pairs stand at 60°: harmonics K₁, K₂, K₂ − K₁.

pub(crate) mod arrow;
pub(crate) mod checks;
pub(crate) mod choose;
pub(crate) mod evaluate;
pub(crate) mod found;
pub(crate) mod instability;
pub(crate) mod link;
pub(crate) mod parts;
pub(crate) mod path;
pub(crate) mod shape;
pub(crate) mod sighting;
pub(crate) mod solve;
pub(crate) mod sums;
#[cfg(test)]
mod tests;

pub use checks::{LeftOut, Resampled};
pub use choose::fit;
pub use found::{JointFit, TestedTerm};
pub use path::DriftPath;
pub use sighting::{Detection, Terms};
