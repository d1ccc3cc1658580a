//! What every front end shares: finding inputs, keeping outputs safe, repeating a run.
//!
//! Files and settings, but no arguments of a program, no printing and no physics. Front ends (the program, a
//! Python package, a page) stand on this crate.

mod hash;
mod known;
pub mod names;
mod replay;
pub mod session;
mod sets;
pub mod sink;
mod twice;

pub use hash::{hexadecimal, identity};
pub use known::{Known, KnownError, Places, is_named};
pub use replay::{Document, ReplayError, record_files, settings_of};
pub use sets::{SetError, absolute, check_sets, set_of};
pub use twice::{Repeated, distinct};
