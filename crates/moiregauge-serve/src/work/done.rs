//! What came out, and the files that the program would write of it.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use moiregauge_pipeline::campaign::{
    Advice, AnalyseError, Campaign, Heard, Kept, Outcome, outcomes,
};
use moiregauge_pipeline::sink::{MemorySink, Sink as _};
use moiregauge_pipeline::{Cancel, Found, Job, Known, Quiet, record_files};
use moiregauge_report::results::{Results, Run};
use moiregauge_report::{FailedInput, write_report};

use super::asked::{Asked, SETTINGS_FILE, quoted};
use super::task::{NoResult, run_beside};
use crate::lock::lock;
use crate::problem::{Answer, Problem};
use crate::roots::places;

/// What was asked and what came out.
#[derive(Debug)]
pub(crate) struct Done {
    pub(crate) asked: Asked,
    /// The moirés, the largest cell first; of a result that was read from the disk they are made when they are wanted.
    outcomes: Mutex<Option<Arc<Vec<Outcome>>>>,
    /// The `results.json` of each of them.
    pub(crate) documents: Vec<Vec<u8>>,
    /// Made when they are wanted.
    written: Mutex<Option<Arc<Written>>>,
}

/// Files by their names.
pub(crate) type Written = BTreeMap<String, Vec<u8>>;

/// Why nothing came out.
#[derive(Debug)]
pub(crate) enum NotDone {
    Analyse(AnalyseError),
    Other(Problem),
}

impl NotDone {
    /// In words, and file by file.
    pub(crate) fn in_words(&self) -> (String, Vec<FailedInput>) {
        match self {
            Self::Other(problem) => (problem.words().to_owned(), Vec::new()),
            Self::Analyse(error) => {
                let words = moiregauge_pipeline::names::in_full(error);
                let failed = match error {
                    AnalyseError::Nothing { failed } | AnalyseError::NoCommonRegion { failed } => {
                        failed.clone()
                    }
                    _ => Vec::new(),
                };
                (words, failed)
            }
        }
    }
}

impl Done {
    /// What an earlier server left.
    pub(crate) fn read(asked: Asked, documents: Vec<Vec<u8>>) -> Self {
        Self {
            asked,
            outcomes: Mutex::default(),
            documents,
            written: Mutex::default(),
        }
    }

    /// Analyses what is asked; `kept` takes what was measured, however it ends, and `heard` each file at once.
    pub(crate) fn of(
        asked: &Asked,
        advice: Advice,
        kept: &mut Kept,
        heard: Option<Heard>,
        job: &Job,
    ) -> Result<Self, NotDone> {
        let outcomes = analysed(asked, advice, kept, heard, false, job)?;
        let documents = outcomes.iter().map(|outcome| {
            let results = Results::new(&outcome.analysis, &outcome.provenance);
            let document = results.to_json();
            document.map_err(|e| NotDone::Other(Problem::fault(e)))
        });
        Ok(Self {
            asked: asked.clone(),
            documents: documents.collect::<Result<_, _>>()?,
            outcomes: Mutex::new(Some(Arc::new(outcomes))),
            written: Mutex::default(),
        })
    }

    /// The moirés behind the documents; those of a result that an earlier server left are analysed again of what was measured.
    pub(crate) fn outcomes(&self, advice: Advice, kept: &Kept) -> Answer<Arc<Vec<Outcome>>> {
        // Whoever asks meanwhile waits for the same.
        let mut outcomes = lock(&self.outcomes);
        if let Some(found) = &*outcomes {
            return Ok(Arc::clone(found));
        }
        let mut kept = kept.clone();
        let again = run_beside(&Cancel::new(), &Quiet, |job| {
            Self::of(&self.asked, advice, &mut kept, None, job)
                .map_err(|e| Problem::conflict(e.in_words().0))
        });
        let again = again.map_err(no_result)?;
        if again.documents != self.documents {
            let words = "the files are not as they were when this result was saved: analyse again";
            return Err(Problem::conflict(words));
        }
        let found = lock(&again.outcomes).take().unwrap_or_default();
        *outcomes = Some(Arc::clone(&found));
        Ok(found)
    }

    /// Everything that the program would write, with the settings and the command.
    pub(crate) fn written(&self, advice: Advice, kept: &Kept) -> Answer<Arc<Written>> {
        // Whoever asks meanwhile waits for the same.
        let mut written = lock(&self.written);
        if let Some(files) = &*written {
            return Ok(Arc::clone(files));
        }
        let mut kept = kept.clone();
        let made = run_beside(&Cancel::new(), &Quiet, |job| {
            let outcomes = analysed(&self.asked, advice, &mut kept, None, true, job);
            let outcomes = outcomes.map_err(|e| Problem::wrong(e.in_words().0))?;
            files(&self.asked, &outcomes)
        });
        let made = Arc::new(made.map_err(no_result)?);
        *written = Some(Arc::clone(&made));
        Ok(made)
    }
}

fn no_result(error: NoResult<Problem>) -> Problem {
    match error {
        NoResult::Refused(problem) => problem,
        NoResult::Fault(words) => Problem::fault(words),
        NoResult::Cancelled => Problem::conflict("stopped before the end"),
    }
}

fn analysed(
    asked: &Asked,
    advice: Advice,
    kept: &mut Kept,
    heard: Option<Heard>,
    illustrated: bool,
    job: &Job,
) -> Result<Vec<Outcome>, NotDone> {
    let named = Found {
        files: asked.inputs().into_iter().map(Ok).collect(),
        ..Found::default()
    };
    let (inputs, left_out) = named.frames();
    let run = Run {
        left_out,
        ..asked.run().map_err(NotDone::Other)?
    };
    let places = places(&asked.files);
    let campaign = Campaign::of_run(&run, &inputs, &places, advice);
    let mut campaign = campaign
        .map_err(|e| NotDone::Other(Problem::wrong(e)))?
        .illustrated(illustrated)
        .heard_by(heard)
        .trusting_dates();
    campaign.take(std::mem::take(kept));
    let found = outcomes(&run, &places, &mut campaign, job, |measured| {
        let mut recorded = run.clone();
        let known = Known::new(&run.known, &inputs).at(&places);
        record_files(&mut recorded, &known, &inputs, measured);
        recorded
    });
    *kept = campaign.kept().clone();
    found.map_err(NotDone::Analyse)
}

/// The files of a folder of results, and beside them what asks for the same.
fn files(asked: &Asked, outcomes: &[Outcome]) -> Answer<Written> {
    let sink = MemorySink::new();
    let run = asked.run()?;
    for (number, outcome) in (1..).zip(outcomes) {
        let within = match outcomes.len() {
            1 => String::new(),
            _ => format!("moire-{number}/"),
        };
        let report = write_report(&outcome.analysis, &outcome.provenance, &run.report);
        for (name, bytes) in report.map_err(Problem::fault)? {
            let written = sink.write(&format!("{within}{name}"), &bytes);
            written.map_err(Problem::fault)?;
        }
    }
    let mut all = sink.commit("analyze").map_err(Problem::fault)?;
    if let Some(settings) = asked.settings_file()? {
        all.insert(SETTINGS_FILE.to_owned(), settings.into_bytes());
    }
    all.insert("command.txt".to_owned(), command(asked)?.into_bytes());
    Ok(all)
}

/// The command that asks the same.
pub(crate) fn command(asked: &Asked) -> Answer<String> {
    let mut all = vec!["moiregauge".to_owned()];
    all.extend(asked.arguments()?);
    all.extend(["--out".to_owned(), "results".to_owned()]);
    Ok(format!("{}\n", quoted(&all)))
}
