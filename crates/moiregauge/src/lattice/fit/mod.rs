//! The lattice fitted to the pixels: harmonics of a two-dimensional lattice on a smooth background.
//!
//! In: an image (binned where the lattice is coarse) and a start. Out: the two wave vectors and their
//! covariance, the harmonics, and how good the fit is. No window and no resampling: every pixel
//! counts the same, which is what reaches the Cramér–Rao bound.
//!
//! Model: `I(n) = b(n) + o(row) + Σ_hk A_hk cos((h q₁ + k q₂)·n + φ_hk) + noise`. Gauss–Newton on
//! (q₁, q₂) with amplitudes and background free in every step (variable projection); harmonics of up
//! to five shells are added where they earn it (BIC with the local noise). Residuals beyond three
//! standard deviations are cut off (Huber) and lines that went wrong are left out.
//!
//! Line offsets o are used where line means scatter more than the noise beside them explains. They
//! are random with the variance found, not free: a line then loses the share λ of its mean, λ → 1 for
//! strong offsets. A harmonic along the fast axis, which free offsets would swallow, keeps the weight
//! 1 − λ that it deserves.
//!
//! Covariance: `(JᵀWJ)⁻¹ Jᵀ W C W J (JᵀWJ)⁻¹` with C diagonal in frequency, read from the residual
//! around each harmonic along either axis.
//!
//! # References
//! Golub and Pereyra, Inverse Problems 19, R1 (2003), variable projection with Kaufman's Jacobian;
//! Huber, Robust Statistics (1981), modified residuals; Schwarz, Ann. Stat. 6, 461 (1978), BIC.

pub(crate) mod bend;
pub(crate) mod bent_waves;
mod cells;
pub(crate) mod choose;
pub(crate) mod closure;
pub(crate) mod first;
pub(crate) mod fit_pixels;
pub(crate) mod fitted;
pub(crate) mod folded;
pub(crate) mod frame;
pub(crate) mod gram;
pub(crate) mod left;
pub(crate) mod leverage;
pub(crate) mod lines;
pub(crate) mod local;
pub(crate) mod measure;
pub(crate) mod model;
pub(crate) mod noise;
pub(crate) mod outcome;
pub(crate) mod places;
pub(crate) mod solve;
pub(crate) mod straight;
pub(crate) mod tables;
pub(crate) mod waves;

pub use bend::Inhomogeneity;
pub use closure::Closure;
pub use fitted::{FittedHarmonic, LatticeFit};
