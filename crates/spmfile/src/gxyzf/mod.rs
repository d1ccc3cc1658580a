//! Gwyddion XYZ fields, `.gxyzf`: points with one or more values, double precision, little endian.
//!
//! Gwyddion user guide, "Gwyddion XYZ Field": the magic line, lines `Key = value`, one to eight
//! NULs up to a multiple of eight bytes, then x, y and `NChannels` values for each point.
//!
//! Points become a scan where `XRes` and `YRes` tell that they lie line by line: x and y are its
//! position sensors. A mere cloud does not tell which points were recorded one after the other.
//!
//! - x to the right, y up. Unless the file was written here: if the lines go down (or the points of a line left), they are turned.
//! - Without a unit of length in `XYUnits` the positions are of no use, and the file is refused.

mod read;
#[cfg(feature = "write")]
mod write;

pub(crate) use read::open;
#[cfg(feature = "write")]
pub use write::write;
#[cfg(feature = "write")]
pub(crate) use write::write_between;
