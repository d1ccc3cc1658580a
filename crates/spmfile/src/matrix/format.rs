//! The marks at the start of the files, and how they are refused.

use crate::error::ReadError;

pub(super) const FORMAT: &str = "Omicron Matrix";
pub(super) const MAGIC: &[u8] = b"ONTMATRX0101";
/// The first block of the file of a channel.
pub(super) const CHANNEL: &[u8] = b"TLKB";
/// The first block of the log.
pub(super) const LOG: &[u8] = b"ATEM";

pub(super) fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

pub(super) fn unsupported(reason: impl Into<String>) -> ReadError {
    ReadError::unsupported(FORMAT, reason)
}
