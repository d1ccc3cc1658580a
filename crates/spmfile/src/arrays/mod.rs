//! Plain arrays and pictures: `.npy`, `.npz`, text matrices, TIFF, PNG, JPEG.
//!
//! They hold numbers and no frame: its size, direction and times are for the user to give, in
//! [`ArrayOptions`]; what is not given stays unknown. Files written here ([`npz`], [`tiff()`], [`csv`])
//! carry along what was known, and it is taken back; options come before it. The first line of an array or a picture is the
//! top one. A coloured picture is a rendering; it becomes one channel of its luminance, with a note
//! in [`crate::Scan::metadata`].
//!
//! ```
//! use spmfile::arrays::{ArrayOptions, read};
//!
//! let options = ArrayOptions {
//!     size_nm: Some([70.0, 70.0]),
//!     unit: Some("°".to_owned()),
//!     ..ArrayOptions::default()
//! };
//! let scan = read(b"1 2 3\n4 5 6\n", &options, &|_| true)?;
//! assert_eq!(scan.channels[0].values(), [4.0, 5.0, 6.0, 1.0, 2.0, 3.0]);
//! # Ok::<(), spmfile::ReadError>(())
//! ```

mod npy;
mod picture;
mod plane;
mod read;
mod text;
mod write;

pub use read::{ArrayOptions, read, read_as};
pub use write::{csv, npz, tiff};
