//! The run: a question → the cell and what it means, printed and drawn.

use std::path::Path;
use std::process::ExitCode;

use anyhow::bail;
use heterostrain::material::Material;
use moiregauge_pipeline::moire::{Given, MoireError};
use moiregauge_report::Drawing;

use super::args::MoireArgs;
use super::words;
use crate::say::say;

/// Calculates, prints and draws.
pub(crate) fn run(args: &MoireArgs) -> anyhow::Result<ExitCode> {
    if args.list {
        say(&words::list(&Material::all()))?;
        return Ok(ExitCode::SUCCESS);
    }
    let asked = args.question()?;
    let file = |path| crate::outputs::file(path, args.force, &[]);
    let file = args.figure.as_deref().map(file).transpose()?;
    let mut found = moiregauge_pipeline::moire(&asked).map_err(|error| match error {
        MoireError::NoOrientation => anyhow::anyhow!("--lattice-angle needs --vectors: {error}"),
        other => other.into(),
    })?;
    if let Some(typed) = args.vectors_in_words() {
        found.document.input = typed;
    }
    if args.json {
        say(&found.document.to_json()?)?;
    } else {
        say(&words::answer(
            &found.document,
            found.read.as_ref().map(|(_, readings)| readings),
            match &asked.given {
                Given::Wavelengths { k_space: false, .. } => "the vector of the first wavelength",
                Given::Wavelengths { .. } => "the wave vector of the first wavelength",
                _ => "x",
            },
        ))?;
    }
    if let (Some(path), Some(file)) = (&args.figure, file) {
        file.write(encoded(found.figure(), path)?)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A drawing in the format that the name of its file tells.
fn encoded(drawing: Drawing, path: &Path) -> anyhow::Result<Vec<u8>> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    match extension.to_ascii_lowercase().as_str() {
        "svg" => Ok(drawing.svg.into_bytes()),
        "png" => Ok(drawing.png()?),
        other => bail!("--figure: expected a name that ends in .svg or .png, found {other:?}"),
    }
}
