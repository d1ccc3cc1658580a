//! Measured scans between two watches of one folder.

use std::path::Path;

use anyhow::{Context as _, anyhow, ensure};
use moiregauge_pipeline::absolute;
use moiregauge_pipeline::campaign::{Journal, JournalError};
use moiregauge_pipeline::watch::Watch;

/// A file outside the folder that holds what is measured.
pub(super) struct Keep(Journal);

impl Keep {
    /// Takes what an earlier watch has kept.
    ///
    /// # Errors
    /// The file holds something else, lies in the folder, or cannot be written.
    pub(super) fn open(path: &Path, watch: &mut Watch) -> anyhow::Result<Self> {
        let option = || format!("--keep {}", path.display());
        let whole = |path: &Path| path.canonicalize().unwrap_or_else(|_| absolute(path));
        let folder = whole(&watch.request().folder);
        let parent = path
            .parent()
            .filter(|p| *p != Path::new(""))
            .unwrap_or(Path::new("."));
        ensure!(
            whole(parent) != folder,
            "{}: this is inside the watched folder, where nothing is written. Give a place outside of it",
            option()
        );
        let opened = Journal::open(path).map_err(|error| match error {
            JournalError::Foreign { why, .. } => {
                anyhow!("expected a file that an earlier watch wrote (--keep): {why}")
            }
            other => other.into(),
        });
        let (journal, kept) = opened.with_context(option)?;
        watch.take(kept);
        Ok(Self(journal))
    }

    /// Writes what was measured since.
    pub(super) fn save(&mut self, watch: &Watch) -> anyhow::Result<()> {
        Ok(self.0.add(watch.kept())?)
    }
}
