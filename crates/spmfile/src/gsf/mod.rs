//! Gwyddion simple fields, `.gsf`: one image of single-precision samples, little endian.
//!
//! Gwyddion user guide, "Gwyddion Simple Field": the magic line, lines `Key = value`, one to four
//! NULs up to a multiple of four bytes, the samples; the file ends with the last sample.
//!
//! - Row 0 is the top line.
//! - `XReal` and `YReal` are edge to edge in `XYUnits`; without a unit of length there is no size.

mod read;
#[cfg(feature = "write")]
mod write;

pub(crate) use read::open;
#[cfg(feature = "write")]
pub use write::write;
#[cfg(feature = "write")]
pub(crate) use write::write_between;
