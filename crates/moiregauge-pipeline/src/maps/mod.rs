//! Scans → maps of twist and strain, and questions to them.

mod ask;
mod doubts;
mod lattices;

pub use ask::{Line, OutsideOfMap, Questions};
pub use doubts::narrow_margin;
pub use lattices::{Mapped, NoMap, Scans, map_lattices, mapped_image};
