//! What a server is started with.

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;

use moiregauge_pipeline::campaign::{Advice, no_advice};

use crate::feed::Feed;

/// Bytes of one uploaded file, at most.
const UPLOAD_LIMIT: u64 = 4 << 30;

/// What a server is started with.
#[derive(Clone, Debug)]
pub struct Options {
    /// The folders whose files may be opened.
    pub roots: Vec<PathBuf>,
    /// Where it listens.
    pub address: IpAddr,
    /// At which port; 0: one that is free.
    pub port: u16,
    /// A file with the token; needed where others than this computer can connect.
    pub token_file: Option<PathBuf>,
    /// The folder of the page, in place of the page within.
    pub page: Option<PathBuf>,
    /// Where works are kept.
    pub keep: Option<PathBuf>,
    /// A watch that somebody else drives.
    pub feed: Option<Feed>,
    /// Whether a browser is opened.
    pub browser: bool,
    /// Bytes of one uploaded file, at most.
    pub upload_limit: u64,
    /// What helps against an error, in the words of the program.
    pub advice: Advice,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            roots: Vec::new(),
            address: Ipv4Addr::LOCALHOST.into(),
            port: 0,
            token_file: None,
            page: None,
            keep: None,
            feed: None,
            browser: false,
            upload_limit: UPLOAD_LIMIT,
            advice: no_advice,
        }
    }
}
