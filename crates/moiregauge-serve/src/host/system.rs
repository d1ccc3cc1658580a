//! An operating system.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use axum::body::{Body, Bytes};
use axum::http::StatusCode;
use moiregauge_pipeline::Cancel;
use tempfile::NamedTempFile;

use crate::body::pieces;
use crate::problem::{Answer, Problem};

/// Whether what was dropped can change: a folder that the page holds open.
pub(crate) const DROPPED_CHANGES: bool = false;
/// Whether what is kept outlives the page.
pub(crate) const SAVES: bool = true;
/// Room on the stack of a thread that waits for a job.
const STACK: usize = 8 << 20;
/// Between two looks whether something was cancelled.
const OFTEN: Duration = Duration::from_millis(100);

/// Work that runs beside.
pub(crate) type Running = std::thread::JoinHandle<()>;

/// Begins work that takes its time.
pub(crate) fn begin(work: impl FnOnce() + Send + 'static) -> std::io::Result<Running> {
    std::thread::Builder::new().stack_size(STACK).spawn(work)
}

/// Does something again and again, until it has no more to do; what is cancelled is called once more at once.
pub(crate) fn repeat(
    every: Duration,
    cancel: Cancel,
    mut step: impl FnMut() -> bool + Send + 'static,
) -> std::io::Result<()> {
    let driven = begin(move || {
        loop {
            let begun = Instant::now();
            if !step() {
                return;
            }
            while begun.elapsed() < every && !cancel.is_cancelled() {
                std::thread::sleep(OFTEN);
            }
        }
    });
    driven.map(drop)
}

/// Waits until work has ended, however it did.
pub(crate) fn ended(work: Running) {
    let _ = work.join();
}

/// Work that reads files or calculates, beside the threads that answer.
pub(crate) async fn beside<T: Send + 'static>(
    work: impl FnOnce() -> Answer<T> + Send + 'static,
) -> Answer<T> {
    let done = tokio::task::spawn_blocking(work).await;
    done.unwrap_or_else(|_| Err(Problem::fault("a fault of moiregauge, please report it")))
}

/// The next of something, unless it takes longer.
pub(crate) async fn within<T>(time: Duration, next: impl Future<Output = T>) -> Option<T> {
    tokio::time::timeout(time, next).await.ok()
}

/// Where a file or folder is, without links.
pub(crate) fn real(path: &Path) -> std::io::Result<PathBuf> {
    path.canonicalize()
}

/// Takes a file that is sent, whole or not at all; its bytes.
pub(crate) async fn take(body: Body, limit: u64, folder: &Path, place: PathBuf) -> Answer<u64> {
    let file = NamedTempFile::with_prefix_in(".part-", folder);
    // Removed when it is dropped, however this ends.
    let mut file = file.map_err(|e| unwritten(&e))?;
    let bytes = pieces(body, limit, |piece: &Bytes| {
        tokio::task::block_in_place(|| file.write_all(piece)).map_err(|e| unwritten(&e))
    })
    .await?;
    beside(move || {
        let folder = place.parent().unwrap_or(&place);
        std::fs::create_dir_all(folder).map_err(|e| unwritten(&e))?;
        file.persist(&place).map_err(|e| unwritten(&e.error))?;
        Ok(bytes)
    })
    .await
}

fn unwritten(error: &std::io::Error) -> Problem {
    Problem::new(
        StatusCode::INSUFFICIENT_STORAGE,
        format!("the file cannot be kept: {error}"),
    )
}

/// A file, whole and on the disk when this comes back.
pub(crate) fn put(folder: &Path, name: &str, bytes: &[u8]) -> std::io::Result<()> {
    let mut file = NamedTempFile::with_prefix_in(".part-", folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(folder.join(name)).map_err(|e| e.error)?;
    #[cfg(unix)]
    std::fs::File::open(folder)?.sync_all()?;
    Ok(())
}
