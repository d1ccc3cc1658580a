//! What only a server has: an address, secrets, an end.

use std::sync::Mutex;

use tokio::sync::watch;

use crate::page::Page;
use crate::token::Secret;

/// The way in from outside.
#[derive(Debug)]
pub(crate) struct Door {
    /// The port it listens at.
    pub(crate) port: u16,
    pub(crate) token: Secret,
    /// What lets the browser in that is opened at the start, once.
    pub(crate) ticket: Mutex<Option<Secret>>,
    /// What the cookie holds.
    pub(crate) session: Secret,
    pub(crate) page: Page,
    /// Becomes true when the server ends.
    pub(crate) stop: watch::Receiver<bool>,
}

impl Door {
    /// The name of the cookie: browsers do not keep ports apart.
    pub(crate) fn cookie(&self) -> String {
        format!("moiregauge-{}", self.port)
    }
}
