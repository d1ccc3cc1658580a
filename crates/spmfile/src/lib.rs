//! Scanning-probe microscope files: bytes → [`Scan`].
//!
//! What the instrument wrote, and nothing else: no interpretation, no numerics.
//! Images are stored bottom line first (y up), column 0 at the left, whatever the file does.
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

mod agilent;
mod archive;
pub mod arrays;
mod clock;
mod crop;
mod cursor;
mod detect;
mod error;
mod export;
mod fields;
pub mod gsf;
pub mod gwy;
pub mod gxyzf;
mod igor;
mod iso28632;
mod jpk;
mod labels;
pub mod matrix;
mod missing;
mod nanonis;
pub mod nanoscope;
mod nid;
mod park;
mod raster;
mod read;
mod rhk;
mod scan;
#[cfg(test)]
mod seeds;
mod sensors;
mod tiff_tags;
mod units;
mod whole;
mod writable;
mod wsxm;
pub mod zarr;

pub use crop::{Block, CropError, crop};
pub use detect::{Format, detect, looks_like_scan, named_like_scan};
pub use error::ReadError;
pub use export::ExportError;
pub use read::{read, read_as, read_selected};
pub use scan::{
    Channel, ChannelInfo, DateTime, FrameDirection, LineDirection, Samples, Scan, Span,
    UnreadableChannel,
};
pub use sensors::{PositionSensors, SensorProblem, position_sensors, sensor_axis};
pub use units::{length_nm, nm_per};
pub use writable::{WritableFormat, write};
