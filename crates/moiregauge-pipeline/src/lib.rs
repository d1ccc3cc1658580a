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
pub use convert::convert;
pub use find::find;
pub use inspect::inspect;
pub use job::{Cancel, Event, Events, Job, Quiet, Stage};
pub use maps::map;
pub use moire::moire;
pub use opened::read_scan;
pub use plan::plan;
pub use simulate::simulate;
pub use validate::validate;

/// What the front ends of this workspace share besides.
mod front {
    pub use crate::content::Content;
    pub use crate::find::{Found, LeftAlone};
    pub use crate::hash::{hexadecimal, identity};
    pub use crate::in_memory::ScanInMemory;
    pub use crate::job::{Cancelled, JobError};
    pub use crate::known::{Known, KnownError, is_named};
    pub use crate::mask::read_mask;
    pub use crate::memory::{NotEnoughMemory, available, enough_for};
    pub use crate::opened::{InputError, Opened, Reading, read_again, read_shown};
    pub use crate::options::{OptionError, conditions_on, settings_on};
    pub use crate::reading::{FileError, open, read, read_text};
    pub use crate::replay::{Document, ReplayError, record_files, settings_of};
    pub use crate::sets::{SetError, absolute, check_sets, set_of};
    pub use crate::settings_file::{
        NotSettings, SettingsFileError, UnknownMaterial, named_layers, named_material,
        parse_settings, read_layers, read_settings,
    };
    pub use crate::source::{Places, Source};
    pub use crate::told::check_user_specified;
    pub use crate::twice::{Repeated, distinct};
}
#[doc(hidden)]
pub use front::*;
