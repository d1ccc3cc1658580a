//! A folder of results: written as a whole or not at all.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::SinkError;
use super::error::at;
use super::manifest::{Entry, MANIFEST, Manifest, State, check_name, exists};
use super::work::{INTENT, PARTS, Work, write_whole};

/// Documents by which folders of versions that wrote no manifest are known, and what wrote them.
const DOCUMENTS: [(&str, &str); 5] = [
    ("results.json", "analyze"),
    ("moire-1/results.json", "analyze"),
    ("map.json", "map"),
    ("validation.json", "validate"),
    ("truth.json", "simulate"),
];

/// What is to be written, and where.
#[derive(Clone, Debug)]
pub struct Target<'a> {
    /// The folder, which need not exist.
    pub folder: &'a Path,
    /// What kind of results they are: the command of the program.
    pub kind: &'a str,
    /// Names that may be written, so that one that is taken is found out before the work. Names that end with `/` are
    /// folders, which may hold files of others, too.
    pub names: &'a [String],
    /// Files that the run reads.
    pub inputs: &'a [PathBuf],
    /// Whether results of the same kind are replaced.
    pub force: bool,
}

/// A folder that is being written; nothing of it is at its place before [`FolderSink::commit`].
#[derive(Debug)]
pub struct FolderSink {
    folder: PathBuf,
    kind: String,
    work: Work,
    /// What an earlier run has left, where it is to be replaced.
    earlier: Option<Earlier>,
    inputs: Vec<PathBuf>,
    written: Mutex<BTreeMap<String, Entry>>,
}

/// Results that are replaced.
#[derive(Debug)]
enum Earlier {
    Listed(Manifest),
    /// Written by a version that kept no list.
    Unlisted,
}

/// A part of an earlier run that was kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Part {
    /// There is none of this name.
    Absent,
    /// It is not what was kept.
    Damaged,
    /// As it was kept.
    Whole(Vec<u8>),
}

/// What is being done when a run ends in the middle.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Intent {
    manifest: Manifest,
    /// Files that are replaced or removed.
    old: Vec<Entry>,
}

impl FolderSink {
    /// Makes the folder ready, before the work.
    ///
    /// What an earlier run has left unfinished is completed or swept up first.
    ///
    /// # Errors
    /// [`SinkError`] if the folder cannot be written, another run is writing into it, or something is in it that would
    /// have to be replaced and may not be.
    pub fn open(target: &Target) -> Result<Self, SinkError> {
        let folder = target.folder;
        if exists(folder) && !folder.is_dir() {
            return Err(SinkError::NoFolder(folder.to_owned()));
        }
        let work = Work::exclusive(folder)?;
        complete(folder, &work)?;
        let earlier = earlier(target)?;
        let knows = |name: &str| match &earlier {
            Some(Earlier::Listed(manifest)) => manifest.knows(name),
            // A group is no single file: what of it is of an earlier run is not known.
            Some(Earlier::Unlisted) => !folder.join(name).is_dir(),
            None => false,
        };
        for name in target.names {
            let path = folder.join(name);
            let plain = name.trim_end_matches('/');
            let may_be_there = (plain.len() < name.len() && path.is_dir()) || knows(plain);
            if exists(&folder.join(plain)) && !may_be_there {
                return Err(SinkError::Foreign(folder.join(plain)));
            }
        }
        if let Some(Earlier::Listed(manifest)) = &earlier {
            for entry in &manifest.files {
                if entry.state(folder).map_err(at(folder))? == State::Changed {
                    return Err(SinkError::Changed(folder.join(&entry.path)));
                }
            }
        }
        let inputs = canonical(target.inputs);
        let sink = Self {
            folder: folder.to_owned(),
            kind: target.kind.to_owned(),
            work,
            earlier,
            inputs,
            written: Mutex::default(),
        };
        sink.no_input_is_replaced()?;
        Ok(sink)
    }

