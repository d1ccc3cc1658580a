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
pub use scan::{
    Channel, DateTime, FrameDirection, LineDirection, Samples, Scan, Span, UnreadableChannel,
};
pub use sensors::{PositionSensors, SensorProblem, position_sensors, sensor_axis};
pub use units::{length_nm, nm_per};
pub use writable::{WritableFormat, write};

/// What is known of a channel before its samples are decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelInfo {
    /// The name the user sees, as in `TR Phase`.
    pub name: String,
    /// The instrument's own name, as in `TRPhase`; empty where there is none.
    pub internal_name: String,
    /// Trace or retrace, where the file tells.
    pub line_direction: Option<LineDirection>,
    /// `Main`, `Interleave` and the like, where the file tells.
    pub scan_line: Option<String>,
}

/// Reads every channel of a file held in memory.
///
/// # Errors
/// - The bytes are no scan, or one of a kind that is not read: the variant names it.
/// - The file is damaged; what lies within it comes with [`ReadError::Incomplete`].
/// - No channel can be read.
///
/// A channel that is merely scaled in an unknown way is no error: see [`Scan::unreadable`].
pub fn read(bytes: &[u8]) -> Result<Scan, ReadError> {
    read_selected(bytes, &|_| true)
}

/// Reads the channels for which `wanted` returns true; the others are checked but not decoded.
///
/// # Errors
/// As [`read`], except that having none of the wanted channels is no error.
pub fn read_selected(
    bytes: &[u8],
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    checked(dispatch(bytes, wanted))
}

/// Leaves out what cannot be true, and refuses images without a sample.
pub(crate) fn checked(scan: Result<Scan, ReadError>) -> Result<Scan, ReadError> {
    let mut scan = scan.map_err(|mut error| {
        if let ReadError::Incomplete { readable, .. } = &mut error {
            whole::tidy(readable);
        }
        error
    })?;
    whole::tidy(&mut scan);
    if whole::all_missing(&scan) {
        return Err(ReadError::AllMissing {
            channels: scan.channels.len(),
        });
    }
    Ok(scan)
}

/// Hands the bytes to the reader of their format.
fn dispatch(bytes: &[u8], wanted: &dyn Fn(&ChannelInfo) -> bool) -> Result<Scan, ReadError> {
    #[cfg(test)]
    seeds::keep(bytes);
    match detect(bytes) {
        Format::NanoScope => nanoscope::read(bytes, wanted),
        Format::NanoScopeForce => Err(nanoscope::refuse_force(bytes)),
        Format::Nanonis => nanonis::read(bytes, wanted),
        Format::Gwy => gwy::read(bytes, wanted),
        Format::Gsf => gsf::read(bytes, wanted),
        Format::Gxyzf => gxyzf::read(bytes, wanted),
        Format::Igor => igor::read(bytes, wanted),
        Format::Wsxm => wsxm::read(bytes, wanted),
        Format::Iso28632 => iso28632::read(bytes, wanted),
        Format::Jpk => jpk::read(bytes, wanted),
        Format::JpkZip => jpk::read_zip(bytes, wanted),
        Format::Nid => nid::read(bytes, wanted),
        Format::ParkTiff => park::read(bytes, wanted),
        Format::Rhk => rhk::read(bytes, wanted),
        Format::AgilentMi => agilent::read(bytes, wanted),
        Format::OmicronMatrix | Format::OmicronMatrixLog => Err(matrix::refuse(bytes)),
        Format::Npy
        | Format::Npz
        | Format::Tiff
        | Format::Png
        | Format::Jpeg
        | Format::TextMatrix => arrays::read(bytes, &arrays::ArrayOptions::default(), wanted),
        Format::Empty => Err(ReadError::Empty),
        Format::Other(found) => Err(ReadError::OtherFormat { found }),
        Format::Text => Err(ReadError::Text {
            start: String::from_utf8_lossy(&bytes[..bytes.len().min(40)])
                .lines()
                .next()
                .unwrap_or("")
                .to_owned(),
        }),
        Format::Unknown => Err(ReadError::Unknown {
            start: format!("{:02x?}", &bytes[..bytes.len().min(8)]),
        }),
    }
}
