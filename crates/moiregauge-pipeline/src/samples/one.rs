//! One sample → its part.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;

use moiregauge::numbers::interrupt::Interrupted;
use moiregauge_report::{ColorMap, FailedInput, SampleRow, thumbnail};

use super::find::SampleFiles;
use super::list::Asked;
use crate::campaign::{Advice, AnalyseError, Campaign, Outcome};
use crate::job::{Cancelled, Job};
use crate::names::in_full;
use crate::source::Places;

/// Pixels along the longer side of a picture.
const SIDE: usize = 96;

/// What a sample is analysed with.
pub(super) struct With<'a> {
    pub(super) asked: &'a Asked,
    pub(super) advice: Advice,
    pub(super) colours: ColorMap,
}

/// What came out: the rows and a picture of the first scan.
pub(super) struct Analysed {
    pub(super) rows: Vec<SampleRow>,
    pub(super) picture: Option<Vec<u8>>,
}

/// Analyses a sample. Whatever is wrong with it is a row; a fault of the program, too.
pub(super) fn analysed(
    sample: &str,
    files: &SampleFiles,
    with: &With,
    job: &Job,
) -> Result<Analysed, Cancelled> {
    let failed = |failed| Analysed {
        rows: vec![SampleRow::without_numbers(sample, failed)],
        picture: None,
    };
    let one = |error: String| FailedInput {
        file: sample.to_owned(),
        error,
    };
    if files.files.is_empty() {
        return Ok(failed(files.failed.clone()));
    }
    let done = catch_unwind(AssertUnwindSafe(|| outcomes(files, with, job)));
    let outcomes = match done {
        Ok(Ok(outcomes)) => outcomes,
        Ok(Err(AnalyseError::Cancelled(cancelled))) => return Err(cancelled),
        Ok(Err(AnalyseError::Nothing { failed: all })) => return Ok(failed(all)),
        Ok(Err(AnalyseError::NoCommonRegion { failed: mut all })) => {
            all.push(one("the scans have no region in common".to_owned()));
            return Ok(failed(all));
        }
        Ok(Err(error)) => return Ok(failed(vec![one(in_full(&error))])),
        Err(cause) if cause.is::<Interrupted>() => resume_unwind(cause),
        Err(_) => {
            let words = "a fault of the program: please report it with these files";
            return Ok(failed(vec![one(words.to_owned())]));
        }
    };
    let numbered = outcomes.iter().zip(1..);
    let rows = numbered.map(|(outcome, moire)| {
        SampleRow::of(sample, moire, &outcome.analysis, &outcome.provenance)
    });
    let mut shown = outcomes.iter().flat_map(|o| &o.analysis.sets);
    let image = shown.find_map(|set| set.illustration.as_ref());
    Ok(Analysed {
        picture: image.and_then(|i| thumbnail(&i.image, SIDE, with.colours).ok()),
        rows: rows.collect(),
    })
}

fn outcomes(files: &SampleFiles, with: &With, job: &Job) -> Result<Vec<Outcome>, AnalyseError> {
    let mut campaign = Campaign::new(with.asked.settings.clone())?
        .with_user_specified(with.asked.known.clone())?
        .with_advice(with.advice)
        .illustrated(true);
    let mut places = Places::new();
    for (name, place) in &files.files {
        let name = PathBuf::from(name);
        places.insert(name.clone(), place.clone());
        campaign.add([name]);
    }
    campaign
        .with_places(places)
        .with_left_out(files.failed.clone())
        .analyse(job)
}
