//! How much memory a file may take.

/// Up to this many bytes any file may unpack to: constant arrays shrink a thousandfold.
const ALWAYS_ALLOWED: u64 = 64 << 20;
/// Beyond that, the largest ratio of decoded bytes to the length of the file.
const MOST_GAIN: u64 = 20;

/// How many bytes a compressed file of a length may become.
pub(crate) fn unpacked_limit(length: usize) -> u64 {
    ALWAYS_ALLOWED.max(MOST_GAIN.saturating_mul(length as u64))
}
