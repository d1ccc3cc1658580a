//! Lattices of stacked two-dimensional crystals: from moiré vectors to twist and heterostrain.

mod complex_pair;
mod estimate;
pub mod lattice;
pub mod material;
pub mod strain;

pub use complex_pair::ComplexPair;
pub use estimate::{Estimate, TotalEstimate};
