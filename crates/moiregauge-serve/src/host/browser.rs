//! A browser: one thread, files in memory. What takes its time is done after the answer, when the page asks for a turn.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use axum::body::Body;

use crate::problem::{Answer, Problem};

/// Whether folders can be held open.
pub(crate) const WATCHES_FOLDERS: bool = false;
/// Whether what is kept outlives the page: it outlives what is ended in the middle of a run.
pub(crate) const SAVES: bool = false;

thread_local! {
    static WAITING: RefCell<VecDeque<Box<dyn FnOnce()>>> = RefCell::default();
}

/// Work that is begun: nothing runs beside.
pub(crate) type Running = ();

/// Puts work that takes its time behind what waits already.
pub(crate) fn begin(work: impl FnOnce() + Send + 'static) -> io::Result<Running> {
    WAITING.with_borrow_mut(|waiting| waiting.push_back(Box::new(work)));
    Ok(())
}

/// Does what waits longest; whether there was anything.
pub(crate) fn turn() -> bool {
    let next = WAITING.with_borrow_mut(VecDeque::pop_front);
    next.map(|work| work()).is_some()
}

/// What was begun before has ended.
pub(crate) fn ended((): Running) {}

/// Work that reads files or calculates.
pub(crate) async fn beside<T>(work: impl FnOnce() -> Answer<T>) -> Answer<T> {
    work()
}

/// The next of something: nothing is late within one process.
pub(crate) async fn within<T>(_: Duration, next: impl Future<Output = T>) -> Option<T> {
    Some(next.await)
}

/// A place as it is named: there are no links in memory.
pub(crate) fn real(path: &Path) -> io::Result<PathBuf> {
    std::fs::metadata(path).map(|_| path.to_owned())
}

/// A file that the page has put into its place, read where it is wanted; its bytes.
pub(crate) async fn take(_: Body, _: u64, _: &Path, place: PathBuf) -> Answer<u64> {
    let length = std::fs::metadata(place).map(|found| found.len());
    length.map_err(|error| Problem::missing(error.to_string()))
}

/// A file.
pub(crate) fn put(folder: &Path, name: &str, bytes: &[u8]) -> io::Result<()> {
    std::fs::write(folder.join(name), bytes)
}
