//! The run: what is asked, what the files hold, what comes out, files.

use std::process::ExitCode;

use moiregauge_pipeline::Job;
use moiregauge_pipeline::campaign::{Outcome, outcomes};

use super::args::AnalyzeArgs;
use super::hint::in_words;
use super::output::Output;
use super::task::Task;
use crate::stripes;

/// Analyses the files and writes the results.
pub(crate) fn run(args: &AnalyzeArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let task = Task::new(args, "analyze")?;
    let output = Output::new(args, &task)?;
    let outcomes = analysed(&task, job)?;
    output.write(&task, &outcomes)
}

fn analysed(task: &Task, job: &Job) -> anyhow::Result<Vec<Outcome>> {
    let mut campaign = task.campaign()?;
    let found = outcomes(&task.run, task.places(), &mut campaign, job, |measured| {
        task.record(measured)
    });
    found.map_err(|error| {
        let nothing = error.is_of_scans();
        let words = in_words(error);
        if nothing {
            let stripes = stripes::in_words(&task.inputs, campaign.settings(), &task.known);
            if let Some(stripes) = stripes {
                eprintln!("{stripes}");
            }
        }
        words
    })
}
