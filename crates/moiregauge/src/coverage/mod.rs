//! Where in a frame a lattice is.
//!
//! In: an image without background and a pair of wave vectors, roughly. Out: the part of the frame that carries
//! the waves of that lattice, and their mean over it. A sample is not covered everywhere: the moiré ends at an edge,
//! bubbles and holes interrupt it, another grain begins. A transform of the whole frame then shows each wave with
//! skirts, and a pair of skirts may look like a lattice; under a window that is slid over the frame it does not.

pub(crate) mod basis;
pub(crate) mod bend;
pub(crate) mod cells;
pub(crate) mod choose;
pub(crate) mod equations;
pub(crate) mod find;
pub(crate) mod grains;
pub(crate) mod higher;
pub(crate) mod hollows;
pub(crate) mod local;
pub(crate) mod look;
pub(crate) mod nodes;
pub(crate) mod patch;
pub(crate) mod phases;
pub(crate) mod settle;
pub(crate) mod sides;
pub(crate) mod slopes;
pub(crate) mod summed;
pub(crate) mod tidy;
pub(crate) mod tiles;
pub(crate) mod windows;

pub use bend::Change;
pub use choose::ChangeModel;
pub use patch::LatticeRegion;
