//! Why samples are not analysed, or parts not merged.

use std::path::{Path, PathBuf};

use crate::job::Cancelled;
use crate::reading::FileError;
use crate::sink::SinkError;

/// Why there is no table of samples.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SamplesError {
    /// It was stopped; finished samples are kept.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Something cannot be written.
    #[error(transparent)]
    Sink(#[from] SinkError),
    /// A page or table cannot be made.
    #[error(transparent)]
    Report(#[from] moiregauge_report::ReportError),
    /// A folder cannot be looked through.
    #[error("cannot read {}", path.display())]
    Read {
        /// The folder or file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The table of samples cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Table {
        /// The table.
        path: PathBuf,
        /// Why not.
        source: FileError,
    },
    /// The table of samples cannot be understood.
    #[error("{}, line {line}: {reason}", path.display())]
    TableLine {
        /// The table.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What was expected and what was found.
        reason: String,
    },
    /// No scans at all.
    #[error("no scans in {} or any folder below it", .0.display())]
    NoSamples(PathBuf),
    /// There is no such shard.
    #[error("expected a shard from 1/N to N/N with N at most 100000, found {0:?}")]
    Shard(String),
    /// Nothing to merge.
    #[error(
        "{}: expected a folder of `campaign` with parts/list-I-of-N.json, found none: is every shard finished?",
        .0.display()
    )]
    NoParts(PathBuf),
    /// A list or part cannot be understood.
    #[error("{}: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Parts of another version.
    #[error("{}: made by version {found}, but this is version {expected}", path.display())]
    OtherVersion {
        /// The list.
        path: PathBuf,
        /// The version that made it.
        found: String,
        /// This version.
        expected: String,
    },
    /// Parts of other settings.
    #[error("{} and {} were made with different settings", first.display(), other.display())]
    OtherSettings {
        /// A list.
        first: PathBuf,
        /// One that differs.
        other: PathBuf,
    },
    /// Shards of differently divided runs.
    #[error("{} and {} come from runs with different numbers of shards", first.display(), other.display())]
    OtherDivision {
        /// A list.
        first: PathBuf,
        /// One that differs.
        other: PathBuf,
    },
    /// Two shards have a sample of one name that is not the same.
    #[error("two different samples are called {0:?}")]
    TwoSamples(String),
    /// Not all shards are there.
    #[error(
        "shards {} of {of} are missing or not finished: run them again",
        words(missing)
    )]
    MissingShards {
        /// Their numbers.
        missing: Vec<usize>,
        /// How many there are in all.
        of: usize,
    },
}

fn words(numbers: &[usize]) -> String {
    let all: Vec<String> = numbers.iter().map(ToString::to_string).collect();
    all.join(", ")
}

/// Adds the path to an error of the system.
pub(super) fn at(path: &Path) -> impl FnOnce(std::io::Error) -> SamplesError {
    let path = path.to_owned();
    |source| SamplesError::Read { path, source }
}
