//! Works: files that are analysed together, what is asked of them, its history, and what came out.

mod asked;
mod done;
mod history;
mod keep;
mod task;
mod works;

pub(crate) use asked::{Asked, Change};
pub(crate) use done::{Done, command};
pub(crate) use task::{NoResult, Progress, run_beside};
pub(crate) use works::{Work, Works};
