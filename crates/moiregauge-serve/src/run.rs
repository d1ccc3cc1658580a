//! A server from its start to its end.

use std::fs::{File, TryLockError};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use moiregauge_pipeline::Cancel;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::watch;

use crate::api::routes;
use crate::app::{App, Scans};
use crate::connection::accept;
use crate::door::Door;
use crate::error::ServeError;
use crate::host::Hub;
use crate::lock::lock;
use crate::options::Options;
use crate::page::Page;
use crate::roots::Roots;
use crate::token::Secret;
use crate::work::{Campaigns, Maps, Watches, Works};

/// How often the wish to stop is looked for.
const OFTEN: Duration = Duration::from_millis(100);
/// How long files that are being read may hold up the end.
const LAST: Duration = Duration::from_millis(300);
/// Threads that answer. What takes long has others.
const THREADS: usize = 2;
/// Threads that read files.
const READING: usize = 8;

/// Answers until it is cancelled. `ready` hears the address, with the token, as soon as it answers.
///
/// # Errors
/// [`ServeError`].
pub fn serve(
    options: &Options,
    cancel: &Cancel,
    ready: &mut dyn FnMut(&str),
) -> Result<(), ServeError> {
    let token = token(options)?;
    // Removed in the end, with what was dropped.
    let temporary = TempDir::with_prefix("moiregauge-").map_err(ServeError::System)?;
    let dropped = match &options.keep {
        Some(keep) => keep.join("dropped"),
        None => temporary.path().to_owned(),
    };
    std::fs::create_dir_all(&dropped).map_err(ServeError::System)?;
    let _kept = options.keep.as_deref().map(locked).transpose()?;
    let roots = Roots::new(&options.roots, &dropped)?;
    let page = page(options)?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(THREADS)
        .max_blocking_threads(READING)
        .enable_all()
        .build()
        .map_err(ServeError::System)?;
    let (stopping, stop) = watch::channel(false);
    let served = runtime.block_on(async {
        let address = SocketAddr::new(options.address, options.port);
        let refused = |source| ServeError::Listen { address, source };
        let listener = TcpListener::bind(address).await.map_err(refused)?;
        let here = listener.local_addr().map_err(refused)?;
        let session = Secret::random()?;
        let run = Secret::random()?;
        let ticket = Secret::random()?;
        let hub = Arc::new(Hub::new(&run.text()[..8]));
        let works = Works::new(&hub, options.advice, options.keep.as_deref(), &roots);
        let maps = Maps::new(&hub, options.advice);
        let campaigns = Campaigns::new(&hub, options.advice);
        let watches = Watches::new(&hub, options.advice);
        options.feed.iter().for_each(|feed| watches.listen(feed));
        let app = Arc::new(App {
            options: options.clone(),
            door: Door {
                port: here.port(),
                token,
                ticket: Mutex::default(),
                session,
                page,
                stop,
            },
            roots,
            scans: Scans::default(),
            events: hub,
            works,
            maps,
            campaigns,
            watches,
        });
        let shown = url(here, &app.door.token);
        let accepting = tokio::spawn(accept(listener, routes(&app)));
        ready(&shown);
        if options.browser {
            let address = url(here, &ticket);
            *lock(&app.door.ticket) = Some(ticket);
            open(address);
        }
        while !cancel.is_cancelled() {
            tokio::time::sleep(OFTEN).await;
        }
        accepting.abort();
        app.works.cancel();
        app.maps.cancel();
        app.campaigns.cancel();
        app.watches.cancel();
        Ok(app)
    });
    // Streams of events end with it.
    stopping.send_replace(true);
    runtime.shutdown_timeout(LAST);
    served.map(drop)
}

/// The folder of works, for this server alone as long as it runs, however it ends. Where a file system has no locks
/// nothing is refused.
fn locked(keep: &Path) -> Result<File, ServeError> {
    let lock = File::create(keep.join("lock")).map_err(ServeError::System)?;
    match lock.try_lock() {
        Err(TryLockError::WouldBlock) => Err(ServeError::InUse(keep.to_owned())),
        _ => Ok(lock),
    }
}

/// The token: that of the file, or a new one.
fn token(options: &Options) -> Result<Secret, ServeError> {
    match &options.token_file {
        Some(file) => Secret::of_file(file),
        None if options.address.is_loopback() => Secret::random(),
        None => Err(ServeError::NotAlone(options.address)),
    }
}

fn page(options: &Options) -> Result<Page, ServeError> {
    let Some(folder) = &options.page else {
        return Ok(Page::Within);
    };
    let real: std::io::Result<PathBuf> = folder.canonicalize();
    let refused = |reason: String| ServeError::Folder {
        folder: folder.clone(),
        reason,
    };
    let real = real.map_err(|e| refused(format!("found none: {e}")))?;
    if !real.join("index.html").is_file() {
        return Err(refused("found none with index.html".to_owned()));
    }
    Ok(Page::Folder(real))
}

/// The address for a browser. What follows the # is never sent to any server.
fn url(here: SocketAddr, secret: &Secret) -> String {
    let mut shown = here;
    if here.ip().is_unspecified() {
        shown.set_ip(std::net::Ipv4Addr::LOCALHOST.into());
    }
    format!("http://{shown}/#token={}", secret.text())
}

/// Opens the page; without a browser the address is on the screen. Other users of the computer may see what a browser is
/// started with: its secret lets one page in, once.
fn open(address: String) {
    std::thread::spawn(move || drop(open::that_detached(address)));
}
