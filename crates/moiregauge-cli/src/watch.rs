//! `moiregauge watch`: a folder that fills while somebody measures.

mod args;
mod duration;
mod exec;
mod keep;
mod run;
mod table;

pub(crate) use args::WatchArgs;
pub(crate) use run::run;
