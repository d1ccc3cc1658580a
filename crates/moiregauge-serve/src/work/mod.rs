//! Works: files that are analysed together, what is asked of them, its history, and what came out.

mod asked;
mod campaigns;
mod done;
mod history;
mod keep;
mod maps;
mod table;
mod task;
mod watches;
mod works;

pub(crate) use asked::{Asked, Change};
pub(crate) use campaigns::Campaigns;
pub(crate) use done::{Written, command};
pub(crate) use maps::Maps;
pub(crate) use watches::Watches;
pub(crate) use works::{Work, Works};
