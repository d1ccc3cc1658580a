//! Scanning-probe microscope files: bytes → [`Scan`].
//!
//! What the instrument wrote, and nothing else: no interpretation, no numerics.
//! Images are stored bottom line first (y up), column 0 at the left, whatever the file does.
//!
//! [`File::open`] tells what a file holds before any sample is decoded; [`Frame`] decodes channels and rows;
//! [`read()`] makes a whole scan at once.
//!
//! ```no_run
//! let bytes = std::fs::read("scan.spm")?;
//! let scan = spmfile::read(&bytes)?;
//! for channel in &scan.channels {
//!     println!("{} in {}", channel.name, channel.unit);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![doc = include_str!("../FORMATS.md")]
#![cfg_attr(
    not(all(feature = "archives", feature = "pictures", feature = "write")),
    allow(
        dead_code,
        unused_imports,
        reason = "tools of the readers and writers that are left out"
    )
)]

mod agilent;
#[cfg(feature = "archives")]
mod archive;
mod array;
mod clock;
mod createc;
mod crop;
mod cursor;
mod detect;
mod error;
#[cfg(feature = "write")]
mod export;
mod fields;
mod file;
mod format;
mod frame;
pub mod gsf;
pub mod gwy;
mod gxsm;
pub mod gxyzf;
#[cfg(all(feature = "hdf5", not(target_family = "wasm")))]
mod hdf5;
mod header;
mod igor;
mod iso28632;
mod jpk;
mod judge;
mod labels;
mod limits;
pub mod matrix;
mod nanonis;
mod nanonis_grid;
pub mod nanoscope;
mod nid;
mod options;
mod outline;
mod park;
mod raster;
mod read;
mod readers;
mod rhk;
mod scan;
#[cfg(test)]
mod seeds;
mod sensors;
mod signature;
mod source;
mod stored;
mod tiff_tags;
mod units;
mod whole;
mod words;
#[cfg(feature = "write")]
mod writable;
mod wsxm;
#[cfg(feature = "write")]
pub mod zarr;

/// Plain arrays and pictures: `.npy`, `.npz`, text matrices, TIFF, PNG, JPEG.
///
/// They hold numbers and no frame: its size, direction and times are for the user to give, in
/// [`ArrayOptions`](arrays::ArrayOptions); what is not given stays unknown. Files written here carry along
/// what was known, and it is taken back; options come before it. The first line of an array or a picture is
/// the top one. A coloured picture is a rendering; it becomes one channel of its luminance, with a note in
/// [`Scan::metadata`].
///
/// ```
/// use spmfile::arrays::{ArrayOptions, read};
///
/// let options = ArrayOptions {
///     size_nm: Some([70.0, 70.0]),
///     unit: Some("°".to_owned()),
///     ..ArrayOptions::default()
/// };
/// let scan = read(b"1 2 3\n4 5 6\n", &options, &|_| true)?;
/// assert_eq!(scan.channels[0].values(), [4.0, 5.0, 6.0, 1.0, 2.0, 3.0]);
/// # Ok::<(), spmfile::ReadError>(())
/// ```
pub mod arrays {
    #[cfg(feature = "write")]
    pub use crate::array::csv;
    #[cfg(all(feature = "write", feature = "archives"))]
    pub use crate::array::npz;
    #[cfg(all(feature = "write", feature = "pictures"))]
    pub use crate::array::tiff;
    pub use crate::options::ArrayOptions;
    pub use crate::read::{read_array as read, read_array_as as read_as};
}

pub use crop::{Block, CropError, crop};
pub use detect::detect;
#[doc(hidden)]
pub use detect::{looks_like_scan, named_like_scan};
pub use error::ReadError;
#[cfg(feature = "write")]
pub use export::ExportError;
pub use file::{File, OpenOptions};
pub use format::Format;
pub use frame::Frame;
pub use header::{ChannelHeader, Scaling};
pub use read::{read, read_as, read_selected};
pub use scan::{
    Channel, ChannelInfo, DateTime, FrameDirection, LineDirection, Samples, Scan, Span,
    UnreadableChannel,
};
#[doc(hidden)]
pub use sensors::sensor_axis;
pub use sensors::{PositionSensors, SensorProblem, position_sensors};
pub use source::{Seekable, Source};
#[doc(hidden)]
pub use units::{length_nm, nm_per, plain_unit};
#[cfg(feature = "write")]
pub use writable::{WritableFormat, write, write_between};

/// The examples of the README are tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
