//! What is to be done: what the arguments ask for, or what the document of an earlier run records.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use moiregauge_pipeline::{Document, Places, check_sets, record_files};
use moiregauge_report::results::{Run, Told};
use moiregauge_report::{FailedInput, InputFile};

use super::AnalyzeArgs;
use crate::config;
use crate::info::inputs;
use crate::input::Known;

/// A run to be done.
pub(crate) struct Task {
    /// What is asked.
    pub(crate) run: Run,
    /// The files to measure, by their names.
    pub(crate) inputs: Vec<PathBuf>,
    /// Names that mean no file to measure.
    pub(crate) failed: Vec<FailedInput>,
    places: Places,
    /// The document to be repeated.
    document: Option<(PathBuf, Document)>,
}

impl Task {
    /// The task of a command.
    ///
    /// # Errors
    /// Arguments that make no sense; a document that does not record its run, or whose files have changed.
    pub(crate) fn new(args: &AnalyzeArgs, command: &str) -> anyhow::Result<Self> {
        if let Some(path) = &args.replay {
            return Self::again(args, path, command);
        }
        let settings = args.settings()?;
        let (inputs, failed) = inputs(&args.paths, args.is_loud());
        let sets = args.sets()?;
        if !inputs.is_empty() {
            check_sets(&sets, &inputs).context("--set")?;
        }
        let run = Run {
            command: command.to_owned(),
            arguments: arguments(std::env::args_os(), &[]),
            settings,
            known: args.known.told(),
            sets,
            atomic: args.orientation.asked()?,
            report: args.choice(),
            survey_image: args.survey_image().map(|path| path.display().to_string()),
            export: args.export.clone(),
            parquet: args.parquet,
            inputs: Vec::new(),
            other_files: Vec::new(),
            left_out: failed.clone(),
        };
        Ok(Self {
            run,
            inputs,
            failed,
            places: Places::new(),
            document: None,
        })
    }

    /// The task of the document, after checking its files.
    fn again(args: &AnalyzeArgs, path: &Path, command: &str) -> anyhow::Result<Self> {
        let others = arguments(std::env::args_os(), &["--replay", "--data"]);
        ensure!(
            others.len() == 1,
            "--replay takes files, settings and options from the document; found also {}",
            others[1..].join(" ")
        );
        let document = Document::read(path).context("--replay")?;
        ensure!(
            document.run.command == command,
            "--replay: {} records a run of {1}; repeat it with `moiregauge {1} --replay`",
            path.display(),
            document.run.command
        );
        let places = document.find(&args.data).context("--replay")?;
        config::check(&document.run.settings).context("--replay")?;
        if document.is_of_another_version() {
            eprintln!(
                "note: version {} wrote {}, and this is {}: numbers may differ; CHANGELOG.md says which",
                document.version,
                path.display(),
                env!("CARGO_PKG_VERSION")
            );
        }
        let run = document.run.clone();
        Ok(Self {
            inputs: run.inputs.iter().map(PathBuf::from).collect(),
            failed: run.left_out.clone(),
            places,
            run,
            document: Some((path.to_owned(), document)),
        })
    }

    /// What is known of these files, and where they lie.
    pub(crate) fn known(&self, files: &[PathBuf]) -> Known {
        Known::new(&self.run.known, files).at(&self.places)
    }

    /// A file of which nothing is known but where it lies.
    pub(crate) fn nothing_known(&self, path: &Path) -> Known {
        Known::new(&Told::default(), &[path.to_owned()]).at(&self.places)
    }

    /// The record of the run for its results, `measured` being the files whose hashes these have anyway.
    pub(crate) fn record(&self, known: &Known, measured: &[InputFile]) -> Run {
        let mut run = self.run.clone();
        if self.document.is_none() {
            record_files(&mut run, known, &self.inputs, measured);
        }
        run
    }

    /// All files that are read: they are never written over.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        let inputs = self.inputs.iter();
        let places = inputs.map(|path| self.places.get(path).unwrap_or(path).clone());
        places.collect()
    }

    /// Whether a repetition came to the same document, one of these; says so if not. A new run always did.
    pub(crate) fn is_same(&self, documents: &[Vec<u8>]) -> bool {
        let Some((path, document)) = &self.document else {
            return true;
        };
        if documents.contains(&document.bytes) {
            return true;
        }
        eprintln!(
            "note: the results are not those of {}, byte for byte: another version or another kind of processor may \
             change last digits",
            path.display()
        );
        document.is_of_another_version()
    }
}

/// The folder for the results of a repetition where none is given: beside that of the document.
pub(crate) fn out_beside(document: &Path) -> PathBuf {
    let whole = std::path::absolute(document).unwrap_or_else(|_| document.to_owned());
    let folder = whole.parent().unwrap_or(Path::new(""));
    let mut name = folder.file_name().unwrap_or_default().to_owned();
    name.push("-replayed");
    folder.with_file_name(name)
}

/// The arguments that can change results, the command first: without the program, where results go, the number of threads
/// and what is printed; without the options `left_out`, too, each of which has one value.
fn arguments(all: impl IntoIterator<Item = OsString>, left_out: &[&str]) -> Vec<String> {
    let valued = |text: &str| ["--out", "--threads"].contains(&text) || left_out.contains(&text);
    let mut all = all
        .into_iter()
        .skip(1)
        .map(|a| a.to_string_lossy().into_owned())
        .peekable();
    let mut kept: Vec<String> = all.next().into_iter().collect();
    // Names of files after what is left out move here, lest they follow an option of many values instead.
    let mut place = kept.len();
    while let Some(text) = all.next() {
        if text == "--" {
            kept.push(text);
            kept.extend(all);
            break;
        }
        let flag = ["--force", "--quiet", "-q", "--json"].contains(&text.as_str());
        let joined = text.split_once('=').is_some_and(|(name, _)| valued(name));
        let apart = valued(&text);
        if !(flag || joined || apart) {
            kept.push(text);
            continue;
        }
        if apart {
            all.next();
        }
        while let Some(file) = all.next_if(|next| !next.starts_with('-')) {
            kept.insert(place, file);
            place += 1;
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(all: &str) -> String {
        let all = all.split(' ').map(OsString::from);
        arguments(all, &["--replay"]).join(" ")
    }

    #[test]
    fn what_cannot_change_results_is_left_out() {
        assert_eq!(
            kept("moiregauge analyze s --out r --seed 2 --force -q"),
            "analyze s --seed 2"
        );
        assert_eq!(
            kept("x map --out=r --threads 7 --json a b --set n=p"),
            "map a b --set n=p"
        );
        // The scans are no atomic images.
        assert_eq!(
            kept("x analyze --atomic a b --out r s t --drift -1 2"),
            "analyze s t --atomic a b --drift -1 2"
        );
        assert_eq!(kept("x analyze --replay r.json --out r"), "analyze");
        assert_eq!(kept("x analyze -- --out s"), "analyze -- --out s");
    }
}
