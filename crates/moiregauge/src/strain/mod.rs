//! Moiré vectors → twist angle and heterostrain.
//!
//! Layer 1 is the reference with orientation α (of its reciprocal vectors, 30° from
//! its atomic ones; modulo 60°); layer 2 is the same lattice stretched by ε along φ
//! (counted from layer 1) and then turned by θ. The tensile axis in the laboratory is
//! `φ_lab = φ + α + θ`. Lengths in nm, angles in rad, counter-clockwise; strain without dimension.
//!
//! The moiré of a single lattice holds four numbers; θ, α, ε and φ are four. An isotropic strain on
//! top is not visible and shifts θ by about θη/2 + η²/2θ: a twist is conditional on its absence.

mod closed_form;
mod closure;
mod complex_pair;
mod draws;
mod error;
mod forward;
mod inversion;
mod labelling;
mod limit;
mod local;
mod other_models;
mod twist_strain;

pub use closed_form::{Branch, branches, twist_strain};
pub use closure::three_vectors;
pub use draws::draws;
pub use error::StrainError;
pub use forward::{moire_lattice, naive_twist};
pub(crate) use local::FixedBranch;
pub(crate) use other_models::Reference;
pub use twist_strain::TwistStrain;
