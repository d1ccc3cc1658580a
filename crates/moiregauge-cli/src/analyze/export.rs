//! `analyze --export`: which corrected images are wanted, in which formats.

use std::path::Path;

use anyhow::{Context as _, ensure};
use moiregauge_pipeline::campaign::Export;
use spmfile::WritableFormat;

use crate::convert::format_of;

/// All that are wanted.
pub(super) fn all(names: &[String]) -> anyhow::Result<Vec<Export>> {
    names.iter().map(|name| parse(name)).collect()
}

/// `corrected.gwy` as the folder `corrected` and the format.
fn parse(name: &str) -> anyhow::Result<Export> {
    let path = Path::new(name);
    let format = format_of(path).context("--export")?;
    ensure!(
        format != WritableFormat::Gxyzf,
        "--export {name}: corrected images cannot be written as points. `moiregauge convert` writes points"
    );
    ensure!(
        path.parent().is_none_or(|p| p == Path::new("")),
        "--export {name}: expected a name without folders; the file is written into --out"
    );
    Ok(Export {
        folder: path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        format,
    })
}
