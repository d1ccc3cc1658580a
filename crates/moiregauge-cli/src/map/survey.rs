//! Surveys: large images, each mapped in bands, side by side in one map.

use std::path::PathBuf;

use anyhow::{Context as _, ensure};
use moiregauge::campaign::about_repeat;
use moiregauge::caveat::{Caveat, MapDoubt, SurveyDrift};
use moiregauge::map::TwistStrainMap;
use moiregauge::survey::SurveyPlan;
use moiregauge_pipeline::campaign::given_again;
use moiregauge_pipeline::maps::mapped_image;
use moiregauge_pipeline::sink::FolderSink;
use moiregauge_pipeline::{Job, distinct};
use moiregauge_report::Provenance;

use super::args::MapArgs;
use super::large::Large;
use super::made::Made;
use crate::analyze::Task;

/// Maps images that are too large for memory, side by side; `None` where the first is not large.
pub(super) fn survey(
    args: &MapArgs,
    task: &Task,
    sink: &FolderSink,
    job: &Job,
) -> anyhow::Result<Option<Made>> {
    let (settings, known, resolution) = (&task.run.settings, &task.known, &args.resolution());
    let open = |path: &PathBuf, always: bool| {
        Large::open(path, settings, known, always).with_context(|| path.display().to_string())
    };
    // One large image makes a survey of all. It is opened once.
    let mut opened = if args.in_bands {
        None
    } else {
        let large = |path| Some((path, open(path, false).transpose()?));
        let Some((path, large)) = task.inputs.iter().find_map(large) else {
            return Ok(None);
        };
        Some((path, large?))
    };
    ensure!(
        args.analyze.sets()?.is_empty(),
        "--set: images that are mapped in bands lie side by side in one map and make no sets"
    );
    let (inputs, again) = distinct(&task.inputs);
    let (mut maps, mut images, mut caveats) = (Vec::new(), Vec::new(), given_again(&again));
    let (mut read, mut plans) = (Vec::new(), Vec::<(Large, SurveyPlan)>::new());
    for path in &inputs {
        let large = match opened.take_if(|(large, _)| *large == path) {
            Some((_, large)) => large,
            None => open(path, true)?.context("no image")?,
        };
        let same = |(known, _): &&(Large, _)| known.input.sha256 == large.input.sha256;
        if let Some((known, _)) = plans.iter().find(same) {
            caveats.push(about_repeat(&large.input.file, &known.input.file));
            continue;
        }
        let (map, plan) = large
            .map(
                (settings, resolution),
                plans.first().map(|p| &p.1),
                sink,
                job,
            )
            .with_context(|| path.display().to_string())?;
        let file = large.input.file.clone();
        caveats.extend(large.caveats.iter().cloned());
        caveats.extend(plan.caveats.iter().cloned());
        caveats.push(in_bands(
            &file,
            plan.drift_corrected,
            settings.drift.is_some(),
        ));
        images.push(mapped_image(
            &file,
            None,
            plan.drift_corrected,
            &plan.harmonics,
        ));
        maps.push(map);
        read.push(large.input.clone());
        plans.push((large, plan));
    }
    let map = TwistStrainMap::side_by_side(maps).context("no image")?;
    let look = |contrast| {
        let found = plans
            .iter()
            .filter_map(|(large, plan)| large.domains(plan, contrast));
        found.collect()
    };
    let domains = args.domains.answer(&map, look);
    caveats.extend(domains.caveats.iter().cloned());
    Ok(Some(Made {
        caveats,
        provenance: Provenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            seed: settings.seed,
            inputs: read,
            failed: task.run.left_out.clone(),
            run: None,
        },
        settings: settings.clone(),
        picture: plans.first().and_then(|(large, _)| large.picture(settings)),
        images,
        map,
        whole: None,
        agreement: None,
        drift_change: None,
        domains,
    }))
}

/// Says how an image was mapped.
fn in_bands(file: &str, corrected: bool, given: bool) -> Caveat {
    let drift = if corrected {
        SurveyDrift::Corrected
    } else if given {
        SurveyDrift::NoTiming
    } else {
        SurveyDrift::Unknown
    };
    Caveat::new(MapDoubt::Survey { drift }, file)
}
