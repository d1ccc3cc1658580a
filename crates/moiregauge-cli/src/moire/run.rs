//! The run: a question → the cell and what it means, printed and drawn.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context as _, bail, ensure};
use heterostrain::lattice::Lattice;
use heterostrain::lattice::{MoireCell, WavelengthMeaning, from_wavelengths};
use heterostrain::material::Material;
use heterostrain::strain::moire_of;
use heterostrain::strain::twist_strain;
use moiregauge::drift::Statistical;
use moiregauge::meaning::Budget;
use moiregauge::meaning::{Readings, WaveStrengths};
use moiregauge::settings::Settings;
use moiregauge_report::{CellResult, Drawing, MoireDocument, cell_figure};
use nalgebra::Matrix4;

use super::args::MoireArgs;
use super::question::Question;
use super::words;
use crate::say::say;

/// Calculates, prints and draws.
pub(crate) fn run(args: &MoireArgs) -> anyhow::Result<ExitCode> {
    if args.list {
        say(&words::list(&Material::all()))?;
        return Ok(ExitCode::SUCCESS);
    }
    let settings = args.settings()?;
    let file = |path| crate::outputs::file(path, args.force, &[]);
    let file = args.figure.as_deref().map(file).transpose()?;
    let asked = args.question()?;
    let lattice = lattice(&asked, &settings)?;
    let cell = MoireCell::new(&lattice.basis).context("the two vectors are parallel")?;
    // Names of waves are those of the vectors that are shown.
    let lattice = cell.pair_of(&lattice);
    let forward = matches!(asked, Question::Forward(_));
    let read = if forward {
        None
    } else {
        ensure!(
            settings.lattice_angle.is_none() || !matches!(asked, Question::Wavelengths { .. }),
            "--lattice-angle needs --vectors: three wavelengths do not tell how the moiré lies in the \
             laboratory"
        );
        Some(read(&lattice, &settings)?)
    };
    let document = MoireDocument::new(
        args.in_words(),
        CellResult::new(&cell, args.band_degeneracy),
        read.as_ref().map(|(found, readings)| (found, readings)),
        &settings,
    );
    if args.json {
        say(&document.to_json()?)?;
    } else {
        say(&words::answer(
            &document,
            read.as_ref().map(|(_, readings)| readings),
            match &asked {
                Question::Wavelengths {
                    meaning: WavelengthMeaning::RealSpace,
                    ..
                } => "the vector of the first wavelength",
                Question::Wavelengths { .. } => "the wave vector of the first wavelength",
                _ => "x",
            },
        ))?;
    }
    if let (Some(path), Some(file)) = (&args.figure, file) {
        let drawing = cell_figure(&cell, "moire", &document.layers);
        file.write(encoded(drawing, path)?)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The lattice that is asked about.
fn lattice(asked: &Question, settings: &Settings) -> anyhow::Result<Lattice> {
    Ok(match asked {
        Question::Forward(stacking) => Lattice::exact(moire_of(
            stacking,
            settings.bilayer(),
            settings.strain_convention,
        )?),
        Question::Wavelengths {
            lengths,
            sigmas,
            meaning,
        } => from_wavelengths(*lengths, *sigmas, *meaning)?,
        Question::Vectors { basis, sigma } => {
            Lattice::new(*basis, Matrix4::identity() * (sigma * sigma))
        }
    })
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

/// All readings of a lattice whose covariance is all that is not known of it.
fn read(
    lattice: &Lattice,
    settings: &Settings,
) -> anyhow::Result<(heterostrain::strain::TwistStrain, Readings)> {
    let found = twist_strain(lattice, settings.bilayer(), settings.strain_convention)?;
    let statistical = Statistical {
        image: lattice.covariance,
        drift: Matrix4::zeros(),
        sensor: Matrix4::zeros(),
    };
    let budget = Budget::new(lattice, &found, &statistical, settings);
    let readings = Readings::new(
        lattice,
        &found,
        &budget,
        &WaveStrengths::default(),
        settings,
    );
    Ok((found, readings))
}
