//! The routes in memory: for a page that holds program and files itself.

use std::path::Path;
use std::sync::Arc;

use axum::Router;
use axum::body::Body;
use axum::http::{Request, Response};
use futures_util::FutureExt as _;
use tower::ServiceExt as _;

use crate::api::routes;
use crate::app::{App, Scans};
use crate::error::ServeError;
use crate::host::{self, Hub};
use crate::options::Options;
use crate::roots::Roots;
use crate::work::{Campaigns, Maps, Watches, Works};

/// What answers, without an address.
#[derive(Debug)]
pub struct Alone(Router);

impl Alone {
    /// What was dropped lies in `dropped`, which is there; works are kept in [`Options::keep`].
    ///
    /// # Errors
    /// A folder is missing.
    pub fn new(options: &Options, dropped: &Path) -> Result<Self, ServeError> {
        let roots = Roots::new(&options.roots, dropped)?;
        let hub = Arc::new(Hub);
        let app = App {
            options: options.clone(),
            works: Works::new(&hub, options.advice, options.keep.as_deref(), &roots),
            maps: Maps::new(&hub, options.advice),
            campaigns: Campaigns::new(&hub, options.advice),
            watches: Watches::new(&hub, options.advice),
            roots,
            scans: Scans::default(),
        };
        Ok(Self(routes(&Arc::new(app))))
    }

    /// The answer to a request whose body is there; its body is read likewise.
    pub fn answer(&self, request: Request<Vec<u8>>) -> Option<(Response<()>, Vec<u8>)> {
        let asked = self.0.clone().oneshot(request.map(Body::from));
        let Ok(answer) = asked.now_or_never()?;
        let (head, body) = answer.into_parts();
        let body = axum::body::to_bytes(body, usize::MAX).now_or_never()?;
        Some((Response::from_parts(head, ()), body.ok()?.into()))
    }

    /// Does what was begun and waits longest; how long there is nothing to do then, `None`: for ever. Events go to the
    /// standard output.
    pub fn turn(&self) -> Option<std::time::Duration> {
        host::turn()
    }
}
