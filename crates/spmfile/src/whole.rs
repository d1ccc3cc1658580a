//! Does the file hold all that its header promises? The last step of readers of block formats.

use crate::error::ReadError;
use crate::scan::{Channel, Samples, Scan, UnreadableChannel};

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
    /// Bytes given to channels so far.
    taken: usize,
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
        let end = (start as u64).saturating_add(length as u64);
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
            return None;
        }
        // Data that overlap belong to nobody; this also bounds the memory by the file's length.
        if length > bytes.len() - self.taken {
            self.lose(
                name.to_owned(),
                "its data overlap with those of others".to_owned(),
            );
            return None;
        }
        self.taken += length;
        block
    }

    /// Counts a channel as lost that a reader could not find itself.
    pub(crate) fn lose(&mut self, name: String, error: String) {
        self.begun = true;
        self.lost.push(UnreadableChannel { name, error });
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

/// The scan, unless every one of its announced channels is scaled in an unknown way.
pub(crate) fn some_readable(scan: Scan, announced: usize) -> Result<Scan, ReadError> {
    match scan.unreadable.first() {
        Some(first) if scan.unreadable.len() == announced => Err(ReadError::NoReadableChannel {
            announced,
            name: first.name.clone(),
            reason: first.error.clone(),
        }),
        _ => Ok(scan),
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

/// Leaves out what cannot be true, and refuses images without a sample.
pub(crate) fn checked(scan: Result<Scan, ReadError>) -> Result<Scan, ReadError> {
    let mut scan = scan.map_err(|mut error| {
        if let ReadError::Incomplete { readable, .. } = &mut error {
            tidy(readable);
        }
        error
    })?;
    tidy(&mut scan);
    if all_missing(&scan) {
        return Err(ReadError::AllMissing {
            channels: scan.channels.len(),
        });
    }
    Ok(scan)
}

/// Leaves out what cannot be a length, a time, a rate or a scale, as damaged headers hold it.
pub(crate) fn tidy(scan: &mut Scan) {
    // Lengths in nm, rates in Hz, times in s; beyond, arithmetic fails.
    let positive = |n: &f64| (1e-9..=1e12).contains(n);
    scan.size_nm = scan.size_nm.filter(|size| size.iter().all(positive));
    scan.line_rate_hz = scan.line_rate_hz.filter(positive);
    scan.line_times_s = scan
        .line_times_s
        .filter(|[a, b]| *a >= 0.0 && *b >= 0.0 && positive(&(a + b)));
    scan.rounding = scan.rounding.filter(|n| *n >= 0.0 && n.is_finite());
    if scan.offset_nm.iter().any(|n| !n.is_finite()) {
        scan.offset_nm = [0.0; 2];
    }
    if !scan.rotation_rad.is_finite() {
        scan.rotation_rad = 0.0;
    }
    for channel in &mut scan.channels {
        channel.width_nm = channel.width_nm.filter(positive);
        channel.height_nm = channel.height_nm.filter(positive);
    }
    let scaled = |channel: &Channel| channel.scale.is_finite() && channel.offset.is_finite();
    let unscaled = scan.channels.extract_if(.., |channel| !scaled(channel));
    scan.unreadable
        .extend(unscaled.map(|channel| UnreadableChannel {
            error: format!(
                "expected a scale, found {} + {}",
                channel.scale, channel.offset
            ),
            name: channel.name,
        }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nonsense_is_left_out() {
        let mut scan = Scan {
            size_nm: Some([f64::INFINITY, 1.0]),
            line_rate_hz: Some(-1.0),
            line_times_s: Some([1.0, 0.0]),
            offset_nm: [f64::NAN, 1.0],
            rotation_rad: f64::INFINITY,
            ..Scan::default()
        };
        tidy(&mut scan);
        assert_eq!((scan.size_nm, scan.line_rate_hz), (None, None));
        assert_eq!(scan.line_times_s, Some([1.0, 0.0]));
        assert_eq!((scan.offset_nm, scan.rotation_rad), ([0.0; 2], 0.0));
    }
}
