//! Lattices of stacked two-dimensional crystals: from moiré vectors to twist and heterostrain, with errors.
//!
//! Two layers of graphene, turned against each other by about a degree and one of them stretched by a fraction of a per cent,
//! show a moiré of some ten nanometres. Its two vectors are four numbers; so are the twist θ, the orientation α of the
//! lower layer and the strain vector `E = ε e^{2iφ}` of the upper one. This crate goes from the one to the other
//! in closed form, forwards and backwards, and takes the covariance along.
//!
//! ```
//! use heterostrain::strain::{StrainConvention, twist_strain};
//! use heterostrain::{Lattice, Material};
//! use nalgebra::{Matrix2, Matrix4};
//!
//! // Two moiré vectors as columns, nm, each component known to 0.02 nm.
//! let vectors = Matrix2::new(12.9, 6.1, 0.4, 11.5);
//! let lattice = Lattice::new(vectors, Matrix4::identity() * 0.02 * 0.02);
//! let found = twist_strain(&lattice, &Material::graphene(), StrainConvention::RealSpace)?;
//! let (twist, strain) = (found.twist(), found.heterostrain());
//! assert!((twist.value.to_degrees() - 1.09).abs() < 0.05);
//! assert!(twist.sigma.to_degrees() < 0.01 && strain.value < 0.01);
//! # Ok::<(), heterostrain::strain::StrainError>(())
//! ```
//!
//! What a pair of vectors is, is in its type: a lattice is no reciprocal lattice, and pixels are no nanometres.
//!
//! ```compile_fail
//! # use heterostrain::Lattice;
//! # use nalgebra::Matrix2;
//! let lattice: Lattice = Lattice::exact(Matrix2::new(12.9, 6.1, 0.4, 11.5));
//! let waves = lattice.waves().unwrap();
//! waves.waves(); // reciprocal vectors have no reciprocal vectors but those of `waves.lattice()`
//! ```
//!
//! Units: nm, rad, strain without dimension; x right, y up, angles counter-clockwise. No files, no threads, no random numbers: who
//! draws brings them along ([`strain::draws`]).
//!
//! | module | holds |
//! | --- | --- |
//! | [`lattice`] | two vectors with their covariance, real and reciprocal; names of vectors; the cell |
//! | [`material`] | atomic layers and pairs of them |
//! | [`strain`] | twist and strain of a moiré, all its solutions, the whole tensor where an orientation is known |

mod complex_pair;
mod estimate;
pub mod lattice;
pub mod material;
pub mod strain;

pub use complex_pair::ComplexPair;
pub use estimate::{Estimate, TotalEstimate};
pub use lattice::{Lattice, MoireCell, Nm, Px, Waves};
pub use material::{Bilayer, Material};
pub use strain::{StrainTensor, StrainVector, TwistStrain};

/// The examples of the README, compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
