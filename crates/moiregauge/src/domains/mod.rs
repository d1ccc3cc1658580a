//! Domain structure at small angles: nodes, the triangles between them, twist and strain of each.
//!
//! At small angles the layers relax into triangular domains of commensurate stacking, with walls between them that
//! meet in nodes (AA sites). Phases under a window then mix relaxation with strain; nodes do not: three
//! neighbours span half a cell of the moiré, and their edges are its lattice vectors there.
//!
//! In: an image without background and its lattice as a start. Out: places of nodes with covariances (pixels), a
//! mesh with missing and extra nodes and dislocations, and twist and strain of every triangle on the sample.

pub(crate) mod cells;
pub(crate) mod mesh;
pub(crate) mod nodes;
pub(crate) mod patch;
pub(crate) mod regime;

#[cfg(test)]
mod tests;

pub use cells::{DomainCell, DomainMap};
pub use mesh::{Dislocation, Mesh, MeshTriangle};
pub use nodes::{Contrast, FoundNode, FoundNodes, find_nodes};
pub use regime::{Regime, RegimeChoice, regime};
