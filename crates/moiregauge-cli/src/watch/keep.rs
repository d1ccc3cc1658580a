//! Measured scans between two watches of one folder.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use moiregauge_pipeline::absolute;
use moiregauge_pipeline::campaign::Kept;
use moiregauge_pipeline::watch::Watch;

use crate::outputs;

/// A file outside the folder that holds what is measured.
pub(super) struct Keep {
    path: PathBuf,
    /// How many scans it holds.
    count: usize,
}

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
        if path.exists() {
            let bytes = moiregauge_pipeline::read(path).with_context(option)?;
            let kept: Kept = serde_json::from_slice(&bytes).with_context(|| {
                format!(
                    "{}: expected a file that an earlier watch wrote (--keep)",
                    option()
                )
            })?;
            watch.take(kept);
        }
        outputs::file(path, true, &[]).with_context(option)?;
        Ok(Self {
            path: path.to_owned(),
            count: watch.kept().len(),
        })
    }

    /// Writes what is measured, if that is more than before.
    pub(super) fn save(&mut self, watch: &Watch) -> anyhow::Result<()> {
        let kept = watch.kept();
        if kept.len() == self.count {
            return Ok(());
        }
        outputs::file(&self.path, true, &[])?.write(serde_json::to_vec(kept)?)?;
        self.count = kept.len();
        Ok(())
    }
}
