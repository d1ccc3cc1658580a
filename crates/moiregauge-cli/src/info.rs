//! `moiregauge info`: what scan files hold, how it is scaled, what the analysis would miss.

mod run;
mod table;

pub(crate) use run::{InfoArgs, run};
