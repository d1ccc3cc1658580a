//! What every front end shares: finding inputs, keeping outputs safe, repeating a run.
//!
//! Files and settings, but no arguments of a program, no printing and no physics. Front ends (the program, a
//! Python package, a page) stand on this crate.

pub mod campaign;
mod content;
mod find;
mod hash;
mod held;
mod job;
mod known;
pub mod maps;
mod memory;
pub mod names;
mod opened;
mod reading;
mod replay;
pub mod samples;
pub mod session;
mod sets;
pub mod sink;
mod told;
mod twice;

pub use content::Content;
pub use find::{Found, LeftAlone, find};
pub use held::{Held, InMemory};
pub use hash::{hexadecimal, identity};
pub use job::{Cancel, Cancelled, Event, Events, Job, JobError, Quiet, Stage};
pub use known::{Known, KnownError, Places, is_named};
pub use memory::{NotEnoughMemory, available, enough_for};
pub use opened::{InputError, Opened, Reading, read_again, read_scan, read_shown};
pub use reading::{FileError, open, read, read_text};
pub use replay::{Document, ReplayError, record_files, settings_of};
pub use sets::{SetError, absolute, check_sets, set_of};
pub use told::check_told;
pub use twice::{Repeated, distinct};
