//! Two-dimensional lattices with their errors: real and reciprocal, names of their vectors, the cell.

pub(crate) mod blocks;
pub(crate) mod cell;
pub(crate) mod reduce;
pub(crate) mod three_vectors;
pub(crate) mod vectors;

pub use blocks::{block, both, reciprocal};
pub use cell::{CellError, MoireCell, WavelengthMeaning, from_wavelengths};
pub use reduce::{canonical, distortion, labelled_like, renamings, same_handed, shortest_pair};
pub use three_vectors::three_vectors;
pub use vectors::{Lattice, Nm, Pair, Px, Real, Reciprocal, Waves};
