//! `moiregauge map`: scan files → maps of twist, strain and lattice with their errors.

mod args;
mod domains;
mod hint;
mod options;
mod regions;
mod run;
mod words;

pub(crate) use args::MapArgs;
pub(crate) use options::as_options;
pub(crate) use run::run;
