//! A browser: one thread, files in memory. What takes its time is done after the answer, when the page asks for a turn.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use axum::body::Body;
use moiregauge_pipeline::Cancel;

use crate::problem::{Answer, Problem};

/// Whether what was dropped can change: a folder that the page holds open.
pub(crate) const DROPPED_CHANGES: bool = true;
/// Whether what is kept outlives the page: it outlives what is ended in the middle of a run.
pub(crate) const SAVES: bool = false;

thread_local! {
    static WAITING: RefCell<VecDeque<Box<dyn FnOnce()>>> = RefCell::default();
    static LATER: RefCell<Vec<Again>> = RefCell::default();
}

/// What is done again and again: when next, after what time again, what.
type Again = (Instant, Duration, Box<dyn FnMut() -> bool>);

/// Work that is begun: nothing runs beside.
pub(crate) type Running = ();

/// Puts work that takes its time behind what waits already.
pub(crate) fn begin(work: impl FnOnce() + Send + 'static) -> io::Result<Running> {
    WAITING.with_borrow_mut(|waiting| waiting.push_back(Box::new(work)));
    Ok(())
}

/// Does something again and again, until it has no more to do.
pub(crate) fn repeat(
    every: Duration,
    _: Cancel,
    step: impl FnMut() -> bool + 'static,
) -> io::Result<()> {
    LATER.with_borrow_mut(|later| later.push((Instant::now(), every, Box::new(step))));
    Ok(())
}

/// Does what waits longest, or what is to be done again; how long there is nothing to do then, `None`: for ever.
pub(crate) fn turn() -> Option<Duration> {
    if let Some(work) = WAITING.with_borrow_mut(VecDeque::pop_front) {
        work();
    } else {
        let due = |later: &mut Vec<Again>| {
            let now = Instant::now();
            let place = later.iter().position(|(at, ..)| *at <= now)?;
            Some(later.remove(place))
        };
        if let Some((_, every, mut step)) = LATER.with_borrow_mut(due)
            && step()
        {
            LATER.with_borrow_mut(|later| later.push((Instant::now() + every, every, step)));
        }
    }
    if WAITING.with_borrow(|waiting| !waiting.is_empty()) {
        return Some(Duration::ZERO);
    }
    let next = LATER.with_borrow(|later| later.iter().map(|(at, ..)| *at).min());
    next.map(|at| at.saturating_duration_since(Instant::now()))
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
