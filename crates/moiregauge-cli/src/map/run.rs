//! The run: what is asked, a map of large images, of lattices or of stripes, files.

use std::path::Path;
use std::process::ExitCode;

use moiregauge_pipeline::Job;
use moiregauge_pipeline::maps::{MAP_FILES, MapFound};
use moiregauge_pipeline::sink::{FolderSink, Target};
use moiregauge_report::results::MapResults;
use moiregauge_report::screen::failures;

use super::args::MapArgs;
use super::hint::in_words;
use super::words::summary;
use crate::analyze::Task;
use crate::errors::refused;
use crate::interrupt::{kept_for_next, take};
use crate::outputs;
use crate::say::say;

/// Makes the maps and writes them.
pub(crate) fn run(args: &MapArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let task = Task::new(&args.analyze, "map")?;
    let as_before;
    let args = if args.analyze.is_replay() {
        as_before = args.again(&task)?;
        &as_before
    } else {
        args
    };
    args.check(&task)?;
    let sink = outputs::folder(&Target {
        folder: args.analyze.out(),
        kind: "map",
        names: &MAP_FILES.map(str::to_owned),
        inputs: &task.files(),
        force: args.analyze.force(),
    })?;
    let request = args.request();
    let mut campaign = task.campaign()?.illustrated(false);
    take(&sink, &mut campaign);
    let found = moiregauge_pipeline::map(&mut campaign, &request, &sink, job);
    let mut found: MapFound =
        found.map_err(|error| kept_for_next(in_words(error), &sink, &campaign))?;
    found.provenance.run = Some(task.record(&found.provenance.inputs));
    let results = found.write(&request, args.analyze.choice(), &sink);
    told(args, &results.map_err(in_words)?, sink)?;
    let failed = &found.provenance.failed;
    eprint!("{}", failures(failed));
    if let Some(why) = &found.refused {
        refused(why);
    }
    let same = task.is_same(&written(&args.analyze.out().join("map.json")));
    Ok(ended(same && failed.is_empty() && found.refused.is_none()))
}

/// Puts everything in place and says what there is.
fn told(args: &MapArgs, results: &MapResults, sink: FolderSink) -> anyhow::Result<()> {
    outputs::commit(sink)?;
    let out = args.analyze.out();
    args.analyze.show(&out.join("report.html"));
    if args.analyze.json() {
        say(&format!("{}\n", serde_json::to_string_pretty(results)?))?;
    } else if args.analyze.is_loud() {
        say(&summary(results))?;
        say(&format!(
            "\nWritten to {}\n",
            out.join("map.json").display()
        ))?;
    }
    Ok(())
}

/// The document of a map, if it can be read.
fn written(document: &Path) -> Vec<Vec<u8>> {
    std::fs::read(document).into_iter().collect()
}

fn ended(well: bool) -> ExitCode {
    if well {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
