//! A run → the analysis of every moiré, with its record.

use moiregauge::campaign::{is_nothing_left, refusal};
use moiregauge_report::results::Run;

use super::atomic::orientation;
use super::error::AnalyseError;
use super::growing::{Campaign, Outcome};
use super::survey::survey_image;
use crate::job::Job;
use crate::known::Known;
use crate::source::Places;

/// Reads what is beside the scans of a run, then these, and analyses them. `record` makes the record of the run from
/// the files that were measured.
///
/// # Errors
/// Nothing could be analysed, all of it is excluded, or what is beside the scans cannot be used.
pub fn outcomes(
    run: &Run,
    places: &Places,
    campaign: &mut Campaign,
    job: &Job,
    record: impl FnOnce(&[moiregauge_report::InputFile]) -> Run,
) -> Result<Vec<Outcome>, AnalyseError> {
    let survey = match &run.survey_image {
        Some(name) => Some(survey_image(name, &run.settings, places)?),
        None => None,
    };
    let known = Known::new(&run.known, &[]);
    let atomic = match &run.atomic {
        Some(images) => Some(orientation(images, &run.settings, &known, places, job)?),
        None => None,
    };
    if let Some((found, _)) = &atomic {
        campaign.know_orientation(found.known())?;
    }
    let mut outcomes = campaign.analyse(job)?;
    let refused = outcomes.iter().find_map(|o| refusal(&o.analysis));
    if let Some(why) = refused.filter(|why| is_nothing_left(&why.doubt)) {
        return Err(AnalyseError::NothingLeft(why.message()));
    }
    // The files are the same for all moirés.
    let mut record = Some(record);
    let mut recorded = None;
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
        if let Some(record) = record.take() {
            recorded = Some(record(&provenance.inputs));
        }
        provenance.run.clone_from(&recorded);
    }
    Ok(outcomes)
}
