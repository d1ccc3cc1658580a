//! Outcomes → files and words.

use std::path::PathBuf;
use std::process::ExitCode;

use moiregauge::campaign::refusal;
use moiregauge_pipeline::Job;
use moiregauge_pipeline::campaign::{Export, Outcome, Scans, write_corrected};
use moiregauge_pipeline::sink::{FolderSink, Target};
use moiregauge_report::screen::{failures, summary};
use moiregauge_report::{FailedInput, write_report};

use super::args::AnalyzeArgs;
use super::export;
use super::task::Task;
use crate::errors::{self, advice};
use crate::hints;
use crate::outputs::{commit, folder, write_all};
use crate::say::say;

/// Whether the program can write Parquet.
const PARQUET: bool = cfg!(feature = "parquet");

/// What may be written at the top of the folder of results; folders end with a slash.
const NAMES: [&str; 12] = [
    "results.json",
    "report.html",
    "columns.md",
    "vectors.csv",
    "vectors.parquet",
    "scans.csv",
    "scans.parquet",
    "sets.csv",
    "sets.parquet",
    "budget.csv",
    "budget.parquet",
    "figures/",
];

/// Named files in memory.
pub(super) type Files = Vec<(String, Vec<u8>)>;

/// Where results go, and what the screen shows.
pub(super) struct Output {
    out: PathBuf,
    sink: FolderSink,
    exports: Vec<Export>,
    /// Words for people.
    loud: bool,
    /// The document in place of them.
    json: bool,
}

impl Output {
    /// Makes the folder of results ready, before the work.
    ///
    /// # Errors
    /// What is asked cannot be written, or not there.
    pub(super) fn new(args: &AnalyzeArgs, task: &Task) -> anyhow::Result<Self> {
        let exports = export::all(&task.run.export)?;
        anyhow::ensure!(
            PARQUET || !task.run.parquet,
            "--parquet: this program was built without Parquet"
        );
        let moires = (1..=6).map(|n| format!("moire-{n}/"));
        let exported = exports.iter().map(|e| format!("{}/", e.folder));
        let names: Vec<String> = report_names().chain(moires).chain(exported).collect();
        let out = args.results_folder();
        let sink = folder(&Target {
            folder: &out,
            kind: "analyze",
            names: &names,
            inputs: &task.files(),
            force: args.force,
        })?;
        Ok(Self {
            out,
            sink,
            exports,
            loud: args.is_loud(),
            json: args.json,
        })
    }

    /// Where everything is written.
    pub(super) fn sink(&self) -> &FolderSink {
        &self.sink
    }

    /// The page of the first moiré.
    pub(super) fn first_page(&self, moires: usize) -> PathBuf {
        let within = within(moires).swap_remove(0);
        self.out.join(within).join("report.html")
    }

    /// Makes the reports of all moirés, and writes them beside their places.
    pub(super) fn reports(
        &self,
        task: &Task,
        outcomes: &[Outcome],
        job: &Job,
    ) -> anyhow::Result<Vec<Files>> {
        let stage = job.stage("writing", "reports", outcomes.len());
        let folders = within(outcomes.len());
        let all = outcomes.iter().zip(&folders);
        all.map(|(outcome, within)| {
            let written = self.report(task, outcome, within);
            stage.step();
            written
        })
        .collect()
    }

    /// Puts everything in place, and says what came out; the exit code tells whether all went well.
    pub(super) fn write(
        self,
        task: &Task,
        outcomes: &[Outcome],
        reports: Vec<Files>,
        job: &Job,
    ) -> anyhow::Result<ExitCode> {
        let (mut answers, mut documents) = (Vec::new(), Vec::new());
        let folders = within(outcomes.len());
        let all = outcomes.iter().zip(&folders).zip(reports);
        for (number, ((outcome, within), written)) in all.enumerate() {
            if self.loud && outcomes.len() > 1 {
                answers.push(format!(
                    "\n== moiré {} of {}: {}\n",
                    number + 1,
                    outcomes.len(),
                    outcome.analysis.settings.bilayer().name()
                ));
            }
            if self.loud {
                answers.push(summary(&outcome.analysis, hints::of));
                // The file to open first.
                let page = written.iter().any(|(name, _)| name == "report.html");
                let first = if page { "report.html" } else { "results.json" };
                let place = self.out.join(within).join(first);
                answers.push(format!("\nWritten to {}\n", place.display()));
            }
            let results = written.into_iter().find(|(name, _)| name == "results.json");
            documents.extend(results.map(|(_, bytes)| bytes));
        }
        if self.json {
            answers.push(one_document(&documents));
        }
        // Images are the same for all moirés. They come after the numbers.
        let mut failed = Vec::new();
        if let Some(first) = outcomes.first() {
            failed.clone_from(&first.provenance.failed);
            let scans = Scans {
                analysis: &first.analysis,
                inputs: &task.inputs,
                known: &task.known,
                advice,
            };
            let lost = write_corrected(&scans, &self.exports, &self.sink, job)?;
            failed.extend(lost.into_iter().map(|lost| FailedInput {
                error: format!("--export: {}", lost.error),
                ..lost
            }));
        }
        commit(self.sink)?;
        for answer in answers {
            say(&answer)?;
        }
        eprint!("{}", failures(&failed));
        let refused = outcomes.iter().find_map(|o| refusal(&o.analysis));
        if let Some(why) = refused {
            errors::refused(why);
        }
        Ok(
            if task.is_same(&documents) && failed.is_empty() && refused.is_none() {
                ExitCode::SUCCESS
            } else {
                ExitCode::FAILURE
            },
        )
    }

    /// Writes the report of one moiré; returns its files.
    fn report(&self, task: &Task, outcome: &Outcome, within: &str) -> anyhow::Result<Files> {
        let written = write_report(&outcome.analysis, &outcome.provenance, &task.run.report)?;
        write_all(&self.sink, within, &written)?;
        if task.run.parquet {
            write_all(&self.sink, within, &parquet(outcome)?)?;
        }
        Ok(written)
    }
}

/// What the report of an analysis consists of.
pub(crate) fn report_names() -> impl Iterator<Item = String> {
    NAMES.map(str::to_owned).into_iter()
}

/// Where the results of each of `moires` moirés go within the folder.
fn within(moires: usize) -> Vec<String> {
    if moires == 1 {
        return vec![String::new()];
    }
    (1..=moires).map(|n| format!("moire-{n}/")).collect()
}

/// One JSON document: that of the only moiré, or a list of those of all.
fn one_document(all: &[Vec<u8>]) -> String {
    let texts: Vec<_> = all.iter().map(|b| String::from_utf8_lossy(b)).collect();
    match texts.as_slice() {
        [one] => one.to_string(),
        many => {
            let parts: Vec<&str> = many.iter().map(|text| text.trim_end()).collect();
            format!("[\n{}\n]\n", parts.join(",\n"))
        }
    }
}

/// The tables as Parquet.
#[cfg(feature = "parquet")]
fn parquet(outcome: &Outcome) -> anyhow::Result<Vec<(String, Vec<u8>)>> {
    let tables = moiregauge_report::parquet_tables(&outcome.analysis, &outcome.provenance)?;
    Ok(tables)
}

/// None, in a program that was built without.
#[cfg(not(feature = "parquet"))]
fn parquet(_: &Outcome) -> anyhow::Result<Vec<(String, Vec<u8>)>> {
    anyhow::bail!("this program was built without Parquet")
}
