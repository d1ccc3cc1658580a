//! Files that come alone.

use super::format::{CHANNEL, LOG, MAGIC, damaged, unsupported};
use crate::error::ReadError;
use crate::outline::{Input, Outline};

/// Refuses a file that comes without the other one.
pub(crate) fn open_alone<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    Err(refuse(input.bytes))
}

/// Says what a file lacks that comes alone.
pub(super) fn refuse(bytes: &[u8]) -> ReadError {
    match bytes.get(MAGIC.len()..MAGIC.len() + 4) {
        Some(LOG) => unsupported(
            "it is the log of a session and holds no image; give the images beside it, as in \
             NAME--1_1.Z_mtrx",
        ),
        Some(CHANNEL) => unsupported(
            "it holds counts only; lines, size and scale are in the log of its session, the file beside it \
             whose name ends in _0001.mtrx, and are found there by the name of this file",
        ),
        first => damaged(format!(
            "expected the mark TLKB or ATEM, found {:02x?}",
            first.unwrap_or_default()
        )),
    }
}
