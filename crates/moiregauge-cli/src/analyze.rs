//! `moiregauge analyze`: scan files → drift, twist, strain, figures and report.

mod again;
mod args;
mod arguments;
mod by_hand;
mod command;
mod export;
mod orientation;
mod output;
mod run;
mod task;

pub(crate) use args::{AnalyzeArgs, BackgroundArg, ConventionArg, LineArg, MethodArg};
pub(crate) use command::AnalyzeCommand;
pub(crate) use orientation::{Angle, DirectionArg, SenseArg, parse_angle};
pub(crate) use output::report_names;
pub(crate) use run::run;
pub(crate) use task::Task;
