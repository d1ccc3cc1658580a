//! Works on the disk, if the user named a folder for them: whole or as before, whatever ends the server.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use moiregauge_pipeline::campaign::Kept;
use serde::{Deserialize, Serialize};
use tempfile::NamedTempFile;

use super::asked::Asked;
use super::history::History;

const WORK: &str = "work.json";
const MEASURED: &str = "measured.json";

/// A work as it is kept.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OnDisk {
    pub(super) history: History<Asked>,
    /// What the results that are kept answer.
    pub(super) answered: Option<Asked>,
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
            let documents = (1..=work.moires).map(|n| std::fs::read(folder.join(document(n))).ok());
            let measured = std::fs::read(folder.join(MEASURED)).ok();
            // What cannot be understood is measured again.
            let measured = measured.and_then(|bytes| serde_json::from_slice(&bytes).ok());
            Some((
                id,
                work,
                documents.collect::<Option<_>>()?,
                measured.unwrap_or_default(),
            ))
        };
        folders.filter_map(|entry| one(entry.path())).collect()
    }

    /// Writes a work, the list of what there is last.
    pub(super) fn save(
        &self,
        id: &str,
        work: &OnDisk,
        new: Option<(&[Vec<u8>], &Kept)>,
    ) -> std::io::Result<()> {
        let folder = self.0.join(id);
        std::fs::create_dir_all(&folder)?;
        if let Some((documents, kept)) = new {
            for (number, bytes) in (1..).zip(documents) {
                put(&folder, &document(number), bytes)?;
            }
            put(&folder, MEASURED, &serde_json::to_vec(kept)?)?;
        }
        put(&folder, WORK, &serde_json::to_vec(work)?)
    }
}

fn document(moire: usize) -> String {
    format!("results-{moire}.json")
}

/// A file, whole and on the disk when this comes back.
fn put(folder: &Path, name: &str, bytes: &[u8]) -> std::io::Result<()> {
    let mut file = NamedTempFile::with_prefix_in(".part-", folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(folder.join(name)).map_err(|e| e.error)?;
    #[cfg(unix)]
    std::fs::File::open(folder)?.sync_all()?;
    Ok(())
}
