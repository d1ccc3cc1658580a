//! What every front end shares: finding inputs, keeping outputs safe, repeating a run.
//!
//! Files and settings, but no arguments of a program, no printing and no physics. Front ends (the program, a
//! Python package, a page) stand on this crate.

pub mod names;
pub mod sink;
mod twice;

pub use twice::{Repeated, distinct};
