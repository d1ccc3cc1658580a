//! What one image gives to the joint fit.

use heterostrain::lattice::Waves;
use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::spectrum::phases::Phases;

/// What one line direction of one scan contributes.
#[derive(Clone, Debug)]
pub struct Detection {
    /// Which scan it belongs to; those of one scan are of about one time.
    pub scan: usize,
    /// Class of scans that share an offset: fast axis and line direction.
    pub class: usize,
    /// Block of scans whose phases are linked; `fit` finds it.
    pub block: usize,
    /// Reciprocal pair as it appeared, sensor coordinates, rad/nm, all sightings labelled alike.
    pub waves: Waves,
    /// The part of their covariance that comes from the position sensors, (rad/nm)².
    pub sensor: Matrix4<f64>,
    /// Time gradient `u`, s/nm.
    pub time_gradient: Vector2<f64>,
    /// What a relative gain of the fast axis does to a wave vector, `J^{−T} diag(1, 0) Jᵀ`.
    pub fast_gain: Matrix2<f64>,
    /// Time of the middle of what was used of the frame, s from any origin.
    pub time: f64,
    /// Its position, nm.
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
