//! Surveys: large images, each mapped in bands, side by side in one map.

use std::path::Path;

use moiregauge::campaign::about_repeat;
use moiregauge::caveat::{Caveat, MapDoubt, SurveyDrift};
use moiregauge::map::TwistStrainMap;
use moiregauge::survey::SurveyPlan;
use moiregauge_report::Provenance;

use super::error::{NoBands, NotMapped};
use super::found::{LatticeShown, MapFound, Shown};
use super::large::Large;
use super::lattices::mapped_image;
use super::request::MapRequest;
use crate::campaign::{Campaign, given_again};
use crate::job::Job;
use crate::sink::Keep;
use crate::twice::distinct;

/// Maps images that are too large for memory, side by side; `None` where none is large.
pub(super) fn survey(
    campaign: &Campaign,
    request: &MapRequest,
    keep: &dyn Keep,
    job: &Job,
) -> Result<Option<MapFound>, NotMapped> {
    let (settings, known, resolution) =
        (campaign.settings(), &campaign.known(), request.resolution());
    let of = |path: &Path| {
        let file = path.to_owned();
        |source: NoBands| NotMapped::Band {
            file,
            source: Box::new(source),
        }
    };
    // One large image makes a survey of all. It is opened once.
    let mut opened = None;
    if !request.in_bands {
        for path in campaign.inputs() {
            let large = Large::open(path, settings, known, false).map_err(of(path))?;
            opened = large.map(|large| (path.clone(), large));
            if opened.is_some() {
                break;
            }
        }
        if opened.is_none() {
            return Ok(None);
        }
    }
    if !campaign.sets().is_empty() {
        return Err(NotMapped::SetsInBands);
    }
    let (inputs, again) = distinct(campaign.inputs());
    let (mut maps, mut images, mut caveats) = (Vec::new(), Vec::new(), given_again(&again));
    let (mut read, mut plans) = (Vec::new(), Vec::<(Large, SurveyPlan)>::new());
    for path in &inputs {
        let large = match opened.take_if(|(large, _)| large == path) {
            Some((_, large)) => large,
            None => Large::open(path, settings, known, true)
                .and_then(|large| large.ok_or(NoBands::Nothing("no image")))
                .map_err(of(path))?,
        };
        let same = |(known, _): &&(Large, _)| known.input.sha256 == large.input.sha256;
        if let Some((known, _)) = plans.iter().find(same) {
            caveats.push(about_repeat(&large.input.file, &known.input.file));
            continue;
        }
        let first = plans.first().map(|p| &p.1);
        let (map, plan) = large
            .map((settings, &resolution), first, keep, job)
            .map_err(of(path))?;
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
    let none = || NotMapped::Nothing {
        failed: campaign.left_out().to_vec(),
    };
    let map = TwistStrainMap::side_by_side(maps).ok_or_else(none)?;
    let look = |contrast| {
        let found = plans
            .iter()
            .filter_map(|(large, plan)| large.domains(plan, contrast));
        found.collect()
    };
    let domains = request.domains.answer(&map, look);
    caveats.extend(domains.caveats.iter().cloned());
    Ok(Some(MapFound {
        refused: None,
        shown: Shown::Lattice(Box::new(LatticeShown {
            map,
            whole: None,
            picture: plans.first().and_then(|(large, _)| large.picture(settings)),
            // Bands follow no phases.
            pattern: None,
            registry: None,
            agreement: None,
            drift_change: None,
            domains,
        })),
        settings: settings.clone(),
        provenance: Provenance {
            version: crate::VERSION.to_owned(),
            seed: settings.seed,
            inputs: read,
            failed: campaign.left_out().to_vec(),
            run: None,
        },
        images,
        caveats,
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
