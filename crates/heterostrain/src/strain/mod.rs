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

pub(crate) mod aligned;
pub(crate) mod closed_form;
pub(crate) mod convention;
pub(crate) mod degeneracy;
pub(crate) mod draws;
pub(crate) mod error;
pub(crate) mod forward;
pub(crate) mod inversion;
pub(crate) mod known;
pub(crate) mod labelling;
pub(crate) mod layers;
pub(crate) mod limit;
pub(crate) mod local;
pub(crate) mod names;
pub(crate) mod other_models;
pub(crate) mod paper;
pub(crate) mod registry;
pub(crate) mod ruler;
pub(crate) mod tensor;
pub(crate) mod twist_strain;
pub(crate) mod vector;

pub use closed_form::{Branch, Solutions, branches, solutions, twist_strain};
pub use convention::StrainConvention;
pub use degeneracy::{Degeneracy, degeneracy};
pub use draws::{StrainDraw, draws};
pub use error::StrainError;
pub use forward::{Stacking, moire_lattice, moire_of, moire_pair_of, naive_twist};
pub use known::{KnownOrientation, LatticeDirection, TwistSense};
pub use local::FixedBranch;
pub use names::LatticeName;
pub use other_models::Reference;
pub use paper::published_draws;
pub use registry::Registry;
pub use ruler::{Ruler, named_like};
pub use tensor::{Orientation, Split, StrainTensor, strain_tensors};
pub use twist_strain::TwistStrain;
pub use vector::StrainVector;
