//! What every front end shares: finding inputs, keeping outputs safe, repeating a run.
//!
//! Files and settings, but no arguments of a program, no printing and no physics. Front ends (the program, a
//! Python package, a page) stand on this crate.

pub mod calibrate;
pub mod campaign;
pub mod choices;
mod content;
pub mod convert;
mod find;
mod hash;
mod in_memory;
pub mod inspect;
mod job;
mod known;
pub mod maps;
mod mask;
mod memory;
pub mod moire;
pub mod names;
mod opened;
mod options;
pub mod plan;
mod reading;
mod replay;
pub mod samples;
pub mod session;
mod sets;
mod settings_file;
pub mod simulate;
pub mod sink;
mod source;
mod stamp;
mod told;
mod twice;
pub mod validate;
pub mod view;
pub mod watch;

/// The version of the program, as results name it: what a browser calculates with one thread and instructions of its own may
/// differ in the last digits.
pub const VERSION: &str = if cfg!(target_family = "wasm") {
    concat!(env!("CARGO_PKG_VERSION"), " browser")
} else {
    env!("CARGO_PKG_VERSION")
};

pub use calibrate::calibrate;
pub use content::Content;
pub use convert::convert;
pub use find::{Found, LeftAlone, find};
pub use hash::{hexadecimal, identity};
pub use in_memory::ScanInMemory;
pub use inspect::inspect;
pub use job::{Cancel, Cancelled, Event, Events, Job, JobError, Quiet, Stage};
pub use known::{Known, KnownError, is_named};
pub use maps::map;
pub use mask::read_mask;
pub use memory::{NotEnoughMemory, available, enough_for};
pub use moire::moire;
pub use opened::{InputError, Opened, Reading, read_again, read_scan, read_shown};
pub use options::{OptionError, conditions_on, settings_on};
pub use plan::plan;
pub use reading::{FileError, open, read, read_text};
pub use replay::{Document, ReplayError, record_files, settings_of};
pub use sets::{SetError, absolute, check_sets, set_of};
pub use settings_file::{
    NotSettings, SettingsFileError, UnknownMaterial, named_layers, named_material, parse_settings,
    read_layers, read_settings,
};
pub use simulate::simulate;
pub use source::{Places, Source};
pub use told::check_told;
pub use twice::{Repeated, distinct};
pub use validate::validate;
