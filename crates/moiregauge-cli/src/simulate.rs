//! `moiregauge simulate`: sets of scan files whose answer is known, and the answer beside them.

mod args;
mod run;

pub(crate) use args::SimulateArgs;
pub(crate) use run::{run, write_sets};
