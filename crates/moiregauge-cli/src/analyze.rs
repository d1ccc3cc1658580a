//! `moiregauge analyze`: scan files → drift, twist, strain, figures and report.

mod args;
mod chain;
mod channel;
mod export;
mod files;
mod orientation;
mod summary;
mod task;

use std::process::ExitCode;

pub(crate) use args::{AnalyzeArgs, BackgroundArg, ConventionArg, LineArg, MethodArg};
pub(crate) use chain::{Outcome, Reading, analyse_files, measure_file, progress, read, with_hint};
pub(crate) use channel::channel_names;
pub(crate) use files::write_all;
pub(crate) use moiregauge_pipeline::hexadecimal;
pub(crate) use orientation::{Angle, DirectionArg, parse_angle};
pub(crate) use summary::{caveats as caveat_lines, failures, summary};
pub(crate) use task::{Task, out_beside};

use crate::say::say;
use moiregauge_report::write_report;

/// Whether the program can write Parquet.
const PARQUET: bool = cfg!(feature = "parquet");

/// Analyses the files and writes the results.
pub(crate) fn run(args: &AnalyzeArgs) -> anyhow::Result<ExitCode> {
    let out = args.results_folder();
    files::refuse_overwriting(&out, args.force)?;
    let task = Task::new(args, "analyze")?;
    let exports = export::all(&task.run.export)?;
    anyhow::ensure!(
        PARQUET || !task.run.parquet,
        "--parquet: this program was built without it"
    );
    args.start_threads()?;
    let outcomes = outcomes(&task, args.is_loud())?;
    let folders = files::folders(&out, outcomes.len());
    let (mut failed, mut documents) = (Vec::new(), Vec::new());
    for (number, (outcome, folder)) in outcomes.iter().zip(&folders).enumerate() {
        let Outcome {
            analysis,
            provenance,
        } = outcome;
        let written = write_report(analysis, provenance, &task.run.report)?;
        write_all(folder, &written)?;
        if task.run.parquet {
            write_all(folder, &parquet(outcome)?)?;
        }
        if number == 0 {
            failed.clone_from(&provenance.failed);
            // Images are the same for all moirés. They come after the numbers of the first.
            let known = task.known(&task.inputs);
            failed.extend(export::write(&out, &exports, analysis, &known));
        }
        if !args.quiet && !args.json {
            if outcomes.len() > 1 {
                say(&format!(
                    "\n== moiré {} of {}: {}\n",
                    number + 1,
                    outcomes.len(),
                    analysis.settings.bilayer().name()
                ))?;
            }
            say(&summary(analysis))?;
            say(&format!(
                "\nWritten to {}\n",
                files::main_file(folder, &written).display()
            ))?;
        }
        let results = written.into_iter().find(|(name, _)| name == "results.json");
        documents.extend(results.map(|(_, bytes)| bytes));
    }
    if args.json {
        say(&one_document(&documents))?;
    }
    eprint!("{}", summary::failures(&failed));
    let written: Vec<_> = folders.iter().map(|f| f.join("results.json")).collect();
    Ok(if task.is_same(&written) && failed.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The analysis of every moiré, with the record of the run.
fn outcomes(task: &Task, loud: bool) -> anyhow::Result<Vec<Outcome>> {
    let mut settings = task.run.settings.clone();
    let known = task.known(&task.inputs);
    let atomic = orientation::measure(task, &settings)?;
    if let Some((found, _)) = &atomic {
        settings.lattice_angle = Some(found.known());
        crate::config::check(&settings)?;
    }
    let wanted = task.run.report;
    let outcome = analyse_files(
        &task.inputs,
        &task.run.sets,
        (&settings, &known),
        task.failed.clone(),
        wanted.figures || wanted.png || wanted.html,
        loud,
    );
    let mut outcomes = outcome
        .map_err(|failed| {
            eprint!("{}", summary::failures(&failed));
            if let Some(stripes) = crate::map::stripes_in_words(&task.inputs, &settings, &known) {
                eprintln!("{stripes}");
            }
        })
        .map_err(|()| anyhow::anyhow!("nothing could be analysed"))?;
    for Outcome {
        analysis,
        provenance,
    } in &mut outcomes
    {
        if let Some((found, files)) = &atomic {
            analysis.caveats.extend(found.caveats.iter().cloned());
            analysis.atomic = Some(found.clone());
            provenance.inputs.extend(files.iter().cloned());
        }
        provenance.run = Some(task.record(&known, &provenance.inputs));
    }
    Ok(outcomes)
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
