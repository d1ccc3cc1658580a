//! Inputs that are in memory and not on a disk: arrays of a host language, files that were opened elsewhere.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use moiregauge_report::InputFile;
use sha2::{Digest as _, Sha256};
use spmfile::{Channel, Samples, Scan};

use crate::content::Content;
use crate::hash::hexadecimal;

/// An input in memory; clones share it.
#[derive(Clone, Debug)]
pub enum Held {
    /// The bytes of a file.
    Bytes(Arc<Content>),
    /// A scan with all that is known of it, and what identifies it. Nothing is told of it any more.
    Scan {
        /// The scan.
        scan: Arc<Scan>,
        /// A hash of its values and their number of bytes.
        input: InputFile,
    },
}

impl Held {
    /// A scan, identified by its values and by all that is known of it.
    #[must_use]
    pub fn scan(scan: Scan) -> Self {
        let bare = |channel: &Channel| Channel {
            samples: Samples::F64(Vec::new()),
            ..channel.clone()
        };
        let known = Scan {
            channels: scan.channels.iter().map(bare).collect(),
            metadata: scan.metadata.clone(),
            notes: scan.notes.clone(),
            format: scan.format.clone(),
            instrument: scan.instrument.clone(),
            unreadable: Vec::new(),
            ..scan
        };
        let mut hash = Sha256::new();
        hash.update(format!("{known:?}"));
        let mut bytes = 0;
        for channel in &scan.channels {
            for row in 0..channel.rows {
                let line = channel.lines(row..row + 1);
                bytes += 8 * line.len() as u64;
                line.iter().for_each(|v| hash.update(v.to_le_bytes()));
            }
        }
        Self::Scan {
            input: InputFile {
                file: String::new(),
                sha256: hexadecimal(&hash.finalize()),
                bytes,
            },
            scan: Arc::new(scan),
        }
    }

    /// What identifies it under this name.
    pub fn identity(&self, name: &Path) -> InputFile {
        match self {
            Self::Bytes(content) => content.identity(name),
            Self::Scan { input, .. } => InputFile {
                file: crate::names::in_words(name),
                ..input.clone()
            },
        }
    }
}

/// Inputs in memory by the names under which they are analysed.
pub type InMemory = Arc<BTreeMap<PathBuf, Held>>;
