//! Moiré vectors → twist angle and heterostrain.
//!
//! Layer 1 is the reference with orientation α (of its reciprocal vectors, 30° from
//! its atomic ones; modulo 60°); layer 2 is the same lattice stretched by ε along φ
//! (counted from layer 1) and then turned by θ. The tensile axis in the laboratory is
//! `φ_lab = φ + α + θ`. Lengths in nm, angles in rad, counter-clockwise; strain without dimension.
//!
//! The moiré of a single lattice holds four numbers; θ, α, ε and φ are four. An isotropic strain on
//! top is not visible and shifts θ by about θη/2 + η²/2θ, at first order where the layers differ: a twist is
//! conditional on its absence. [`degeneracy`] says by how much; with the orientation of one layer
//! [`strain_tensors`] has no need of the assumption.

mod aligned;
mod closed_form;
mod closure;
mod complex_pair;
mod degeneracy;
mod draws;
mod error;
mod forward;
mod inversion;
mod labelling;
mod layers;
mod limit;
mod local;
mod names;
mod other_models;
mod paper;
mod tensor;
mod twist_strain;

pub use closed_form::{Branch, Solutions, branches, solutions, twist_strain};
pub use closure::three_vectors;
pub use degeneracy::{Degeneracy, degeneracy};
pub use draws::draws;
pub use error::StrainError;
pub use forward::{Stacking, moire_lattice, moire_of, moire_pair_of, naive_twist};
pub(crate) use local::FixedBranch;
pub use names::LatticeName;
pub(crate) use other_models::Reference;
pub use paper::published_draws;
pub use tensor::{Orientation, Split, StrainTensor, strain_tensors};
pub use twist_strain::TwistStrain;
