//! `moiregauge analyze`: scan files → drift, twist, strain, figures and report.

mod args;
mod chain;
mod channel;
mod export;
mod files;
mod orientation;

use std::path::Path;
use std::process::ExitCode;

use anyhow::Context as _;
use moiregauge::analysis::Picture;
use moiregauge::series::picture;
use moiregauge::settings::Settings;

pub(crate) use args::{AnalyzeArgs, BackgroundArg, ConventionArg, LineArg, MethodArg};
pub(crate) use chain::{
    Outcome, Reading, analyse_files, given_again, hexadecimal, measure_file, progress, read,
    read_again, with_hint,
};
pub(crate) use channel::channel_names;
pub(crate) use files::report_names;
pub(crate) use moiregauge_report::screen::{caveats as caveat_lines, failures, summary};
pub(crate) use orientation::{Angle, DirectionArg, SenseArg, parse_angle};

use crate::info::inputs;
use crate::input::KnownArgs;
use crate::outputs::{commit, write_all};
use crate::say::say;
use moiregauge::series::refusal;
use moiregauge_report::{InputFile, write_report};

/// Analyses the files and writes the results.
pub(crate) fn run(args: &AnalyzeArgs) -> anyhow::Result<ExitCode> {
    let mut settings = args.settings()?;
    let exports = args.exports()?;
    args.start_threads()?;
    let (inputs, failed) = inputs(&args.paths);
    let sink = files::sink(args, &exports, &inputs)?;
    let loud = args.is_loud();
    let known = args.known.of(&inputs);
    let survey = args
        .survey_image
        .as_deref()
        .map(|path| survey_image(path, &settings))
        .transpose()?;
    let atomic = args.orientation.measure(&settings, &args.known)?;
    if let Some((found, _)) = &atomic {
        settings.lattice_angle = Some(found.known());
        crate::config::check(&settings)?;
    }
    let outcome = analyse_files(
        &inputs,
        &args.sets()?,
        (&settings, &known),
        failed,
        args.illustrated(),
        loud,
    );
    let mut outcomes = outcome
        .map_err(|failed| {
            eprint!("{}", failures(&failed));
            if let Some(stripes) = crate::map::stripes_in_words(&inputs, &settings, &known) {
                eprintln!("{stripes}");
            }
        })
        .map_err(|()| anyhow::anyhow!("nothing could be analysed"))?;
    if let Some((found, files)) = atomic {
        for Outcome {
            analysis,
            provenance,
        } in &mut outcomes
        {
            analysis.caveats.extend(found.caveats.iter().cloned());
            analysis.atomic = Some(found.clone());
            provenance.inputs.extend(files.iter().cloned());
        }
    }
    if let Some((picture, file)) = survey {
        for outcome in &mut outcomes {
            outcome.analysis.survey = Some(picture.clone());
            outcome.provenance.inputs.push(file.clone());
        }
    }
    let refused = outcomes.iter().find_map(|o| refusal(&o.analysis)).cloned();
    if let Some(why) = refused
        .as_ref()
        .filter(|why| why.code == "everything-excluded")
    {
        anyhow::bail!("{}", why.message);
    }
    let (mut failed, mut answers) = (Vec::new(), Vec::new());
    let folders = files::within(outcomes.len());
    for (number, (outcome, within)) in outcomes.iter().zip(&folders).enumerate() {
        let Outcome {
            analysis,
            provenance,
        } = outcome;
        let written = write_report(analysis, provenance, &args.choice())?;
        write_all(&sink, within, &written)?;
        #[cfg(feature = "parquet")]
        if args.parquet {
            let tables = moiregauge_report::parquet_tables(analysis, provenance)?;
            write_all(&sink, within, &tables)?;
        }
        if number == 0 {
            failed.clone_from(&provenance.failed);
            // Images are the same for all moirés. They come after the numbers of the first.
            let from = (inputs.as_slice(), &known);
            failed.extend(export::write(&sink, &exports, analysis, from));
        }
        if args.json {
            let results = written.iter().find(|(name, _)| name == "results.json");
            if let Some((_, bytes)) = results {
                answers.push(String::from_utf8_lossy(bytes).into_owned());
            }
        } else if !args.quiet {
            if outcomes.len() > 1 {
                answers.push(format!(
                    "\n== moiré {} of {}: {}\n",
                    number + 1,
                    outcomes.len(),
                    analysis.settings.bilayer().name()
                ));
            }
            answers.push(summary(analysis));
            answers.push(format!(
                "\nWritten to {}\n",
                files::main_file(&args.out.join(within), &written).display()
            ));
        }
    }
    commit(sink)?;
    for answer in answers {
        say(&answer)?;
    }
    eprint!("{}", failures(&failed));
    if let Some(why) = &refused {
        eprintln!("error: {}: {}", why.place, why.message);
    }
    Ok(if failed.is_empty() && refused.is_none() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The image of a larger area, read before the work.
fn survey_image(path: &Path, settings: &Settings) -> anyhow::Result<(Picture, InputFile)> {
    let paths = [path.to_owned()];
    // What is known of the scans, as their size, is not known of it.
    let reading = read(path, settings, &KnownArgs::default().of(&paths))
        .with_context(|| format!("--survey-image {}", path.display()))?;
    let name = path.display().to_string();
    let shown = picture(&name, &reading.scan, settings).with_context(|| {
        format!("--survey-image {name}: it has no image with a size and a place")
    })?;
    Ok((shown, reading.input))
}
