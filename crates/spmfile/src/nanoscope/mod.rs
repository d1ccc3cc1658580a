//! Bruker/Veeco/Digital Instruments NanoScope files, versions 5 to 10.
//!
//! A text header in Windows-1252 (sections of `\key: value`) is followed by the samples of each
//! image, little endian, 16 or 32 bits wide, bottom line first for `Frame direction: Up` and `Down`
//! alike; retrace lines are stored in order of position, not of time.

mod channel;
mod frame;
mod header;
mod read;
mod scaling;
#[cfg(feature = "write")]
mod write;

pub(crate) use read::{detect, detect_force, open, refuse_force};
#[cfg(feature = "write")]
pub use write::{WriteError, write};
