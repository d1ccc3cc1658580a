//! How much memory a file may take.

/// Up to this many bytes any file may unpack to: constant arrays shrink a thousandfold.
const ALWAYS_ALLOWED: u64 = 64 << 20;
/// Beyond that, the largest ratio of decoded bytes to the length of the file.
const LARGE_GAIN: u64 = 20;
/// No stream of deflate (1032) or LZW (1280) unpacks to more times its length.
pub(crate) const MOST_GAIN: u64 = 1300;

/// How many bytes a compressed file of a length may become.
pub(crate) fn unpacked_limit(length: usize) -> u64 {
    let length = length as u64;
    let large = ALWAYS_ALLOWED.max(LARGE_GAIN.saturating_mul(length));
    large.min(MOST_GAIN.saturating_mul(length))
}
