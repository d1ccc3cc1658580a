//! The run: what is asked, a map of large images, of lattices or of stripes, files.

use std::path::Path;
use std::process::ExitCode;

use super::args::MapArgs;
use super::lattice::{Answer, together};
use super::survey::survey;
use super::{output, stripes};
use crate::analyze::Task;
use moiregauge_pipeline::Job;
use moiregauge_report::screen::failures;

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
    let sink = output::sink(args, &task.files())?;
    let document = args.analyze.out().join("map.json");
    let mut made = match survey(args, &task, &sink, job)? {
        Some(made) => made,
        None => match together(args, &task, &sink, job)? {
            Answer::Lattice(made) => *made,
            Answer::Stripes(mut found) => {
                let provenance = &mut found.provenance;
                provenance.run = Some(task.record(&provenance.inputs));
                stripes::write(&found, args, sink)?;
                return Ok(ended(task.is_same(&written(&document))));
            }
        },
    };
    made.provenance.run = Some(task.record(&made.provenance.inputs));
    let lost = failures(&made.provenance.failed);
    let complete = made.provenance.failed.is_empty();
    output::write(&made, args, sink)?;
    eprint!("{lost}");
    Ok(ended(task.is_same(&written(&document)) && complete))
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
