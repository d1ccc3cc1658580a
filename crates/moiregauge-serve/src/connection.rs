//! Connections: how many there may be, and how long they may take to say what they want.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use axum::Router;
use axum::extract::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Notify;
use tower::ServiceExt as _;

use crate::lock::lock;

/// How long a connection may take for the head of a request, the pause before it included. Pages that are open ask
/// anew when a connection was closed.
const HEAD_TIME: Duration = Duration::from_secs(60);
/// Connections at the same time: beyond that the oldest ones without the cookie are closed, and with less than a process
/// may have open on any system.
const MOST: usize = 200;
/// Bytes of the head of a request.
const HEAD_BYTES: usize = 32 << 10;
/// Pause after the system gives no connection.
const PAUSE: Duration = Duration::from_millis(50);

/// One connection.
#[derive(Debug, Default)]
pub(crate) struct Connection {
    trusted: AtomicBool,
    close: Notify,
}

impl Connection {
    /// A request on it had the cookie: it is the page.
    pub(crate) fn trust(&self) {
        self.trusted.store(true, Ordering::Relaxed);
    }

    fn is_trusted(&self) -> bool {
        self.trusted.load(Ordering::Relaxed)
    }
}

/// The open ones, the oldest first.
#[derive(Clone, Debug, Default)]
struct Open(Arc<Mutex<VecDeque<Arc<Connection>>>>);

impl Open {
    /// Makes room for one more; none where all are pages.
    fn add(&self) -> Option<Arc<Connection>> {
        let mut open = lock(&self.0);
        if open.len() >= MOST {
            let oldest = open.iter().position(|c| !c.is_trusted())?;
            open.remove(oldest)?.close.notify_one();
        }
        let connection = Arc::new(Connection::default());
        open.push_back(Arc::clone(&connection));
        Some(connection)
    }

    fn remove(&self, connection: &Arc<Connection>) {
        lock(&self.0).retain(|other| !Arc::ptr_eq(other, connection));
    }
}

/// Answers connections until it is dropped.
pub(crate) async fn accept(listener: TcpListener, routes: Router) {
    let open = Open::default();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        let Some(connection) = open.add() else {
            continue;
        };
        let (routes, open) = (routes.clone(), open.clone());
        tokio::spawn(async move {
            tokio::select! {
                () = answer(stream, routes, &connection) => {}
                () = connection.close.notified() => {}
            }
            open.remove(&connection);
        });
    }
}

/// The requests of one connection.
async fn answer(stream: TcpStream, routes: Router, connection: &Arc<Connection>) {
    // Small answers go at once.
    let _ = stream.set_nodelay(true);
    let service = hyper::service::service_fn(|mut request: Request<Incoming>| {
        request.extensions_mut().insert(Arc::clone(connection));
        routes.clone().oneshot(request.map(axum::body::Body::new))
    });
    // How a connection ends is nobody's business.
    let _ = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(HEAD_BYTES)
        .serve_connection(TokioIo::new(stream), service)
        .await;
}
