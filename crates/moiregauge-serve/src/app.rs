//! What all routes share.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use spmfile::Scan;

#[cfg(not(target_family = "wasm"))]
use crate::host::Hub;
use crate::lock::lock;
use crate::options::Options;
use crate::roots::Roots;
use crate::work::{Campaigns, Maps, Watches, Works};

/// Bytes of decoded files that are kept for the next look.
const KEPT_BYTES: usize = 256 << 20;

/// What all routes share.
#[derive(Debug)]
pub(crate) struct App {
    pub(crate) options: Options,
    #[cfg(not(target_family = "wasm"))]
    pub(crate) door: crate::door::Door,
    pub(crate) roots: Roots,
    pub(crate) scans: Scans,
    #[cfg(not(target_family = "wasm"))]
    pub(crate) events: Arc<Hub>,
    pub(crate) works: Works,
    pub(crate) maps: Maps,
    pub(crate) campaigns: Campaigns,
    pub(crate) watches: Watches,
}

/// What is handed to every route.
pub(crate) type Shared = axum::extract::State<Arc<App>>;

/// What tells a version of a file: its place, bytes and time.
type Version = (PathBuf, u64, Option<std::time::SystemTime>);

/// Decoded files, the last ones used.
#[derive(Debug, Default)]
pub(crate) struct Scans(Mutex<VecDeque<(Version, Arc<Scan>)>>);

impl Scans {
    /// A decoded file: one that is kept, or what `decode` gives.
    pub(crate) fn of<E>(
        &self,
        place: &std::path::Path,
        decode: impl FnOnce() -> Result<Scan, E>,
    ) -> Result<Arc<Scan>, E> {
        let metadata = std::fs::metadata(place).ok();
        let version = (
            place.to_owned(),
            metadata.as_ref().map_or(0, std::fs::Metadata::len),
            metadata.and_then(|m| m.modified().ok()),
        );
        {
            let mut kept = lock(&self.0);
            if let Some(found) = kept.iter().position(|(v, _)| *v == version)
                && let Some(entry) = kept.remove(found)
            {
                let scan = Arc::clone(&entry.1);
                kept.push_front(entry);
                return Ok(scan);
            }
        }
        let scan = Arc::new(decode()?);
        let mut kept = lock(&self.0);
        kept.push_front((version, Arc::clone(&scan)));
        let mut bytes = 0;
        let within = kept.iter().take_while(|(_, scan)| {
            bytes += size(scan);
            bytes <= KEPT_BYTES
        });
        // The last one is always kept.
        let count = within.count().max(1);
        kept.truncate(count);
        Ok(scan)
    }
}

fn size(scan: &Scan) -> usize {
    let samples = scan.channels.iter().map(|c| match &c.samples {
        spmfile::Samples::I16(v) => 2 * v.len(),
        spmfile::Samples::I32(v) => 4 * v.len(),
        spmfile::Samples::F32(v) => 4 * v.len(),
        spmfile::Samples::F64(v) => 8 * v.len(),
    });
    samples.sum()
}
