//! `WSxM` files, `.stp` and `.top`.

use crate::ChannelInfo;
use crate::error::ReadError;
use crate::scan::Scan;

/// Reads the channels that are wanted.
pub(crate) fn read(
    _bytes: &[u8],
    _wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    Err(ReadError::Unsupported {
        format: "WSxM",
        reason: "this format is not read yet".to_owned(),
    })
}
