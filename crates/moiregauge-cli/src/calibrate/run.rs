//! The run: images of a known lattice → the calibration, printed and written.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use heterostrain::material::Material;
use moiregauge::calibration::KnownLattice;
use moiregauge::settings::{MOST_IMAGES, Settings};
use moiregauge_pipeline::Job;
use moiregauge_pipeline::calibrate::{
    CalibrateRequest, NotCalibrated, NotMeasured, Unusable, WhyNotCalibrated, known_lattice,
};
use moiregauge_pipeline::names::in_words;
use moiregauge_report::FailedInput;
use moiregauge_report::screen::failures;

use super::words;
use crate::analyze::{BackgroundArg, LineArg};
use crate::config;
use crate::errors::with_advice;
use crate::input::KnownArgs;
use crate::numbers;
use crate::paths::inputs;
use crate::say::say;

/// The first line of the file.
const TITLE: &str = "Calibration of a scanner, for `moiregauge analyze --calibration FILE`.";

/// Measure gain, mismatch and orthogonality of a scanner from images of a known lattice
///
/// The lattice of each image is found from its known size, at any orientation; frames up and down (or of both slow
/// axes, or of two line rates) separate the drift. The remaining difference from the known lattice is the distortion of
/// the scanner: of its position sensors, or of its nominal coordinates if there are none. A rotation of the axes cannot
/// be measured, because the orientation of the known lattice is not known. `moiregauge analyze --calibration FILE`
/// corrects positions with the result and takes its errors into the budget. With frames of one direction only, drift
/// cannot be separated from the distortion.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge calibrate hopg_up.spm hopg_down.spm --material graphite --out scanner.toml
  moiregauge calibrate si/*.sxm --material si111-7x7 --channel Z --out scanner.toml
  moiregauge calibrate grid/ --lattice 0.5nm,0.62nm,103 --lattice-sigma 0.1
  moiregauge calibrate one.sxm --material graphite --drift-sigma 0.2
  moiregauge analyze scans/ --out results --calibration scanner.toml

Lengths are shown (1 + gain) times too long, those along x more than those along y by the mismatch;
the axes shown enclose a right angle less the orthogonality error.")]
pub(crate) struct CalibrateArgs {
    /// Scan files, folders (the scans in them, without subfolders) or names with * and ?
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// The lattice that the images show: graphite, mica, si111-7x7, si111, au111 or a layer (graphene, hBN, …)
    #[arg(long, value_name = "NAME", required_unless_present_any = ["lattice", "lattice_constant"])]
    material: Option<String>,
    /// TOML file with layers of your own, one [[layer]] table each, for --material
    #[arg(long, value_name = "FILE", requires = "material")]
    materials: Option<PathBuf>,
    /// Any lattice: two lengths and the angle between them in degrees, as in 0.5nm,0.62nm,103
    #[arg(long, value_name = "A,B,ANGLE", value_parser = parse_lattice, conflicts_with_all = ["material", "lattice_constant"])]
    lattice: Option<Cell>,
    /// A hexagonal lattice by its constant, as in 0.246nm
    #[arg(long, value_name = "LENGTH", value_parser = parse_length, conflicts_with = "material")]
    lattice_constant: Option<f64>,
    /// Standard uncertainty of the known lattice, per cent [default: the material's; 0.1 for one of your own]
    #[arg(long, value_name = "PERCENT", value_parser = numbers::number([0.0, 10.0]))]
    lattice_sigma: Option<f64>,
    /// File for the calibration (TOML)
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Standard deviation of each component of the drift, nm/min, where the frames do not determine it
    #[arg(long, value_name = "NM/MIN", default_value_t = 1.0, value_parser = numbers::number(numbers::NOT_NEGATIVE))]
    drift_sigma: f64,
    /// Channel that shows the lattice [default: the first of the usual ones]
    #[arg(long, value_name = "NAME")]
    channel: Option<String>,
    /// Number of the image, if a file holds several images of the channel (pages, frames) [default: the first]
    #[arg(long, value_name = "N", value_parser = numbers::count(1, MOST_IMAGES))]
    image: Option<usize>,
    /// Line directions to use [default: both]
    #[arg(long, value_enum)]
    line: Option<LineArg>,
    /// What is subtracted from an image first [default: plane]
    #[arg(long, value_enum)]
    background: Option<BackgroundArg>,
    #[command(flatten)]
    known: KnownArgs,
    /// Replace an earlier calibration
    #[arg(long, requires = "out")]
    force: bool,
    /// Print nothing but errors
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// A lattice as it is typed in.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cell {
    a_nm: f64,
    b_nm: f64,
    angle_deg: f64,
}

/// Measures the images, prints what they say, and writes the file.
pub(crate) fn run(args: &CalibrateArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let request = args.request()?;
    let (inputs, mut failed) = inputs(&args.paths, !args.quiet);
    let file = |out| crate::outputs::file(out, args.force, &inputs);
    let file = args.out.as_deref().map(file).transpose()?;
    let known = args.known.of(&inputs);
    let found = match moiregauge_pipeline::calibrate(&inputs, &known, &request, job) {
        Ok((found, lost)) => {
            failed.extend(lost.into_iter().map(with_hint));
            eprint!("{}", failures(&failed));
            found
        }
        Err(NotCalibrated { why, failed: lost }) => {
            failed.extend(lost.into_iter().map(with_hint));
            eprint!("{}", failures(&failed));
            return Err(match why {
                WhyNotCalibrated::Cancelled(cancelled) => cancelled.into(),
                other => other.into(),
            });
        }
    };
    if !args.quiet {
        say(&words::summary(&found))?;
    }
    if let (Some(out), Some(file)) = (&args.out, file) {
        let document = found.document().map_err(|why| {
            let help = match why {
                Unusable::NoErrors => "; give --line-rate",
                _ => "",
            };
            anyhow::anyhow!("{} was not written: {why}{help}", out.display())
        })?;
        file.write(document.to_toml(TITLE)?.into_bytes())?;
        if !args.quiet {
            say(&format!(
                "\nWritten to {0}; for moiregauge analyze --calibration {0}\n",
                out.display()
            ))?;
        }
    }
    Ok(if failed.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The error with the options that help against it.
fn with_hint(lost: NotMeasured) -> FailedInput {
    let seen = lost.shows_none();
    let mut error = with_advice(lost.error);
    if seen {
        error =
            error.context("the known lattice was not found (another --channel may show it better)");
    }
    FailedInput {
        file: in_words(&lost.file),
        error: format!("{error:#}"),
    }
}

impl CalibrateArgs {
    fn request(&self) -> anyhow::Result<CalibrateRequest> {
        let lattice = self.known_lattice()?;
        lattice.cell().context(
            "the vectors of the known lattice are parallel; expected two different directions",
        )?;
        let defaults = Settings::default();
        Ok(CalibrateRequest {
            lattice,
            drift_sigma_nm_per_min: self.drift_sigma,
            settings: Settings {
                channel: self.channel.clone(),
                image: self.image,
                line: self.line.map_or(defaults.line, Into::into),
                background: self.background.map_or(defaults.background, Into::into),
                ..defaults
            },
        })
    }

    fn known_lattice(&self) -> anyhow::Result<KnownLattice> {
        let own = self.lattice_sigma.unwrap_or(0.1);
        let mut lattice = match (self.lattice, self.lattice_constant, &self.material) {
            (Some(cell), _, _) => KnownLattice {
                name: format!("{} × {} nm, {}°", cell.a_nm, cell.b_nm, cell.angle_deg),
                a_nm: cell.a_nm,
                b_nm: cell.b_nm,
                angle_deg: cell.angle_deg,
                sigma_percent: own,
                source: "given by the user".to_owned(),
            },
            (_, Some(a), _) => {
                KnownLattice::hexagonal(&format!("hexagonal, {a} nm"), a, own, "given by the user")
            }
            (_, _, Some(name)) => named(name, &config::own_materials(self.materials.as_deref())?)?,
            _ => bail!("give --material, --lattice or --lattice-constant"),
        };
        if let Some(sigma) = self.lattice_sigma {
            lattice.sigma_percent = sigma;
        }
        Ok(lattice)
    }
}

/// A surface or a layer by its name, one of the user's `own` layers first.
fn named(name: &str, own: &[Material]) -> anyhow::Result<KnownLattice> {
    if let Some(known) = known_lattice(name, own) {
        return Ok(known);
    }
    let surfaces = KnownLattice::all().into_iter().map(|k| k.name);
    let layers = own.iter().cloned().chain(Material::all()).map(|m| m.name);
    let all: Vec<String> = surfaces.chain(layers).collect();
    bail!(
        "unknown lattice {name:?}; known are {}; any other: --lattice A,B,ANGLE, --lattice-constant A or a layer \
         of your own (--materials)",
        all.join(", ")
    )
}

/// A length with its unit; a bare number is nm.
fn parse_length(text: &str) -> Result<f64, String> {
    let with_unit = spmfile::length_nm(text);
    let length = with_unit.or_else(|| text.trim().parse().ok());
    numbers::within([0.01, 1e6], length).ok_or_else(|| {
        "expected a length with a unit, as in 0.246nm, from 0.01 nm to 1 mm".to_owned()
    })
}

fn parse_lattice(text: &str) -> Result<Cell, String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let expected = "expected two lengths and an angle in degrees, as in 0.5nm,0.62nm,103";
    let [a, b, angle] = parts.as_slice() else {
        return Err(expected.to_owned());
    };
    let angle_deg: f64 = angle
        .trim_end_matches('°')
        .parse()
        .map_err(|_| expected.to_owned())?;
    if !(angle_deg > 5.0 && angle_deg < 175.0) {
        return Err(format!(
            "expected an angle between 5° and 175°, found {angle_deg}°"
        ));
    }
    Ok(Cell {
        a_nm: parse_length(a)?,
        b_nm: parse_length(b)?,
        angle_deg,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lattices_are_typed_with_units() {
        let cell = parse_lattice("5 Å, 0.62nm,103°").unwrap();
        assert!((cell.a_nm - 0.5).abs() < 1e-12);
        assert_eq!((cell.b_nm, cell.angle_deg), (0.62, 103.0));
        assert_eq!(parse_length("0.246"), Ok(0.246));
        for wrong in ["0.5nm,0.6nm", "0.5nm,0.6V,90", "0.5nm,0.6nm,0", "a,b,c"] {
            assert!(parse_lattice(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn unknown_surfaces_are_refused_with_what_is_known() {
        let error = named("cheese", &[]).unwrap_err().to_string();
        assert!(
            error.contains("graphite") && error.contains("MoS2"),
            "{error}"
        );
    }
}
