//! Gwyddion containers, `.gwy`.
//!
//! A tree of named, typed values (Gwyddion user guide, "Gwyddion Native File Format"): little
//! endian, texts in UTF-8 ending with NUL. `GWYP` is followed by one object, the container. Its
//! item `/N/data` is an image, `/N/data/title` its name, `/N/meta` the header of the file it was
//! imported from. Masks, presentations, curves, volumes and point clouds are left out.
//!
//! - Row 0 of an image is the top line.
//! - `xreal` and `yreal` are edge to edge, in the unit `si_unit_xy`; without a unit of length the
//!   image has no size. `xoff` and `yoff` are the smallest x and y of the frame, as Gwyddion's own
//!   imports set them.
//! - Values are in the unit `si_unit_z`; missing ones are NaN.
//! - What a title in brackets tells of the line direction is used (`Z (Backward)`, `Height [Trace]`).

mod read;
#[cfg(feature = "write")]
mod write;

pub(crate) use read::open;
#[cfg(feature = "write")]
pub use write::write;
#[cfg(feature = "write")]
pub(crate) use write::write_between;
