//! The run: settings → sets of scans, written.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use moiregauge::simulate::{CLASSES, Simulation};
use moiregauge_pipeline::Job;
use moiregauge_pipeline::simulate::{SimulationError, paper_sets, simulate_sets};

use super::args::SimulateArgs;
use crate::outputs::hinted;

/// Writes the set, or the paper's three.
pub(crate) fn run(args: &SimulateArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let mut out = std::io::stdout().lock();
    if args.print_config {
        write!(out, "{}", toml::to_string(&args.settings()?)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    if args.list_samples {
        write!(out, "{}", list_of_samples())?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(folder) = &args.out else {
        bail!("no output folder: give --out DIR");
    };
    let sets = if args.paper {
        paper_sets(args.seed.unwrap_or(Simulation::default().seed))
    } else {
        vec![args.settings()?]
    };
    for (set, folder) in sets.iter().zip(write_sets(&sets, folder, args.force, job)?) {
        let scans = match set.raster.scans {
            1 => "1 scan".to_owned(),
            n => format!("{n} scans"),
        };
        writeln!(
            out,
            "{}: {scans}, twist {}°, strain {} %, drift ({}, {}) nm/min",
            folder.display(),
            set.sample.twist_deg,
            set.sample.strain_percent,
            set.drift.velocity_nm_per_min[0],
            set.drift.velocity_nm_per_min[1],
        )?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The classes and their numbers, with the usual values.
fn list_of_samples() -> String {
    let mut text = String::from(
        "Classes for --sample, with the usual values of their numbers. Heights and amplitudes are in degrees of phase\n\
         (the moiré has an amplitude of 1°), shares are of the frame, angles counter-clockwise.\n",
    );
    for class in &CLASSES {
        let _ = writeln!(text, "\n{:16} {}", class.name, class.what);
        for key in class.keys {
            let value = format!("{}={}", key.name, key.usual);
            let _ = writeln!(text, "  {value:18} {}", key.what);
        }
    }
    text
}

/// Writes every set into `out/NAME` and returns these folders.
pub(crate) fn write_sets(
    sets: &[Simulation],
    out: &Path,
    force: bool,
    job: &Job,
) -> anyhow::Result<Vec<PathBuf>> {
    simulate_sets(sets, out, force, job).map_err(|error| match error {
        SimulationError::Cancelled(cancelled) => cancelled.into(),
        SimulationError::Sink(error) => hinted(error),
        SimulationError::InTheWay(path) => anyhow::anyhow!(
            "{} is not part of the new set. Remove it or choose another --name",
            path.display()
        ),
        other => other.into(),
    })
}
