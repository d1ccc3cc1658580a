//! Bytes of any kind → [`Scan`]: opened and decoded at once.

use crate::error::ReadError;
use crate::file::{File, OpenOptions};
use crate::format::Format;
use crate::options::ArrayOptions;
use crate::scan::{ChannelInfo, Scan};

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
    first_frame(bytes, OpenOptions::default(), wanted)
}

/// The same for bytes of which [`crate::detect()`] has told the format before.
///
/// # Errors
/// As [`read_selected`].
pub fn read_as(
    format: Format,
    bytes: &[u8],
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    read_array_as(format, bytes, &ArrayOptions::default(), wanted)
}

/// Reads the wanted channels of a file of any format; options count for arrays and pictures.
///
/// # Errors
/// As [`read_selected`].
pub fn read_array(
    bytes: &[u8],
    options: &ArrayOptions,
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    let options = OpenOptions {
        array: options.clone(),
        ..OpenOptions::default()
    };
    first_frame(bytes, options, wanted)
}

/// The same for bytes of which [`crate::detect()`] has told the format before.
///
/// # Errors
/// As [`read_selected`].
pub fn read_array_as(
    format: Format,
    bytes: &[u8],
    options: &ArrayOptions,
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    let options = OpenOptions {
        format: Some(format),
        array: options.clone(),
        ..OpenOptions::default()
    };
    first_frame(bytes, options, wanted)
}

fn first_frame(
    bytes: &[u8],
    options: OpenOptions,
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    let options = OpenOptions {
        damaged: true,
        ..options
    };
    let frames = File::open_with(bytes, &options)?.into_frames();
    let first = frames.into_iter().next().ok_or(ReadError::NoImage)?;
    first.into_scan(wanted)
}
