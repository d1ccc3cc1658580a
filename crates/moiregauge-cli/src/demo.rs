//! `moiregauge demo`: simulate the paper's three sets, analyse them, compare with the truth.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use moiregauge::settings::Settings;
use moiregauge_pipeline::Job;
use moiregauge_pipeline::campaign::{Campaign, Outcome};
use moiregauge_pipeline::simulate::paper_sets;
use moiregauge_pipeline::sink::Target;
use moiregauge_report::screen::summary;
use moiregauge_report::{Choice, write_report};

use crate::analyze::report_names;
use crate::errors::in_words;
use crate::outputs;
use crate::paths::expand;
use crate::say::say;
use crate::simulate::write_sets;

/// Simulate the three sets of arXiv 2406.08681, analyse them and show where the report is
///
/// Needs no data: writes 26 simulated scans with their truth, runs the whole analysis on them and
/// prints the results beside the true values.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct DemoArgs {
    /// Folder for scans and results [default: moiregauge-demo, or the next free number]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of all noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Replace files of the same names
    #[arg(long)]
    force: bool,
}

/// Runs the demonstration.
pub(crate) fn run(args: &DemoArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let out = args.out.clone().unwrap_or_else(free_folder);
    let sets = paper_sets(args.seed);
    let results = out.join("results");
    let names: Vec<String> = report_names().collect();
    let sink = outputs::folder(&Target {
        folder: &results,
        kind: "analyze",
        names: &names,
        inputs: &[],
        force: args.force,
    })?;
    say(&format!(
        "Simulating three sets of scans in {} …\n",
        out.display()
    ))?;
    let folders = write_sets(&sets, &out.join("scans"), args.force, job)?;
    say("Analysing them …\n\n")?;
    let inputs: Vec<PathBuf> = expand(&folders, false).into_iter().flatten().collect();
    let settings = Settings {
        seed: args.seed,
        layers_chosen: true,
        ..Settings::default()
    };
    let mut campaign = Campaign::new(settings)?.illustrated(true);
    campaign.add(inputs);
    let analysed = campaign.analyse(job).map_err(in_words)?.pop();
    let Outcome {
        analysis,
        provenance,
    } = analysed.context("the simulated scans could not be analysed")?;
    let stage = job.stage("writing", "reports", 1);
    let report = write_report(&analysis, &provenance, &Choice::default())?;
    drop(stage);
    outputs::write_all(&sink, "", &report)?;
    outputs::commit(sink)?;
    say(&summary(&analysis, crate::hints::of))?;
    let truth = &sets[0];
    say(&format!(
        "\nTrue values of the simulation: twist {}°, heterostrain {} %, drift ({}, {}) nm/min\n",
        truth.sample.twist_deg,
        truth.sample.strain_percent,
        truth.drift.velocity_nm_per_min[0],
        truth.drift.velocity_nm_per_min[1],
    ))?;
    say(&format!(
        "Report: {}\n",
        results.join("report.html").display()
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// `moiregauge-demo`, or the first free `moiregauge-demo-N`.
fn free_folder() -> PathBuf {
    let name = |n: u32| match n {
        1 => PathBuf::from("moiregauge-demo"),
        n => PathBuf::from(format!("moiregauge-demo-{n}")),
    };
    (1..1000)
        .map(name)
        .find(|p| !p.exists())
        .unwrap_or_else(|| name(1))
}
