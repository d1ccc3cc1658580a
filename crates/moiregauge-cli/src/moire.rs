//! `moiregauge moire`: layers, twist and strain → the moiré they make; and a moiré → what it means.

mod args;
mod run;
mod words;

pub(crate) use args::MoireArgs;
pub(crate) use run::run;
