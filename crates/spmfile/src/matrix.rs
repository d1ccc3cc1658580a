//! Omicron Matrix files, `.mtrx` and `.Z_mtrx`: told and refused, with what they hold.
//!
//! An image is spread over two files. That of the channel holds raw counts only; lines, samples,
//! size, scaling and times stand in the log of the session, a file `…_0001.mtrx` in which the state
//! of the instrument at the time of the image has to be found by playing all changes since the
//! start. One file alone cannot become a scan.
//!
//! Marks of blocks (four letters, read backwards): Gwyddion's `omicronmatrix.c`. No file to test
//! with is at hand.

use memchr::memmem;

use crate::ChannelInfo;
use crate::cursor::{Cursor, Endian};
use crate::error::ReadError;
use crate::scan::Scan;

const MAGIC: &[u8] = b"ONTMATRX0101";
/// The first block of the file of a channel.
const CHANNEL: &[u8] = b"TLKB";
/// The first block of the log.
const LOG: &[u8] = b"ATEM";
/// Block with the numbers of samples intended and recorded.
const DESCRIPTION: &[u8] = b"CSED";

/// Says what the file is and what to do.
pub(crate) fn read(
    bytes: &[u8],
    _wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    let first = bytes.get(MAGIC.len()..MAGIC.len() + 4).unwrap_or_default();
    let advice = "open it in a program that reads both, such as Gwyddion, and save it as .gwy";
    let reason = if first == LOG {
        format!("it is the log of a session and holds no image; the images are beside it; {advice}")
    } else if first == CHANNEL {
        let samples = match recorded(bytes) {
            Some((recorded, intended)) => format!("{recorded} of {intended} samples"),
            None => "samples".to_owned(),
        };
        format!(
            "it holds {samples} of one channel as counts; their number of lines, size and scale are \
             in the log of the session (a file that ends in _0001.mtrx); {advice}"
        )
    } else {
        return Err(ReadError::Damaged {
            format: "Omicron Matrix",
            reason: format!("expected the mark TLKB or ATEM, found {first:02x?}"),
        });
    };
    Err(ReadError::Unsupported {
        format: "Omicron Matrix",
        reason,
    })
}

/// Samples recorded and intended.
fn recorded(bytes: &[u8]) -> Option<(u32, u32)> {
    let head = &bytes[..bytes.len().min(4096)];
    let place = memmem::find(head, DESCRIPTION)?;
    // Length of the block, twenty bytes of no known use, then the numbers.
    let mut cursor = Cursor::new(bytes, Endian::Little).at(place + 8 + 20);
    let (intended, recorded) = (cursor.u32().ok()?, cursor.u32().ok()?);
    (recorded <= intended).then_some((recorded, intended))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn either_file_is_told() {
        let mut channel = [MAGIC, CHANNEL, &[0; 12], DESCRIPTION, &[0; 24]].concat();
        channel.extend([100u32, 80].iter().flat_map(|n| n.to_le_bytes()));
        let error = |bytes: &[u8]| crate::read(bytes).expect_err("refused").to_string();
        assert!(error(&channel).contains("80 of 100 samples"));
        assert!(error(&channel[..20]).contains("holds samples"));
        assert!(error(&[MAGIC, LOG].concat()).contains("log of a session"));
        assert!(error(MAGIC).contains("TLKB"));
    }
}
