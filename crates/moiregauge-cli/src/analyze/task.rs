//! What is to be done: what the arguments ask for, or what the document of an earlier run records.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use moiregauge_pipeline::campaign::Campaign;
use moiregauge_pipeline::{Known, Places, check_sets, record_files};
use moiregauge_report::InputFile;
use moiregauge_report::results::Run;

use super::again::Again;
use super::args::AnalyzeArgs;
use super::arguments::arguments;
use crate::config::with_option;
use crate::errors::advice;
use crate::paths::inputs;
use crate::typed::typed;

/// A run to be done.
pub(crate) struct Task {
    /// What is asked.
    pub(crate) run: Run,
    /// The files to measure, by their names.
    pub(crate) inputs: Vec<PathBuf>,
    /// What is known of them, and where they lie.
    pub(crate) known: Known,
    places: Places,
    /// The run to be repeated.
    again: Option<Again>,
}

impl Task {
    /// The task of a command.
    ///
    /// # Errors
    /// Arguments that make no sense; a document that does not record its run, or whose files have changed.
    pub(crate) fn new(args: &AnalyzeArgs, command: &str) -> anyhow::Result<Self> {
        if let Some(path) = &args.replay {
            let (again, places) = Again::read(path, &args.data, command)?;
            let run = again.run().clone();
            let inputs = run.inputs.iter().map(PathBuf::from).collect();
            return Ok(Self::of(run, inputs, places, Some(again)));
        }
        let settings = args.settings()?;
        let (inputs, failed) = inputs(&args.paths, args.is_loud());
        let sets = args.sets()?;
        if !inputs.is_empty() {
            check_sets(&sets, &inputs).context("--set")?;
        }
        let run = Run {
            command: command.to_owned(),
            arguments: arguments(typed(), &[]),
            settings,
            known: args.known.user_specified(),
            sets,
            atomic: args.orientation.asked()?,
            report: args.choice(),
            survey_image: args.survey_image().map(|path| path.display().to_string()),
            export: args.export.clone(),
            parquet: args.parquet,
            inputs: Vec::new(),
            other_files: Vec::new(),
            left_out: failed,
        };
        Ok(Self::of(run, inputs, Places::new(), None))
    }

    /// The task of what is asked of these files, and of where they lie.
    fn of(run: Run, inputs: Vec<PathBuf>, places: Places, again: Option<Again>) -> Self {
        Self {
            known: Known::new(&run.known, &inputs).at(&places),
            inputs,
            places,
            run,
            again,
        }
    }

    /// Where files lie that are no longer where their names say.
    pub(crate) fn places(&self) -> &Places {
        &self.places
    }

    /// Its scans, to be analysed.
    pub(crate) fn campaign(&self) -> anyhow::Result<Campaign> {
        Campaign::of_run(&self.run, &self.inputs, &self.places, advice).map_err(with_option)
    }

    /// The record of the run for its results, `measured` being the files whose hashes these have anyway.
    pub(crate) fn record(&self, measured: &[InputFile]) -> Run {
        let mut run = self.run.clone();
        if self.again.is_none() {
            record_files(&mut run, &self.known, &self.inputs, measured);
        }
        run
    }

    /// All files that are read: they are never written over.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        let places = self.inputs.iter().map(|path| self.known.place(path));
        places.map(Path::to_owned).collect()
    }

    /// Whether a repetition came to the same document, one of these; says so if not. A new run always did.
    pub(crate) fn is_same(&self, documents: &[Vec<u8>]) -> bool {
        let again = self.again.as_ref();
        again.is_none_or(|again| again.is_same(documents))
    }
}
