//! What all routes share.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use spmfile::Scan;
use tokio::sync::watch;

use crate::events::Hub;
use crate::lock::lock;
use crate::options::Options;
use crate::page::Page;
use crate::roots::Roots;
use crate::token::Secret;
use crate::work::{Maps, Watches, Works};

/// Bytes of decoded files that are kept for the next look.
const KEPT_BYTES: usize = 256 << 20;

/// What all routes share.
#[derive(Debug)]
pub(crate) struct App {
    pub(crate) options: Options,
    /// The port it listens at.
    pub(crate) port: u16,
    pub(crate) token: Secret,
    /// What lets the browser in that is opened at the start, once.
    pub(crate) ticket: Mutex<Option<Secret>>,
    /// What the cookie holds.
    pub(crate) session: Secret,
    pub(crate) roots: Roots,
    pub(crate) page: Page,
    pub(crate) scans: Scans,
    pub(crate) events: Arc<Hub>,
    pub(crate) works: Works,
    pub(crate) maps: Maps,
    pub(crate) watches: Watches,
    /// Becomes true when the server ends.
    pub(crate) stop: watch::Receiver<bool>,
}

/// What is handed to every route.
pub(crate) type Shared = axum::extract::State<Arc<App>>;

impl App {
    /// The name of the cookie: browsers do not keep ports apart.
    pub(crate) fn cookie(&self) -> String {
        format!("moiregauge-{}", self.port)
    }
}

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
