//! The conditions that are given.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use moiregauge::simulate::Simulation;
use moiregauge_pipeline::validate::{LikeError, conditions_like};
use moiregauge_pipeline::{Job, Known};

use crate::errors::with_advice;
use crate::paths::expand;

/// Those of a settings file or of the user's own scans; `None` without either.
pub(crate) fn given_conditions(
    config: Option<&Path>,
    like: &[PathBuf],
    job: &Job,
) -> anyhow::Result<Option<Simulation>> {
    if like.is_empty() {
        config.map(read).transpose()
    } else {
        conditions(like, job).map(Some)
    }
}

fn conditions(like: &[PathBuf], job: &Job) -> anyhow::Result<Simulation> {
    let found: Result<Vec<PathBuf>, _> = expand(like, true).into_iter().collect();
    let found = found.map_err(|one| anyhow::anyhow!("{}: {}", one.file, one.error))?;
    conditions_like(&found, &Known::default(), job).map_err(|error| match error {
        LikeError::Cancelled(cancelled) => cancelled.into(),
        LikeError::File { file, source } => with_advice(source).context(file.display().to_string()),
        LikeError::Sets(_) => {
            let words = error.to_string();
            anyhow::anyhow!("--like {}", words.replacen("expected", "expects", 1))
        }
        other => other.into(),
    })
}

fn read(path: &Path) -> anyhow::Result<Simulation> {
    let text = moiregauge_pipeline::read_text(path)
        .with_context(|| format!("cannot read the settings file {}", path.display()))?;
    toml::from_str(&text).with_context(|| format!("in the settings file {}", path.display()))
}
