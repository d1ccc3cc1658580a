//! Motion of the sample while it is scanned.
//!
//! A feature R sits at `R + d(t)` in sensor coordinates and is recorded where the tip is at that
//! time. For constant drift `d = D t` and a time gradient u (s/nm) in the image plane,
//! `R = (I − D uᵀ) r` exactly, on any sheared frame, for any fast axis, up or down, trace or retrace.
//! So every observed lattice vector is linear in the unknowns,
//!   `r_ij = R_j + t_ij D`, `t_ij = u_i·r_ij`,
//! and two lattice vectors and the drift are one linear least-squares problem over all scans.
//!
//! Units nm, s; D is the velocity of the sample in the frame of the sensors.

pub(crate) mod drawn;
pub(crate) mod joint;
pub(crate) mod linear;
pub(crate) mod monte_carlo;
pub(crate) mod paper;
pub(crate) mod shares;

pub use drawn::DriftMonteCarlo;
pub use joint::{Detection, DriftPath, JointFit, LeftOut, Resampled, Terms, TestedTerm, fit};
pub use linear::{DriftError, DriftSolution, Observation, solve};
pub use monte_carlo::monte_carlo;
pub use shares::Statistical;
