//! Scans that show a lattice → their analysis, their maps, the average of these.

use anyhow::{bail, ensure};
use moiregauge::campaign::{Analysis, ScanAnalysis};
use moiregauge::campaign::{is_nothing_left, picture, refusal};
use moiregauge::map::TwistStrainMap;
use moiregauge::scan::Picture;
use moiregauge::settings::Settings;
use moiregauge::survey::{LineMap, average_maps, change_of_drift, domains_of_scan, map_scan};
use moiregauge_pipeline::campaign::Outcome;
use moiregauge_pipeline::{Job, read_again};
use moiregauge_report::screen::failures;
use moiregauge_report::{FailedInput, Provenance};

use super::args::MapArgs;
use super::doubts;
use super::made::{Made, image, whole_image};
use super::stripes::{self, Striped};
use crate::analyze::{Task, in_words, with_advice};

/// What scans show.
pub(super) enum Answer {
    Lattice(Box<Made>),
    Stripes(Box<Striped>),
}

/// Analyses all scans, maps them, and averages; stripes, where none of them shows a lattice.
pub(super) fn together(args: &MapArgs, task: &Task, job: &Job) -> anyhow::Result<Answer> {
    let (inputs, settings, known) = (&task.inputs, &task.run.settings, &task.known);
    let resolution = &args.resolution();
    ensure!(
        settings.moires == 1,
        "maps are made of one moiré; --moires {} is for analyze",
        settings.moires
    );
    let mut campaign = task.campaign()?.illustrated(false);
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
        Err(error) => return Err(in_words(error)),
    };
    if let Some(why) = refusal(&analysis).filter(|why| is_nothing_left(&why.doubt)) {
        bail!("{}", why.message());
    }
    mapped(args, task, &analysis, provenance).map(|made| Answer::Lattice(Box::new(made)))
}

/// Maps the scans of an analysis, and averages.
fn mapped(
    args: &MapArgs,
    task: &Task,
    analysis: &Analysis,
    mut provenance: Provenance,
) -> anyhow::Result<Made> {
    // The maps read the lattice under the name that the analysis found.
    let settings = &analysis.named_settings();
    let (mut maps, shown, failed) = maps_of(args, task, analysis, settings);
    provenance.failed.extend(failed);
    let mut caveats = analysis.caveats.clone();
    doubts::registered(&mut maps, &mut caveats);
    let Some((lattices, agreement)) = average_maps(&maps) else {
        eprint!("{}", failures(&provenance.failed));
        bail!("no image gave a map");
    };
    let reference = maps[0].whole;
    let (layers, convention) = (settings.bilayer(), settings.strain_convention);
    let found = lattices
        .twist_strain(&reference, layers, convention)
        .unwrap_or_else(|why| {
            caveats.push(doubts::no_twist_strain(&why));
            vec![None; lattices.nodes.len()]
        });
    doubts::of_maps(&maps, &mut caveats);
    if args.margin.is_none() {
        let narrow = maps
            .iter()
            .find_map(|m| doubts::narrow_margin(m.margin, &m.file));
        caveats.extend(narrow);
    }
    let drift_change = change_of_drift(&maps);
    doubts::about_change(drift_change, &mut caveats);
    let map = TwistStrainMap::new(&lattices, &found);
    let origin = origin(analysis);
    let look = |contrast| {
        let all = used(analysis).flat_map(|scan| {
            let read = read_again(&task.inputs, &scan.file, settings, &task.known).ok();
            read.map_or_else(Vec::new, |read| {
                domains_of_scan(&read, scan, origin, settings, contrast)
            })
        });
        all.collect()
    };
    let domains = args.domains.answer(&map, look);
    caveats.extend(domains.caveats.iter().cloned());
    Ok(Made {
        map,
        picture: shown,
        domains,
        images: maps
            .iter()
            .map(|m| image(&m.file, Some(m.line), m.drift_corrected, &m.harmonics))
            .collect(),
        whole: whole_image(analysis),
        settings: analysis.settings.clone(),
        provenance,
        agreement,
        drift_change,
        caveats,
    })
}

/// The scans that are not excluded.
fn used(analysis: &Analysis) -> impl Iterator<Item = &ScanAnalysis> {
    let all = analysis.sets.iter().flat_map(|set| &set.scans);
    all.filter(|scan| scan.excluded.is_none())
}

/// The time that drift is counted from.
fn origin(analysis: &Analysis) -> Option<f64> {
    used(analysis)
        .filter_map(|s| s.motion.map(|m| m.middle))
        .min_by(f64::total_cmp)
}

/// The maps of all scans, trace and retrace, with the first image, to be shown, and the files that gave none.
fn maps_of(
    args: &MapArgs,
    task: &Task,
    analysis: &Analysis,
    settings: &Settings,
) -> (Vec<LineMap>, Option<Picture>, Vec<FailedInput>) {
    let (mut maps, mut shown, mut failed) = (Vec::new(), None, Vec::new());
    let how = (args.map_method.into(), &args.resolution());
    let origin = origin(analysis);
    for scan in used(analysis) {
        let mut of_scan = || -> anyhow::Result<Vec<LineMap>> {
            let read =
                read_again(&task.inputs, &scan.file, settings, &task.known).map_err(with_advice)?;
            let (method, resolution) = how;
            let lines = map_scan(&read, scan, origin, settings, method, resolution)?;
            shown = shown
                .take()
                .or_else(|| picture(&scan.file, &read, settings));
            Ok(lines)
        };
        match of_scan() {
            Ok(lines) => maps.extend(lines),
            Err(error) => failed.push(FailedInput {
                file: scan.file.clone(),
                error: format!("{error:#}"),
            }),
        }
    }
    (maps, shown, failed)
}