    /// Writes a file of the results; parts of its name are divided by `/`. A second one of the same name replaces the
    /// first.
    ///
    /// # Errors
    /// [`SinkError`] if it cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), SinkError> {
        check_name(name)?;
        self.work.stage(name, bytes)?;
        let entry = Entry::of_bytes(name, bytes);
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        written.insert(name.to_owned(), entry);
        Ok(())
    }

    /// Keeps a part of a long run, so that another one can go on with it if this one is interrupted.
    ///
    /// # Errors
    /// [`SinkError`] if it cannot be written.
    pub fn keep(&self, name: &str, bytes: &[u8]) -> Result<(), SinkError> {
        check_name(name)?;
        let whole = self.work.path(PARTS).join(name);
        let mut hashed = Sha256::digest(bytes).to_vec();
        hashed.extend(bytes);
        write_whole(&whole, &hashed)
    }

    /// Whether an earlier run has kept any parts.
    pub fn keeps_parts(&self) -> bool {
        let parts = std::fs::read_dir(self.work.path(PARTS));
        parts.is_ok_and(|mut parts| parts.next().is_some())
    }

    /// A part that an earlier run has kept.
    pub fn kept(&self, name: &str) -> Part {
        let Ok(mut hashed) = std::fs::read(self.work.path(PARTS).join(name)) else {
            return Part::Absent;
        };
        if hashed.len() < 32 {
            return Part::Damaged;
        }
        let bytes = hashed.split_off(32);
        if Sha256::digest(&bytes)[..] == hashed[..] {
            Part::Whole(bytes)
        } else {
            Part::Damaged
        }
    }

    /// Puts everything in place, removes what is left of the earlier run, and what was kept.
    ///
    /// # Errors
    /// [`SinkError`]; nothing has changed then, except after [`SinkError::Unfinished`].
    pub fn commit(self) -> Result<(), SinkError> {
        let written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        let manifest = Manifest::new(&self.kind, written.values().cloned().collect());
        drop(written);
        let intent = Intent {
            old: self.old(&manifest)?,
            manifest,
        };
        self.no_input_is_replaced()?;
        check_places(&self.folder, &self.work, &intent)?;
        let path = self.work.path(INTENT);
        self.work.stage(MANIFEST, &json(&intent.manifest, &path)?)?;
        write_whole(&path, &json(&intent, &path)?)?;
        apply(&self.folder, &self.work, &intent)?;
        std::fs::remove_dir_all(self.work.path(PARTS)).ok();
        Ok(())
    }

    /// Files that are replaced or removed.
    fn old(&self, manifest: &Manifest) -> Result<Vec<Entry>, SinkError> {
        match &self.earlier {
            None => Ok(Vec::new()),
            Some(Earlier::Listed(earlier)) => Ok(earlier.files.clone()),
            Some(Earlier::Unlisted) => {
                let names = manifest.files.iter().map(|f| &f.path);
                let found = names.filter_map(|path| Entry::of_file(&self.folder, path).transpose());
                found.collect::<Result<_, _>>().map_err(at(&self.folder))
            }
        }
    }

    /// An error if an input is a file of the earlier run.
    fn no_input_is_replaced(&self) -> Result<(), SinkError> {
        let Ok(folder) = self.folder.canonicalize() else {
            return Ok(());
        };
        let written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        for input in &self.inputs {
            let inside = input.strip_prefix(&folder).ok().and_then(Path::to_str);
            let Some(name) = inside.map(|name| name.replace('\\', "/")) else {
                continue;
            };
            let listed = match &self.earlier {
                Some(Earlier::Listed(manifest)) => manifest.entry(&name).is_some(),
                _ => false,
            };
            if listed || written.contains_key(&name) {
                return Err(SinkError::Input(input.clone()));
            }
        }
        Ok(())
    }
}

fn json(value: &impl Serialize, path: &Path) -> Result<Vec<u8>, SinkError> {
    let mut text = serde_json::to_vec_pretty(value).map_err(|e| at(path)(e.into()))?;
    text.push(b'\n');
    Ok(text)
}

/// Paths as the system knows them; those that are not there are left out.
pub(super) fn canonical(paths: &[PathBuf]) -> Vec<PathBuf> {
    let known = paths.iter().filter_map(|path| path.canonicalize().ok());
    known.collect()
}

