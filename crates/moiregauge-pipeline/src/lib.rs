//! What every front end shares: finding inputs, keeping outputs safe, repeating a run.
//!
//! Files and settings, but no arguments of a program, no printing and no physics. Front ends (the program, a
//! Python package, a page) stand on this crate.

mod find;
mod memory;
pub mod names;
mod reading;
pub mod session;
pub mod sink;
mod twice;

pub use find::{Found, LeftAlone, find};
pub use memory::{NotEnoughMemory, available, enough_for};
pub use reading::{FileError, open, read, read_text};
pub use twice::{Repeated, distinct};
