//! A run again: what its document records, and its files, found and checked.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use moiregauge::settings::Settings;
use moiregauge_report::results::Run;
use moiregauge_report::{FailedInput, InputFile};
use serde::Deserialize;

use crate::hash::identity;
use crate::known::Known;
use crate::names::in_words;
use crate::session::file_of;
use crate::source::Places;

/// Why a run cannot be repeated.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The document cannot be read.
    #[error("cannot read {file}: {reason}")]
    Unreadable {
        /// Its name.
        file: String,
        /// What was expected and what was found.
        reason: String,
    },
    /// The document is older than records of runs.
    #[error(
        "{file} does not record its run, because version {version} did not do so. Use its settings for a new run"
    )]
    NoRun {
        /// Its name.
        file: String,
        /// Version of the program that wrote it.
        version: String,
    },
    /// Files are missing or changed.
    #[error("{}", .0)]
    Files(String),
}

/// A `results.json` or `map.json`, as far as a repetition needs it.
#[derive(Clone, Debug)]
pub struct Document {
    /// Version of the program that wrote it.
    pub version: String,
    /// What was asked.
    pub run: Run,
    /// Its bytes, to compare with.
    pub bytes: Vec<u8>,
    /// The files with their hashes.
    files: Vec<InputFile>,
    /// The folders to look for files in where nobody names one.
    near: Vec<PathBuf>,
}

/// What the documents have in common.
#[derive(Deserialize)]
struct Any {
    settings: Settings,
    provenance: AnyProvenance,
}

#[derive(Deserialize)]
struct AnyProvenance {
    version: String,
    inputs: Vec<InputFile>,
    #[serde(default)]
    run: Option<Run>,
}

fn parse(path: &Path, bytes: &[u8]) -> Result<Any, ReplayError> {
    serde_json::from_slice(bytes).map_err(|error| ReplayError::Unreadable {
        file: path.display().to_string(),
        reason: format!("expected a results.json or map.json: {error}"),
    })
}

/// The settings that a document holds, as they were used.
///
/// # Errors
/// It is no such document.
pub fn settings_of(path: &Path, bytes: &[u8]) -> Result<Settings, ReplayError> {
    Ok(parse(path, bytes)?.settings)
}

impl Document {
    /// Reads a document.
    ///
    /// # Errors
    /// It cannot be read, or does not record its run.
    pub fn read(path: &Path) -> Result<Self, ReplayError> {
        let file = path.display().to_string();
        let bytes = crate::reading::read(path).map_err(|error| ReplayError::Unreadable {
            file: file.clone(),
            reason: error.to_string(),
        })?;
        let AnyProvenance {
            version,
            inputs: mut files,
            run,
        } = parse(path, &bytes)?.provenance;
        let Some(run) = run else {
            return Err(ReplayError::NoRun { file, version });
        };
        files.extend(run.other_files.iter().cloned());
        let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let near = whole.ancestors().skip(1).take(2);
        Ok(Self {
            version,
            bytes,
            files,
            near: near.map(Path::to_owned).collect(),
            run,
        })
    }

    /// Whether another version of the program wrote it: numbers may differ.
    pub fn is_of_another_version(&self) -> bool {
        self.version != crate::VERSION
    }

    /// Finds all files of the run and checks that they are the same: by their names from the current folder, then by
    /// name and by content in `folders` (where there are none: in that of the document and the one above it).
    ///
    /// # Errors
    /// Files that are missing or have other bytes, all of them.
    pub fn find(&self, folders: &[PathBuf]) -> Result<Places, ReplayError> {
        let folders = if folders.is_empty() {
            &self.near
        } else {
            folders
        };
        let (mut places, mut problems) = (Places::new(), Vec::new());
        for file in &self.files {
            let name = PathBuf::from(&file.file);
            match find(file, folders) {
                Ok(place) if place == name => {}
                Ok(place) => {
                    places.insert(name, place);
                }
                Err(problem) => problems.push(problem),
            }
        }
        if problems.is_empty() {
            return Ok(places);
        }
        let mut words = format!(
            "{} of the {} files of the run are missing or have changed:",
            problems.len(),
            self.files.len()
        );
        for problem in problems {
            // Writing into a string cannot fail.
            let _ = write!(words, "\n  {problem}");
        }
        Err(ReplayError::Files(words))
    }
}

/// Where the file lies now, or what is wrong.
fn find(file: &InputFile, folders: &[PathBuf]) -> Result<PathBuf, String> {
    let name = file_of(Path::new(&file.file));
    let mut candidates = vec![name.to_owned()];
    for folder in folders {
        // A name from the root stays what it is.
        candidates.push(folder.join(name));
        candidates.extend(name.file_name().map(|name| folder.join(name)));
    }
    let mut other = None;
    for place in candidates {
        match identity(Path::new(&file.file), &place) {
            Ok(found) if found.sha256 == file.sha256 => return Ok(place),
            Ok(found) => {
                other.get_or_insert((found, place));
            }
            Err(_) => {}
        }
    }
    if let Some(place) = folders.iter().find_map(|folder| by_content(file, folder)) {
        return Ok(place);
    }
    let expected = format!(
        "{}: expected {} bytes with SHA-256 {}",
        file.file, file.bytes, file.sha256
    );
    Err(match other {
        Some((found, place)) => format!(
            "{expected}, found {} bytes with SHA-256 {} ({})",
            found.bytes,
            found.sha256,
            place.display()
        ),
        None => format!("{expected}, found no such file"),
    })
}

/// The file of this content in the folder or one directly below it, whatever its name.
fn by_content(file: &InputFile, folder: &Path) -> Option<PathBuf> {
    let listed = |folder: &Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).into_iter().flatten();
        let mut all: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
        all.sort();
        all
    };
    let here = listed(folder);
    let below: Vec<PathBuf> = here.iter().flat_map(|inner| listed(inner)).collect();
    here.into_iter().chain(below).find(|place| {
        let size = std::fs::metadata(place).map(|m| m.len());
        size.is_ok_and(|size| size == file.bytes)
            && identity(place, place).is_ok_and(|found| found.sha256 == file.sha256)
    })
}

/// Puts into the record of a run which files it read; `measured` are those whose hashes the document has anyway.
pub fn record_files(run: &mut Run, known: &Known, inputs: &[PathBuf], measured: &[InputFile]) {
    let mut others = BTreeMap::new();
    let mut add = |name: &Path| -> Result<(), crate::reading::FileError> {
        let file = in_words(name);
        if !measured.iter().any(|m| m.file == file) && !others.contains_key(&file) {
            others.insert(file, known.source(name).identity(name)?);
        }
        Ok(())
    };
    for path in inputs {
        let file = in_words(path);
        // A scan in memory is never looked for on the disk.
        let added = known.in_memory(path).map_or_else(|| add(path), |_| Ok(()));
        match added {
            Ok(()) => run.inputs.push(file),
            Err(error) => run.left_out.push(FailedInput {
                file,
                error: error.to_string(),
            }),
        }
    }
    let sensors = run.known.sensors.as_ref().map(PathBuf::from);
    let atomic = run.atomic.iter().flat_map(|a| a.files.iter());
    let beside = inputs.iter().cloned().chain(atomic.map(PathBuf::from));
    let logs = beside.flat_map(|path| known.logs(&path));
    for path in logs.chain(sensors) {
        // What cannot be read was no part of it.
        let _ = add(&path);
    }
    run.other_files = others.into_values().collect();
}
