//! The run: what is asked, what the files hold, what comes out, files.

use std::process::ExitCode;

use super::args::AnalyzeArgs;
use super::outcomes::outcomes;
use super::output::Output;
use super::task::Task;

/// Analyses the files and writes the results.
pub(crate) fn run(args: &AnalyzeArgs) -> anyhow::Result<ExitCode> {
    let task = Task::new(args, "analyze")?;
    let output = Output::new(args, &task)?;
    args.start_threads()?;
    let outcomes = outcomes(&task, args.is_loud())?;
    output.write(&task, &outcomes)
}
