//! Does the file hold all that its header promises? The last step of readers of block formats.

use crate::error::ReadError;
use crate::scan::{Samples, Scan, UnreadableChannel};

/// More images than any instrument records at once.
pub(crate) const MOST_CHANNELS: usize = 1024;

/// Where the channels of a file end, and which of them lie beyond its end.
#[derive(Debug, Default)]
pub(crate) struct Extent {
    /// Channels announced.
    announced: usize,
    /// Byte behind the last of them.
    expected: u64,
    /// Those that the file does not hold in full.
    lost: Vec<UnreadableChannel>,
    /// Whether any of their bytes are there.
    begun: bool,
}

impl Extent {
    /// The bytes of a channel from `start` on; `None`, with a note, where the file ends before.
    pub(crate) fn take<'a>(
        &mut self,
        bytes: &'a [u8],
        start: usize,
        length: usize,
        name: &str,
    ) -> Option<&'a [u8]> {
        self.announced += 1;
        let end = start as u64 + length as u64;
        self.expected = self.expected.max(end);
        let found = bytes.len().saturating_sub(start);
        self.begun |= found > 0;
        let block = start
            .checked_add(length)
            .and_then(|end| bytes.get(start..end));
        if block.is_none() {
            self.lost.push(UnreadableChannel {
                name: name.to_owned(),
                error: format!("it is {found} bytes long but its header promises {length}"),
            });
        }
        block
    }

    /// The scan, or the error that the missing bytes call for.
    pub(crate) fn judge(self, mut scan: Scan, bytes: &[u8]) -> Result<Scan, ReadError> {
        if self.lost.is_empty() {
            return Ok(scan);
        }
        if !self.begun {
            return Err(ReadError::HeaderOnly {
                announced: self.announced,
                expected: self.expected,
                found: bytes.len(),
            });
        }
        let reason = self
            .lost
            .iter()
            .map(|lost| format!("channel {:?}: {}", lost.name, lost.error))
            .collect::<Vec<_>>()
            .join("; ");
        scan.unreadable.extend(self.lost);
        Err(ReadError::Incomplete {
            reason,
            readable: Box::new(scan),
        })
    }
}

/// Whether there are channels and none of them holds a single sample.
pub(crate) fn all_missing(scan: &Scan) -> bool {
    let missing = |samples: &Samples| match samples {
        Samples::I16(v) => v.is_empty(),
        Samples::I32(v) => v.is_empty(),
        Samples::F32(v) => v.iter().all(|value| value.is_nan()),
        Samples::F64(v) => v.iter().all(|value| value.is_nan()),
    };
    !scan.channels.is_empty() && scan.channels.iter().all(|c| missing(&c.samples))
}
