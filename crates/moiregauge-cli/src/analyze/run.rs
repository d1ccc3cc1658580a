//! The run: what is asked, what the files hold, what comes out, files.

use std::process::ExitCode;

use moiregauge_pipeline::Job;
use moiregauge_pipeline::campaign::{Campaign, Outcome, outcomes};

use super::args::AnalyzeArgs;
use super::output::Output;
use super::task::Task;
use crate::errors::in_words;
use crate::interrupt::{kept_for_next, take};
use crate::stripes;

/// Analyses the files and writes the results.
pub(crate) fn run(args: &AnalyzeArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let task = Task::new(args, "analyze")?;
    let output = Output::new(args, &task)?;
    let mut campaign = task.campaign()?;
    take(output.sink(), &mut campaign);
    // Two steps that can be stopped. What follows takes no time.
    let outcomes = analysed(&task, &mut campaign, job)
        .map_err(|error| kept_for_next(error, output.sink(), &campaign))?;
    let reports = job.run(|| output.reports(&task, &outcomes, job));
    let reports = reports.unwrap_or_else(|cancelled| Err(cancelled.into()));
    let reports = reports.map_err(|error| kept_for_next(error, output.sink(), &campaign))?;
    let first = output.first_page(outcomes.len());
    let ended = output.write(&task, &outcomes, reports, job)?;
    args.show(&first);
    Ok(ended)
}

fn analysed(task: &Task, campaign: &mut Campaign, job: &Job) -> anyhow::Result<Vec<Outcome>> {
    let found = outcomes(&task.run, task.places(), campaign, job, |measured| {
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
