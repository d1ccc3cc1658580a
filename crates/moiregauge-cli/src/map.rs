//! `moiregauge map`: scan files → maps of twist, strain and lattice with their errors.

mod args;
mod domains;
mod kept;
mod large;
mod lattice;
mod made;
mod output;
mod regions;
mod run;
mod source;
mod stripes;
mod survey;
mod words;

pub(crate) use args::MapArgs;
pub(crate) use regions::{length, parse_region};
pub(crate) use run::run;
