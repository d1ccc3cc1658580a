//! Scans → maps of twist and strain, and questions to them.

mod ask;
mod asked;
mod bytes;
mod domains;
mod doubts;
mod error;
mod found;
mod large;
mod lattices;
mod lines;
mod request;
mod run;
mod stripes;
mod survey;
mod write;

pub use ask::{NameTwice, OutsideOfMap};
pub use asked::{Line, Questions};
pub use domains::Domains;
pub use error::{NoBands, NoStripes, NotMapped};
pub use found::{LatticeShown, MapFound, Shown};
pub use lattices::{Mapped, NoMap, map_lattices};
pub use request::{DomainSearch, MapRequest, When};
pub use run::map;
pub use stripes::{StripesSeen, stripes_seen};
pub use write::MAP_FILES;
