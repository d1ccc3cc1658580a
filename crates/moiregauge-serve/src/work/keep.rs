//! Works on the disk, if the user named a folder for them: whole or as before, whatever ends the server.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use moiregauge_pipeline::campaign::{Heard, Kept};
use serde::{Deserialize, Serialize};

use super::asked::Asked;
use super::history::History;
use crate::host::put;

/// What says which other files count; it is written last.
const WORK: &str = "work.json";
/// How names of files begin that hold one measured scan each.
const BEGUN: &str = "begun-";

/// A work as it is kept.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OnDisk {
    pub(super) history: History<Asked>,
    /// The results that lie beside it.
    pub(super) results: Option<Results>,
}

/// Results that are kept.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Results {
    /// Counts results; a part of the names of their files.
    pub(super) version: u64,
    /// What they answer.
    pub(super) answered: Asked,
    /// How many moirés they are of.
    pub(super) moires: usize,
}

/// A folder of works.
#[derive(Clone, Debug)]
pub(super) struct Keeper(PathBuf);

impl Keeper {
    pub(super) fn new(folder: &Path) -> Self {
        Self(folder.join("works"))
    }

    /// All that can be read, by their names.
    pub(super) fn all(&self) -> Vec<(String, OnDisk, Vec<Vec<u8>>, Kept)> {
        let folders = std::fs::read_dir(&self.0).into_iter().flatten().flatten();
        let one = |folder: PathBuf| {
            let id = folder.file_name()?.to_str()?.to_owned();
            let work: OnDisk =
                serde_json::from_slice(&std::fs::read(folder.join(WORK)).ok()?).ok()?;
            let Some(results) = &work.results else {
                return Some((id, work, Vec::new(), begun(&folder)));
            };
            let names = (1..=results.moires).map(|n| document(results.version, n));
            let documents = names.map(|name| std::fs::read(folder.join(name)).ok());
            let documents = documents.collect::<Option<_>>()?;
            let measured = std::fs::read(folder.join(measured_of(results.version))).ok();
            // What cannot be understood is measured again.
            let measured = measured.and_then(|bytes| serde_json::from_slice(&bytes).ok());
            let mut measured: Kept = measured.unwrap_or_default();
            measured.extend(begun(&folder));
            Some((id, work, documents, measured))
        };
        folders.filter_map(|entry| one(entry.path())).collect()
    }

    /// Keeps each file of a work as soon as it is measured, for what ends the run before there is a result. What cannot be
    /// written is measured again.
    pub(super) fn each(&self, id: &str) -> Heard {
        let folder = self.0.join(id);
        Arc::new(move |key, measured| {
            let bytes = serde_json::to_vec(&measured).ok();
            bytes.and_then(|bytes| put(&folder, &format!("{BEGUN}{key}.json"), &bytes).ok());
        })
    }

    /// Writes a work. Results have names of their own for each version, so that what was kept before counts until all of
    /// the new is on the disk.
    pub(super) fn save(
        &self,
        id: &str,
        work: &OnDisk,
        new: Option<(&[Vec<u8>], &Kept)>,
    ) -> std::io::Result<()> {
        let folder = self.0.join(id);
        std::fs::create_dir_all(&folder)?;
        let Some((results, (documents, kept))) = work.results.as_ref().zip(new) else {
            return put(&folder, WORK, &serde_json::to_vec(work)?);
        };
        for (number, bytes) in (1..).zip(documents) {
            put(&folder, &document(results.version, number), bytes)?;
        }
        let measured = serde_json::to_vec(kept)?;
        put(&folder, &measured_of(results.version), &measured)?;
        put(&folder, WORK, &serde_json::to_vec(work)?)?;
        forget(&folder, results);
        Ok(())
    }
}

fn document(version: u64, moire: usize) -> String {
    format!("results-{version}-{moire}.json")
}

fn measured_of(version: u64) -> String {
    format!("measured-{version}.json")
}

/// What a run had measured that came to no end.
fn begun(folder: &Path) -> Kept {
    let mut all = Kept::default();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let is_begun = entry.file_name().to_string_lossy().starts_with(BEGUN);
        let bytes = is_begun.then(|| std::fs::read(entry.path()).ok()).flatten();
        if let Some(kept) = bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok()) {
            all.extend(kept);
        }
    }
    all
}

/// Removes results of other versions, and what led to this one; what cannot be removed does no harm.
fn forget(folder: &Path, results: &Results) {
    let documents = (1..=results.moires).map(|n| document(results.version, n));
    let mut own: Vec<String> = documents.collect();
    own.push(measured_of(results.version));
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let is_result = |name: &str| {
            ["results-", "measured-", BEGUN]
                .iter()
                .any(|kind| name.starts_with(kind))
        };
        if let Some(name) = name.to_str()
            && is_result(name)
            && !own.iter().any(|one| one == name)
        {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_disk(version: u64) -> OnDisk {
        OnDisk {
            history: History::new(Asked::nothing()),
            results: Some(Results {
                version,
                answered: Asked::nothing(),
                moires: 1,
            }),
        }
    }

    /// Wherever a new result cannot be written, as on a full disk, the one before is there, all of it.
    #[test]
    fn what_cannot_be_saved_leaves_what_was() {
        let folder = tempfile::tempdir().unwrap();
        let keeper = Keeper::new(folder.path());
        let result = |text: &str| vec![text.as_bytes().to_vec()];
        let kept = Kept::default();
        let save = |version, text: &str| {
            keeper.save("w1", &on_disk(version), Some((&result(text), &kept)))
        };
        save(1, "one").unwrap();
        let here = folder.path().join("works/w1");
        for (version, name) in [(2, "results-2-1.json"), (3, "measured-3.json")] {
            std::fs::create_dir(here.join(name)).unwrap();
            assert!(save(version, "two").is_err());
            let all = keeper.all();
            assert_eq!(all[0].2, result("one"));
        }
        save(4, "four").unwrap();
        assert_eq!(keeper.all()[0].2, result("four"));
        let left = std::fs::read_dir(&here).unwrap().flatten();
        let left: Vec<_> = left.filter(|e| e.path().is_file()).collect();
        assert_eq!(left.len(), 3, "{left:?}");
    }
}