/// What of an earlier run is in the folder and may be replaced.
fn earlier(target: &Target) -> Result<Option<Earlier>, SinkError> {
    let folder = target.folder;
    let manifest = Manifest::read(folder)?;
    let found = match &manifest {
        Some(manifest) => Some(manifest.kind.as_str()),
        None => unlisted(folder),
    };
    let Some(found) = found else {
        return Ok(None);
    };
    if found != target.kind {
        return Err(SinkError::OtherKind {
            folder: folder.to_owned(),
            found: found.to_owned(),
            wanted: target.kind.to_owned(),
        });
    }
    if !target.force {
        return Err(SinkError::Holds {
            folder: folder.to_owned(),
            kind: found.to_owned(),
        });
    }
    Ok(Some(manifest.map_or(Earlier::Unlisted, Earlier::Listed)))
}

/// What wrote the results in a folder without a list, by their document.
fn unlisted(folder: &Path) -> Option<&'static str> {
    let of = |(name, kind): &(&str, &'static str)| {
        let text = std::fs::read(folder.join(name)).ok()?;
        let document: serde_json::Value = serde_json::from_slice(&text).ok()?;
        let schema = document.get("schema")?.as_str()?;
        schema.starts_with("moiregauge/").then_some(*kind)
    };
    DOCUMENTS.iter().find_map(of)
}

/// Completes what an earlier run has left in its last step, or sweeps up.
fn complete(folder: &Path, work: &Work) -> Result<(), SinkError> {
    let path = work.path(INTENT);
    if path.exists() {
        let damaged = |reason: String| SinkError::Manifest {
            path: path.clone(),
            reason,
        };
        let text = std::fs::read(&path).map_err(|e| damaged(e.to_string()))?;
        let intent: Intent = serde_json::from_slice(&text).map_err(|e| damaged(e.to_string()))?;
        intent.manifest.check().map_err(damaged)?;
        check_places(folder, work, &intent)?;
        apply(folder, work, &intent)?;
        std::fs::remove_dir_all(work.path(PARTS)).ok();
    }
    work.clear();
    Ok(())
}

/// An error if a file that is to be moved would replace one that is not ours, or was changed.
fn check_places(folder: &Path, work: &Work, intent: &Intent) -> Result<(), SinkError> {
    for entry in &intent.manifest.files {
        let place = folder.join(&entry.path);
        if !exists(&place) || !work.staged(&entry.path).exists() {
            continue;
        }
        let Some(old) = intent.old.iter().find(|old| old.path == entry.path) else {
            return Err(SinkError::Foreign(place));
        };
        if old.state(folder).map_err(at(&place))? == State::Changed {
            return Err(SinkError::Changed(place));
        }
    }
    Ok(())
}

/// Removes and moves files; what is done already is no error.
fn apply(folder: &Path, work: &Work, intent: &Intent) -> Result<(), SinkError> {
    let unfinished = |path: &Path| {
        let (path, work) = (path.to_owned(), work.dir().to_owned());
        move |source| SinkError::Unfinished { path, work, source }
    };
    let is_new = |entry: &&Entry| intent.manifest.entry(&entry.path).is_some();
    let mut emptied = BTreeSet::new();
    for stale in intent.old.iter().filter(|old| !is_new(old)) {
        let place = folder.join(&stale.path);
        if stale.state(folder).map_err(unfinished(&place))? == State::Same {
            std::fs::remove_file(&place).map_err(unfinished(&place))?;
            let inside = Path::new(&stale.path).ancestors().skip(1);
            emptied.extend(inside.filter(|p| *p != Path::new("")).map(Path::to_owned));
        }
    }
    let names = intent.manifest.files.iter().map(|f| f.path.as_str());
    for name in names.chain([MANIFEST]) {
        let (staged, place) = (work.staged(name), folder.join(name));
        if staged.exists() {
            let into = place.parent().unwrap_or(folder);
            let moved =
                std::fs::create_dir_all(into).and_then(|()| std::fs::rename(&staged, &place));
            moved.map_err(unfinished(&place))?;
        }
    }
    // Inner ones first; those with files of others stay.
    for inner in emptied.iter().rev() {
        std::fs::remove_dir(folder.join(inner)).ok();
    }
    let path = work.path(INTENT);
    std::fs::remove_file(&path).map_err(unfinished(&path))
}
