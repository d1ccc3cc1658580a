//! The conditions that are given.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use moiregauge::simulate::Simulation;

use super::like;

/// Those of a settings file or of the user's own scans; `None` without either.
pub(crate) fn given_conditions(
    config: Option<&Path>,
    like: &[PathBuf],
) -> anyhow::Result<Option<Simulation>> {
    if like.is_empty() {
        config.map(read).transpose()
    } else {
        like::conditions(like).map(Some)
    }
}

fn read(path: &Path) -> anyhow::Result<Simulation> {
    let text = moiregauge_pipeline::read_text(path)
        .with_context(|| format!("cannot read the settings file {}", path.display()))?;
    toml::from_str(&text).with_context(|| format!("in the settings file {}", path.display()))
}
