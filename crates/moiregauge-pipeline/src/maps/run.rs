//! Scans → a map: of large images in bands, of a lattice, or of stripes.

use moiregauge::campaign::{Analysis, is_nothing_left, refusal};
use moiregauge_report::Provenance;

use super::domains::Domains;
use super::doubts;
use super::error::NotMapped;
use super::found::{LatticeShown, MapFound, Shown};
use super::lattices::{NoMap, map_lattices};
use super::request::MapRequest;
use super::stripes;
use super::survey::survey;
use crate::campaign::{AnalyseError, Campaign, Outcome, Scans};
use crate::job::Job;
use crate::sink::Keep;

/// Maps the scans of a campaign: twist, strain, wavelength and orientation from place to place, with the error of
/// every node. Images too large for memory are mapped in bands, which `keep` keeps until the map is written; images
/// that show stripes and no lattice give a map of these.
///
/// # Errors
/// [`NotMapped`]; after [`NotMapped::Cancelled`] what was measured is kept in the campaign, and finished bands by `keep`.
///
/// ```no_run
/// use moiregauge_pipeline::campaign::Campaign;
/// use moiregauge_pipeline::maps::MapRequest;
/// use moiregauge_pipeline::sink::{Forget, MemorySink};
/// use moiregauge_pipeline::{Job, map};
///
/// let mut campaign = Campaign::new(moiregauge::Settings::default())?;
/// campaign.add(["scan.000.spm".into()]);
/// let request = MapRequest::default();
/// let found = map(&mut campaign, &request, &Forget, &Job::quiet(None)?)?;
/// let sink = MemorySink::new();
/// let results = found.write(&request, moiregauge_report::Choice::default(), &sink)?;
/// println!("{} nodes of {:?}", found.map().grid.len(), results.quantities);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn map(
    campaign: &mut Campaign,
    request: &MapRequest,
    keep: &dyn Keep,
    job: &Job,
) -> Result<MapFound, NotMapped> {
    request.check()?;
    if let Some(found) = job.run(|| survey(campaign, request, keep, job))?? {
        return Ok(found);
    }
    let moires = campaign.settings().moires;
    if moires != 1 {
        return Err(NotMapped::SeveralMoires(moires));
    }
    let outcome = match campaign.analyse(job) {
        Ok(mut outcomes) => outcomes.swap_remove(0),
        Err(why) if why.is_of_scans() => {
            let stripes = match job.run(|| stripes::look(campaign, request))? {
                Ok(Some(found)) => return Ok(found),
                Ok(None) => None,
                Err(stripes) => Some(Box::new(stripes)),
            };
            let why = Box::new(why);
            return Err(NotMapped::NoLattice { why, stripes });
        }
        Err(AnalyseError::Cancelled(cancelled)) => return Err(cancelled.into()),
        Err(why) => return Err(NotMapped::Analyse(Box::new(why))),
    };
    let Outcome {
        analysis,
        provenance,
    } = outcome;
    if let Some(why) = refusal(&analysis).filter(|why| is_nothing_left(&why.doubt)) {
        return Err(NotMapped::NothingLeft(why.message()));
    }
    job.run(|| mapped(campaign, request, &analysis, provenance, job))?
}

/// Maps the scans of an analysis, and averages.
fn mapped(
    campaign: &Campaign,
    request: &MapRequest,
    analysis: &Analysis,
    mut provenance: Provenance,
    job: &Job,
) -> Result<MapFound, NotMapped> {
    let known = campaign.known();
    let scans = Scans {
        analysis,
        inputs: campaign.inputs(),
        known: &known,
        advice: campaign.advice(),
    };
    let found = map_lattices(&scans, request.method, &request.resolution(), job);
    let mut found = found.map_err(|why| match why {
        NoMap::Cancelled(cancelled) => cancelled.into(),
        NoMap::Nothing { failed } => NotMapped::Nothing {
            failed: [provenance.failed.as_slice(), &failed].concat(),
        },
    })?;
    provenance.failed.append(&mut found.failed);
    let domains = if found.caveats.iter().any(doubts::is_no_twist_strain) {
        Domains::none(&found.map)
    } else {
        request
            .domains
            .answer(&found.map, |contrast| scans.domains(contrast))
    };
    found.caveats.extend(domains.caveats.iter().cloned());
    Ok(MapFound {
        shown: Shown::Lattice(Box::new(LatticeShown {
            map: found.map,
            whole: found.whole,
            picture: found.picture,
            pattern: found.pattern,
            registry: found.registry,
            agreement: found.agreement,
            drift_change: found.drift_change,
            domains,
        })),
        settings: analysis.settings.clone(),
        provenance,
        images: found.images,
        caveats: found.caveats,
        refused: refusal(analysis).cloned(),
    })
}
