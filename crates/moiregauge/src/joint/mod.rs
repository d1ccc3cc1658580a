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

mod checks;
mod choose;
mod evaluate;
mod instability;
mod link;
mod parts;
mod path;
mod solve;

use nalgebra::{Matrix2, Matrix4, Vector2};

pub use checks::{LeftOut, Resampled};
pub use path::DriftPath;
pub(crate) use solve::foreseen;
pub use solve::{JointFit, TestedTerm, fit};

use crate::lattice::{LatticeVectors, Phases};

/// What one line direction of one scan contributes.
#[derive(Clone, Debug)]
pub struct Sighting {
    /// Which scan it belongs to; sightings of one scan share its time.
    pub scan: usize,
    /// Class of scans that share an offset: fast axis and line direction.
    pub class: usize,
    /// Block of scans whose phases are linked; [`fit`] finds it.
    pub block: usize,
    /// Reciprocal pair as it appeared, sensor coordinates, rad/nm, all sightings labelled alike.
    pub waves: LatticeVectors,
    /// The part of their covariance that comes from the position sensors, (rad/nm)².
    pub sensor: Matrix4<f64>,
    /// Time gradient `u`, s/nm.
    pub time_gradient: Vector2<f64>,
    /// What a relative gain of the fast axis does to a wave vector, `J^{−T} diag(1, 0) Jᵀ`.
    pub fast_gain: Matrix2<f64>,
    /// Time of the middle of the frame, s from any origin.
    pub time: f64,
    /// Position of the middle of the frame, nm.
    pub position: Vector2<f64>,
    /// Phases of K₁, K₂, K₂ − K₁ there, rad; `None` where they cannot be told.
    pub phases: Option<Phases>,
}

/// Which terms a fit has beside lattice and constant drift.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// `½ A t²`.
    pub acceleration: bool,
    /// `C (1 − e^{−t/τ})` with this τ, s.
    pub settling: Option<f64>,
    /// A gain of the fast axis, common to all scans.
    pub fast_gain: bool,
    /// The phases.
    pub phases: bool,
}

#[cfg(test)]
mod tests;
