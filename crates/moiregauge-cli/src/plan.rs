//! `moiregauge plan`: wanted errors and an instrument → how to scan, how long, and what limits.

mod run;
mod words;

pub(crate) use run::{PlanArgs, run};
