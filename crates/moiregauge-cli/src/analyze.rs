//! `moiregauge analyze`: scan files → drift, twist, strain, figures and report.

mod again;
mod args;
mod arguments;
mod atomic;
mod chain;
mod channel;
mod export;
mod measure;
mod orientation;
mod outcomes;
mod output;
mod overlap;
mod run;
mod shown;
mod survey;
mod task;

pub(crate) use args::{AnalyzeArgs, BackgroundArg, ConventionArg, LineArg, MethodArg};
pub(crate) use chain::{Outcome, analyse_files};
pub(crate) use measure::{given_again, measure_file, with_hint};
pub(crate) use orientation::{Angle, DirectionArg, SenseArg, parse_angle};
pub(crate) use output::report_names;
pub(crate) use run::run;
pub(crate) use task::Task;
