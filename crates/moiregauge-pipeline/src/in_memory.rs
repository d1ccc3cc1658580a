//! Scans that never were files: arrays of a host language.

use std::sync::Arc;

use moiregauge_report::InputFile;
use sha2::{Digest as _, Sha256};
use spmfile::{Channel, Samples, Scan};

use crate::hash::hexadecimal;

/// A scan in memory with all that is known of it; clones share it. Nothing is told of it any more.
#[derive(Clone, Debug)]
pub struct ScanInMemory {
    scan: Arc<Scan>,
    sha256: String,
    bytes: u64,
}

/// The same values, and the same is known of them.
impl PartialEq for ScanInMemory {
    fn eq(&self, other: &Self) -> bool {
        self.sha256 == other.sha256
    }
}

impl Eq for ScanInMemory {}

impl ScanInMemory {
    /// A scan, identified by its values and by all that is known of it.
    #[must_use]
    pub fn new(scan: Scan) -> Self {
        let mut hash = Sha256::new();
        let mut bytes = 0;
        for channel in &scan.channels {
            for row in 0..channel.rows {
                let line = channel.lines(row..row + 1);
                bytes += 8 * line.len() as u64;
                for value in line {
                    hash.update(value.to_le_bytes());
                }
            }
        }
        let bare = |channel: &Channel| Channel {
            name: channel.name.clone(),
            internal_name: channel.internal_name.clone(),
            unit: channel.unit.clone(),
            scan_line: channel.scan_line.clone(),
            scaling: channel.scaling.clone(),
            plane_fit: channel.plane_fit.clone(),
            samples: Samples::F64(Vec::new()),
            ..*channel
        };
        let known = Scan {
            format: scan.format.clone(),
            instrument: scan.instrument.clone(),
            channels: scan.channels.iter().map(bare).collect(),
            unreadable: Vec::new(),
            notes: scan.notes.clone(),
            metadata: scan.metadata.clone(),
            ..scan
        };
        hash.update(format!("{known:?}"));
        Self {
            sha256: hexadecimal(&hash.finalize()),
            bytes,
            scan: Arc::new(scan),
        }
    }

    /// The scan.
    pub fn scan(&self) -> Arc<Scan> {
        Arc::clone(&self.scan)
    }

    /// What identifies it under a name: a hash, and the size of its values.
    pub fn identity(&self, file: String) -> InputFile {
        InputFile {
            file,
            sha256: self.sha256.clone(),
            bytes: self.bytes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_and_what_is_known_of_them_identify_a_scan() {
        let scan = |value: f64, rate: f64| {
            let file = format!("1 2\n3 {value}\n");
            let options = spmfile::arrays::ArrayOptions {
                size_nm: Some([1.0, 1.0]),
                line_rate_hz: Some(rate),
                ..Default::default()
            };
            let read = spmfile::arrays::read(file.as_bytes(), &options, &|_| true);
            ScanInMemory::new(read.unwrap())
        };
        assert_eq!(scan(4.0, 1.0), scan(4.0, 1.0));
        assert_ne!(scan(4.0, 1.0), scan(5.0, 1.0));
        assert_ne!(scan(4.0, 1.0), scan(4.0, 2.0));
        assert_eq!(scan(4.0, 1.0).identity("a".to_owned()).bytes, 32);
    }
}
