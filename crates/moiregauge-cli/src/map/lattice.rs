//! Scans that show a lattice → their analysis, their maps, the average of these.

use anyhow::{bail, ensure};
use moiregauge::campaign::Analysis;
use moiregauge::campaign::{is_nothing_left, refusal};
use moiregauge_pipeline::Job;
use moiregauge_pipeline::campaign::Outcome;
use moiregauge_pipeline::maps::{NoMap, Scans, map_lattices};
use moiregauge_pipeline::sink::FolderSink;
use moiregauge_report::Provenance;
use moiregauge_report::screen::failures;

use super::args::MapArgs;
use super::made::Made;
use super::stripes::{self, Striped};
use crate::analyze::{Task, advice, in_words};
use crate::interrupt::{kept_for_next, take};

/// What scans show.
pub(super) enum Answer {
    Lattice(Box<Made>),
    Stripes(Box<Striped>),
}

/// Analyses all scans, maps them, and averages; stripes, where none of them shows a lattice.
pub(super) fn together(
    args: &MapArgs,
    task: &Task,
    sink: &FolderSink,
    job: &Job,
) -> anyhow::Result<Answer> {
    let (inputs, settings, known) = (&task.inputs, &task.run.settings, &task.known);
    let resolution = &args.resolution();
    ensure!(
        settings.moires == 1,
        "maps are made of one moiré; --moires {} is for analyze",
        settings.moires
    );
    let mut campaign = task.campaign()?.illustrated(false);
    take(sink, &mut campaign);
    let Outcome {
        analysis,
        provenance,
    } = match campaign.analyse(job) {
        Ok(mut outcomes) => outcomes.swap_remove(0),
        Err(error) if error.is_of_scans() => {
            let stripes = stripes::look(args, inputs, (settings, known, resolution));
            if let Ok(Some(found)) = stripes {
                return Ok(Answer::Stripes(Box::new(found)));
            }
            let error = in_words(error);
            stripes?;
            return Err(error);
        }
        Err(error) => return Err(kept_for_next(in_words(error), sink, &campaign)),
    };
    if let Some(why) = refusal(&analysis).filter(|why| is_nothing_left(&why.doubt)) {
        bail!("{}", why.message());
    }
    let made = job.run(|| mapped(args, task, &analysis, provenance, job));
    let made = made.unwrap_or_else(|cancelled| Err(cancelled.into()));
    let made = made.map_err(|error| kept_for_next(error, sink, &campaign))?;
    Ok(Answer::Lattice(Box::new(made)))
}

/// Maps the scans of an analysis, and averages.
fn mapped(
    args: &MapArgs,
    task: &Task,
    analysis: &Analysis,
    mut provenance: Provenance,
    job: &Job,
) -> anyhow::Result<Made> {
    let scans = Scans {
        analysis,
        inputs: &task.inputs,
        known: &task.known,
        advice,
    };
    let found = map_lattices(&scans, args.map_method.into(), &args.resolution(), job);
    let mut found = found.map_err(|why| match why {
        NoMap::Cancelled(cancelled) => cancelled.into(),
        NoMap::Nothing { failed } => {
            let all = [provenance.failed.as_slice(), &failed].concat();
            eprint!("{}", failures(&all));
            anyhow::anyhow!("no image gave a map")
        }
        other => other.into(),
    })?;
    provenance.failed.append(&mut found.failed);
    let domains = args
        .domains
        .answer(&found.map, |contrast| scans.domains(contrast));
    found.caveats.extend(domains.caveats.iter().cloned());
    Ok(Made {
        map: found.map,
        picture: found.picture,
        domains,
        images: found.images,
        whole: found.whole,
        settings: analysis.settings.clone(),
        provenance,
        agreement: found.agreement,
        drift_change: found.drift_change,
        caveats: found.caveats,
    })
}
