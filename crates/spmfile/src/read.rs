//! Bytes of any kind → [`Scan`]: to the reader of their format.

use crate::detect::{Format, detect};
use crate::error::ReadError;
use crate::scan::{ChannelInfo, Scan};
use crate::whole::checked;
use crate::{
    agilent, arrays, gsf, gwy, gxyzf, igor, iso28632, jpk, matrix, nanonis, nanoscope, nid, park,
    rhk, wsxm,
};

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
    read_as(detect(bytes), bytes, wanted)
}

/// The same for bytes of which [`detect()`] has told the format before.
///
/// # Errors
/// As [`read_selected`].
pub fn read_as(
    format: Format,
    bytes: &[u8],
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    checked(dispatch(format, bytes, wanted))
}

/// Hands the bytes to the reader of their format.
fn dispatch(
    format: Format,
    bytes: &[u8],
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    #[cfg(test)]
    crate::seeds::keep(bytes);
    match format {
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
        | Format::TextMatrix => {
            arrays::read_as(format, bytes, &arrays::ArrayOptions::default(), wanted)
        }
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
