//! `moiregauge analyze`: scan files → drift, twist, strain, figures and report.

mod args;
mod chain;
mod channel;
mod export;
mod files;
mod orientation;
mod task;

use std::path::Path;
use std::process::ExitCode;

use anyhow::Context as _;
use moiregauge::analysis::Picture;
use moiregauge::series::picture;
use moiregauge::settings::Settings;

pub(crate) use args::{AnalyzeArgs, BackgroundArg, ConventionArg, LineArg, MethodArg};
pub(crate) use chain::{
    Outcome, Reading, analyse_files, given_again, measure_file, progress, read, read_again,
    read_any, with_hint,
};
pub(crate) use channel::channel_names;
pub(crate) use files::report_names;
pub(crate) use moiregauge_pipeline::hexadecimal;
pub(crate) use moiregauge_report::screen::{caveats as caveat_lines, failures, summary};
pub(crate) use orientation::{Angle, DirectionArg, SenseArg, parse_angle};
pub(crate) use task::{Task, out_beside};

use crate::hints;
use crate::outputs::{commit, write_all};
use crate::say::say;
use moiregauge::series::{is_nothing_left, refusal};
use moiregauge_report::{InputFile, write_report};

/// Whether the program can write Parquet.
const PARQUET: bool = cfg!(feature = "parquet");

/// Analyses the files and writes the results.
pub(crate) fn run(args: &AnalyzeArgs) -> anyhow::Result<ExitCode> {
    let out = args.results_folder();
    let task = Task::new(args, "analyze")?;
    let exports = export::all(&task.run.export)?;
    anyhow::ensure!(
        PARQUET || !task.run.parquet,
        "--parquet: this program was built without it"
    );
    args.start_threads()?;
    let sink = files::sink((out.as_path(), args.force), &exports, &task.files())?;
    let outcomes = outcomes(&task, args.is_loud())?;
    let refused = outcomes.iter().find_map(|o| refusal(&o.analysis)).cloned();
    if let Some(why) = refused.as_ref().filter(|why| is_nothing_left(&why.doubt)) {
        anyhow::bail!("{}", why.message());
    }
    let (mut failed, mut answers, mut documents) = (Vec::new(), Vec::new(), Vec::new());
    let folders = files::within(outcomes.len());
    for (number, (outcome, within)) in outcomes.iter().zip(&folders).enumerate() {
        let Outcome {
            analysis,
            provenance,
        } = outcome;
        let written = write_report(analysis, provenance, &task.run.report)?;
        write_all(&sink, within, &written)?;
        if task.run.parquet {
            write_all(&sink, within, &parquet(outcome)?)?;
        }
        if number == 0 {
            failed.clone_from(&provenance.failed);
            // Images are the same for all moirés. They come after the numbers of the first.
            let known = task.known(&task.inputs);
            let from = (task.inputs.as_slice(), &known);
            failed.extend(export::write(&sink, &exports, analysis, from));
        }
        if !args.quiet && !args.json {
            if outcomes.len() > 1 {
                answers.push(format!(
                    "\n== moiré {} of {}: {}\n",
                    number + 1,
                    outcomes.len(),
                    analysis.settings.bilayer().name()
                ));
            }
            answers.push(summary(analysis, hints::of));
            answers.push(format!(
                "\nWritten to {}\n",
                files::main_file(&out.join(within), &written).display()
            ));
        }
        let results = written.into_iter().find(|(name, _)| name == "results.json");
        documents.extend(results.map(|(_, bytes)| bytes));
    }
    if args.json {
        answers.push(one_document(&documents));
    }
    commit(sink)?;
    for answer in answers {
        say(&answer)?;
    }
    eprint!("{}", failures(&failed));
    if let Some(why) = &refused {
        eprintln!("error: {}: {}", why.place, why.message());
        if let Some(option) = hints::of(why.code()) {
            eprintln!("try {option}");
        }
    }
    Ok(
        if task.is_same(&documents) && failed.is_empty() && refused.is_none() {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        },
    )
}

/// The analysis of every moiré, with the record of the run.
fn outcomes(task: &Task, loud: bool) -> anyhow::Result<Vec<Outcome>> {
    let mut settings = task.run.settings.clone();
    let known = task.known(&task.inputs);
    let survey = survey_image(task, &settings)?;
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
            eprint!("{}", failures(&failed));
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
        if let Some((picture, file)) = &survey {
            analysis.survey = Some(picture.clone());
            provenance.inputs.push(file.clone());
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

/// The image of a larger area, read before the work.
fn survey_image(task: &Task, settings: &Settings) -> anyhow::Result<Option<(Picture, InputFile)>> {
    let Some(name) = &task.run.survey_image else {
        return Ok(None);
    };
    let path = Path::new(name);
    // What is known of the scans, as their size, is not known of it.
    let reading = read(path, settings, &task.nothing_known(path))
        .with_context(|| format!("--survey-image {name}"))?;
    let shown = picture(name, &reading.scan, settings).with_context(|| {
        format!("--survey-image {name}: it has no image with a size and a place")
    })?;
    Ok(Some((shown, reading.input)))
}
