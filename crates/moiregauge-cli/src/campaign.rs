//! `moiregauge campaign`: many samples, one table.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, ensure};
use moiregauge_pipeline::Job;
use moiregauge_pipeline::samples::{
    Samples, SamplesDone, SamplesError, Shard, analyse_samples, samples_in, samples_of_table,
};

use crate::analyze::AnalyzeArgs;
use crate::config::with_option;
use crate::errors::advice;
use crate::outputs::hinted;
use crate::say::say;

/// Analyse many samples, one folder each, into one table and one page
///
/// Goes through the folders below PATH; every folder that holds scans is a sample. A sample that fails does not stop
/// the others; the exit code is then not 0. If a run is stopped or killed, start it again: only the missing samples are
/// analysed. DIR gets samples.csv (one row for each sample), failed.csv (what failed and why) and campaign.html (a
/// picture and the numbers of each).
#[derive(clap::Args, Clone, Debug)]
#[command(
    override_usage = "moiregauge campaign [OPTIONS] <PATH> --out <DIR>",
    after_long_help = "\
Examples:
  moiregauge campaign samples/ --out all
  moiregauge campaign data/ --out all --samples which.csv --layers graphene/hBN
  moiregauge campaign samples/ --out /shared/all --shard 3/16      (as one of 16 jobs of a cluster)
  moiregauge merge /shared/all --out all"
)]
pub(crate) struct CampaignArgs {
    /// Table (CSV) that says which files belong to which sample: columns sample and path, paths relative to PATH
    /// [default: every folder with scans is a sample]
    #[arg(long, value_name = "FILE")]
    samples: Option<PathBuf>,
    /// Analyse only the I-th of N equal shares of the samples, without tables; `moiregauge merge` makes the tables of
    /// all shares
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    #[command(flatten)]
    pub(crate) analyze: AnalyzeArgs,
}

/// Analyses the samples.
pub(crate) fn run(args: &CampaignArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let analyze = &args.analyze;
    let [root] = analyze.paths() else {
        anyhow::bail!(
            "campaign takes one folder that holds all samples, found {}. --samples FILE says which files belong to \
             which sample",
            analyze.paths().len()
        );
    };
    ensure!(
        root.is_dir(),
        "{}: expected a folder that holds all samples",
        root.display()
    );
    analyze.only_settings()?;
    let out = analyze.out();
    let samples = match &args.samples {
        Some(table) => samples_of_table(table, root),
        None => samples_in(root, out),
    };
    let asked = Samples::new(
        root,
        samples?,
        analyze.settings()?,
        analyze.known.user_specified(),
    );
    let mut asked = asked.map_err(with_option)?.advice(advice);
    if let Some(shard) = args.shard {
        asked = asked.shard(shard);
    }
    let done = match analyse_samples(&asked, out, job) {
        Ok(done) => done,
        Err(SamplesError::Cancelled(cancelled)) => {
            return Err(anyhow::Error::new(cancelled))
                .context("finished samples are kept; run the same command again to continue");
        }
        Err(error) => return Err(in_words(error)),
    };
    if analyze.is_loud() {
        let shard = args.shard.filter(|shard| *shard != Shard::WHOLE);
        let next = match shard {
            None => format!("Written to {}", out.join("campaign.html").display()),
            Some(shard) => format!(
                "Share {} of {} is in {}; `moiregauge merge` makes the tables of all shares",
                shard.number,
                shard.of,
                out.display()
            ),
        };
        say(&format!("{}{next}\n", counts(&done)))?;
    }
    if args.shard.is_none() {
        analyze.show(&out.join("campaign.html"));
    }
    Ok(ended(&done))
}

/// How the samples ended, in a line.
pub(crate) fn counts(done: &SamplesDone) -> String {
    let all = done.ok + done.doubtful + done.failed;
    let samples = if all == 1 { "sample" } else { "samples" };
    let before = match done.done_before {
        0 => String::new(),
        n => format!("; {n} of them were done before"),
    };
    format!(
        "{all} {samples}: {} ok, {} doubtful, {} failed{before}\n",
        done.ok, done.doubtful, done.failed
    )
}

/// Success, where no sample failed.
pub(crate) fn ended(done: &SamplesDone) -> ExitCode {
    if done.failed == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// The error, with the option that helps against it.
pub(crate) fn in_words(error: SamplesError) -> anyhow::Error {
    let hint = match &error {
        SamplesError::MissingShards { .. } => "--incomplete merges without them",
        SamplesError::OtherVersion { .. } | SamplesError::OtherSettings { .. } => {
            "--mixed merges them nevertheless"
        }
        SamplesError::Sink(_) => {
            return match error {
                SamplesError::Sink(error) => hinted(error),
                other => other.into(),
            };
        }
        _ => return error.into(),
    };
    anyhow::anyhow!("{error}; {hint}")
}
