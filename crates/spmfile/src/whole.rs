//! Does the file hold all that its header promises? The last step of readers of block formats.

use crate::error::ReadError;
use crate::outline::Outline;
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
    /// Bytes given to channels so far.
    taken: u64,
}

impl Extent {
    /// Whether a file of `available` bytes holds the channel from `start` on; a note is kept where it ends before.
    pub(crate) fn take(&mut self, available: u64, start: usize, length: usize, name: &str) -> bool {
        self.announced += 1;
        let (start, length) = (start as u64, length as u64);
        let end = start.saturating_add(length);
        self.expected = self.expected.max(end);
        let found = available.saturating_sub(start);
        self.begun |= found > 0;
        if end > available || end == u64::MAX {
            self.lost.push(UnreadableChannel {
                name: name.to_owned(),
                error: format!("it is {found} bytes long, but its header promises {length}"),
            });
            return false;
        }
        // Data that overlap belong to nobody; this also bounds the memory by the file's length.
        if length > available - self.taken {
            self.lose(
                name.to_owned(),
                "its data overlap with those of others".to_owned(),
            );
            return false;
        }
        self.taken += length;
        true
    }

    /// Counts a channel as lost that a reader could not find itself.
    pub(crate) fn lose(&mut self, name: String, error: String) {
        self.begun = true;
        self.lost.push(UnreadableChannel { name, error });
    }

    /// The outline with what is missing, or the error that the missing bytes call for.
    pub(crate) fn judge(
        self,
        mut outline: Outline<'_>,
        available: u64,
    ) -> Result<Outline<'_>, ReadError> {
        if self.lost.is_empty() {
            return Ok(outline);
        }
        if !self.begun {
            return Err(ReadError::HeaderOnly {
                announced: self.announced,
                expected: self.expected,
                found: available as usize,
            });
        }
        let reasons: Vec<String> = self
            .lost
            .iter()
            .map(|lost| format!("channel {:?}: {}", lost.name, lost.error))
            .collect();
        outline.scan.unreadable.extend(self.lost);
        outline.damage = Some(reasons.join("; "));
        Ok(outline)
    }
}

/// The outline, unless every one of its announced channels is scaled in an unknown way.
pub(crate) fn some_readable(
    outline: Outline<'_>,
    announced: usize,
) -> Result<Outline<'_>, ReadError> {
    match outline.scan.unreadable.first() {
        Some(first) if outline.scan.unreadable.len() == announced => {
            Err(ReadError::NoReadableChannel {
                announced,
                name: first.name.clone(),
                reason: first.error.clone(),
            })
        }
        _ => Ok(outline),
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

/// Leaves out what cannot be a length, a time, a rate or a scale, as damaged headers hold it.
pub(crate) fn tidy(outline: &mut Outline<'_>) {
    let scan = &mut outline.scan;
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
    for entry in &mut outline.channels {
        let header = &mut entry.header;
        header.width_nm = header.width_nm.filter(positive);
        header.height_nm = header.height_nm.filter(positive);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nonsense_is_left_out() {
        let scan = Scan {
            size_nm: Some([f64::INFINITY, 1.0]),
            line_rate_hz: Some(-1.0),
            line_times_s: Some([1.0, 0.0]),
            offset_nm: [f64::NAN, 1.0],
            rotation_rad: f64::INFINITY,
            ..Scan::default()
        };
        let mut outline = Outline::of(scan);
        tidy(&mut outline);
        let scan = outline.scan;
        assert_eq!((scan.size_nm, scan.line_rate_hz), (None, None));
        assert_eq!(scan.line_times_s, Some([1.0, 0.0]));
        assert_eq!((scan.offset_nm, scan.rotation_rad), ([0.0; 2], 0.0));
    }
}
