//! Lattice vectors of a periodic image.

mod vectors;

pub use vectors::LatticeVectors;
