//! Omicron Matrix: files of channels, `.Z_mtrx`, with the log of their session, `_0001.mtrx`.
//!
//! **Untested**: written from public descriptions; no file of an instrument was at hand. Every scan
//! says so in [`crate::Scan::notes`].
//!
//! The file of a channel holds raw counts only. Lines, points, size, scale and times stand in the log
//! of the session, in which the state of the instrument has to be found by playing all changes from
//! the start to the line that names the file. [`log_file`] tells the name of the log from that of the
//! file; [`read()`] takes the bytes of both.
//!
//! - Samples follow each other in time: trace of the first line, its retrace (`X_Retrace`), the next
//!   line; after the frame upwards that downwards (`Y_Retrace`). The first line upwards is the bottom
//!   one, downwards the top one; a retrace runs from right to left. A file holds both frames; which
//!   one is read is for the caller to say.
//! - Points and lines are those of the parameters `XYScanner.Points`, `Lines`, or those of the axes of
//!   the channel, whichever make the intended number of samples; if neither does, or both do in
//!   different ways, the file is refused.
//! - `TFF_Linear1D`: (count − `Offset`)/`Factor`. `TFF_MultiLinear1D`: (`Raw_1` − `PreOffset`)·(count −
//!   `Offset`)/(`NeutralFactor`·`PreFactor`). Without a function that surely is the channel's, values are
//!   counts.
//! - `X_Offset` and `Y_Offset` are the centre. `Angle` is taken as counter-clockwise, as
//!   access2theMatrix turns offsets.
//! - `Raster_Time` is the time of a point, forth and back; without a retrace that of the way back is
//!   not known.
//! - Times are seconds since 1970, given in UTC. That of the file is when it was stored, after the last
//!   of its frames.
//! - Scans that are bound to a line or a point (`Scan_Constraint`, `Grid_Mode`) and curves are refused.
//!
//! Descriptions compared: Gwyddion's `omicronmatrix.c` (versions of 2008 and 2021), access2theMatrix 0.4
//! (S. Zevenhuizen), pyMTRX, and a description of MATRIX 3.3 files made from their bytes. They agree in
//! blocks, values, order of samples and transfer functions. They differ here:
//!
//! - Size: from edge to edge by Gwyddion and newer access2theMatrix, between the centres of the outer
//!   pixels by pyMTRX and older access2theMatrix. Edges are taken, [`Span::PixelEdges`](crate::Span::PixelEdges).
//! - `Zoom`: Gwyddion divides the size by it, the others know nothing of it. If it is not 1 the size is
//!   left out.
//! - Time of a line: pyMTRX adds `Move_Raster_Time` to it, others do not. It is left out.
//! - Whole numbers: with a sign by access2theMatrix (taken), without one by the others; it matters for
//!   negative angles.
//! - Several functions under the name of a channel: access2theMatrix takes the last one, pyMTRX that of
//!   the key in the file. The key is taken; without it values are counts.
//! - Logs in several parts (`_0002.mtrx` …) are known to access2theMatrix only.
//! - Currents: Gwyddion multiplies those of curves, not of images, by `Preamp_Range`, the others by
//!   nothing, as here.
//! - Unfinished lines: kept by Gwyddion (and here), dropped by access2theMatrix.

mod blocks;
mod data;
mod format;
mod frame;
mod images;
mod log;
mod names;
mod read;
mod refuse;

pub use names::{frame_and_channel, is_curve, log_file};
pub use read::{open, read};
pub(crate) use refuse::open_alone;
