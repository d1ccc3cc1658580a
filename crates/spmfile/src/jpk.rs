//! JPK images, `.jpk` and `.jpk-qi-image`.

use crate::ChannelInfo;
use crate::error::ReadError;
use crate::scan::Scan;

/// Reads the channels that are wanted.
pub(crate) fn read(
    _bytes: &[u8],
    _wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    Err(ReadError::Unsupported {
        format: "JPK",
        reason: "this format is not read yet".to_owned(),
    })
}

/// Reads the image within a ZIP archive.
pub(crate) fn read_zip(
    bytes: &[u8],
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    read(bytes, wanted)
}
