//! `moiregauge map`: scan files → maps of twist, strain and lattice with their errors.

mod args;
mod domains;
mod hint;
mod regions;
mod run;
mod words;

pub(crate) use args::MapArgs;
pub(crate) use run::run;
