//! `moiregauge validate`: are the errors true? Many simulated sets, analysed and compared.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use moiregauge::series::{analyse, measure_scan};
use moiregauge::settings::{Method, Settings};
use moiregauge::simulate::{Simulation, Simulator};
use rayon::prelude::*;

use crate::analyze::MethodArg;
use crate::say::say;

/// Simulate many sets, analyse them, and report bias, scatter and coverage of the errors
///
/// Each set has noise and a lattice orientation of its own. The table shows, for drift, twist and both
/// components of the strain vector: the mean error, the root-mean-square error beside the mean of the
/// stated σ, and how often the truth lies within 1 σ and 2 σ (68.3 % and 95.4 % for true errors).
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge validate
  moiregauge validate --method lattice --sets 1000
  moiregauge simulate --print-config > mine.toml     (put in your size, rate, noise …)
  moiregauge validate --config mine.toml")]
pub(crate) struct ValidateArgs {
    /// Number of simulated sets
    #[arg(long, default_value_t = 200, value_name = "N")]
    sets: u32,
    /// Estimator of the lattice vectors
    #[arg(long, value_enum, default_value = "autocorrelation")]
    method: MethodArg,
    /// Conditions: a file as `moiregauge simulate --print-config` prints it
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Side of the frames, pixels, where no file gives it; small frames are quick
    #[arg(long, default_value_t = 128, value_name = "N")]
    pixels: usize,
    /// Scans per set, where no file gives it
    #[arg(long, default_value_t = 4, value_name = "N")]
    scans: usize,
    /// Seed of all noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// No progress bar
    #[arg(long, short)]
    quiet: bool,
}

/// What is compared, with its unit.
const QUANTITIES: [&str; 5] = [
    "drift x (nm/min)",
    "drift y (nm/min)",
    "twist (°)",
    "strain E₁ (%)",
    "strain E₂ (%)",
];

/// Error (found − true) and stated σ of each quantity, in its unit.
type Comparison = [(f64, f64); 5];

/// Runs the validation.
pub(crate) fn run(args: &ValidateArgs) -> anyhow::Result<ExitCode> {
    anyhow::ensure!(args.sets >= 2, "--sets must be at least 2");
    let conditions = conditions(args)?;
    Simulator::new(conditions.clone()).context("these conditions cannot be simulated")?;
    let progress = progress(u64::from(args.sets), args.quiet);
    let method = Method::from(args.method);
    let compared: Vec<Option<Comparison>> = (0..args.sets)
        .into_par_iter()
        .map(|index| {
            let result = compare(&conditions, method, args.seed, index);
            progress.inc(1);
            result
        })
        .collect();
    progress.finish_and_clear();
    let failed = compared.iter().filter(|c| c.is_none()).count();
    let compared: Vec<Comparison> = compared.into_iter().flatten().collect();
    anyhow::ensure!(
        compared.len() >= 2,
        "{failed} of {} sets gave no drift and twist: nothing to compare",
        args.sets
    );
    say(&table(&compared))?;
    if failed > 0 {
        say(&format!(
            "\n{failed} of {} sets gave no drift or no lattice\n",
            args.sets
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn conditions(args: &ValidateArgs) -> anyhow::Result<Simulation> {
    if let Some(path) = &args.config {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read the settings file {}", path.display()))?;
        return toml::from_str(&text)
            .with_context(|| format!("in the settings file {}", path.display()));
    }
    let mut conditions = Simulation::default();
    conditions.raster.pixels = [args.pixels; 2];
    conditions.raster.scans = args.scans;
    Ok(conditions)
}

fn progress(sets: u64, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(sets);
    match ProgressStyle::with_template("validating {bar:30} {pos}/{len} sets, {eta} left") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// One set with noise and orientation of its own; `None` where nothing could be determined.
fn compare(conditions: &Simulation, method: Method, seed: u64, index: u32) -> Option<Comparison> {
    let mut simulation = conditions.clone();
    simulation.seed = seed.wrapping_mul(1_000_003).wrapping_add(u64::from(index));
    // The golden angle spreads any number of orientations evenly.
    simulation.sample.lattice_angle_deg += 137.507_764 * f64::from(index);
    let settings = Settings {
        method,
        material: simulation.sample.material.clone(),
        strain_convention: simulation.sample.strain_convention,
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    };
    let simulator = Simulator::new(simulation).ok()?;
    let measured = (0..simulator.frames())
        .filter_map(|i| {
            let name = Simulator::file_name(i);
            measure_scan(&name, &simulator.frame(i), &settings, None).ok()
        })
        .collect();
    let analysis = analyse(measured, &settings);
    let set = analysis.sets.first()?;
    let (drift, found) = (set.drift.as_ref()?, &set.mean.as_ref()?.twist_strain);
    let truth = simulator.truth();
    let sample = &simulator.settings().sample;
    let axis = 2.0 * truth.strain_axis_lab_deg.to_radians();
    let strain = [
        sample.strain_percent * axis.cos(),
        sample.strain_percent * axis.sin(),
    ];
    let drift_of = |i: usize| {
        let error = 60.0 * drift.velocity[i] - truth.mean_drift_nm_per_min[i];
        (error, 60.0 * drift.covariance[(i, i)].sqrt())
    };
    let strain_of = |i: usize| {
        let error = 100.0 * found.strain_vector[i] - strain[i];
        (error, 100.0 * found.strain_covariance()[(i, i)].sqrt())
    };
    let twist = found.twist().scaled(1f64.to_degrees());
    Some([
        drift_of(0),
        drift_of(1),
        (twist.value - sample.twist_deg, twist.sigma),
        strain_of(0),
        strain_of(1),
    ])
}

/// The table, one line for each quantity.
fn table(compared: &[Comparison]) -> String {
    use std::fmt::Write as _;
    let n = compared.len() as f64;
    let mut text = format!(
        "{} sets\n{:18} {:>11} {:>11} {:>11} {:>9} {:>9} {:>9}\n",
        compared.len(),
        "",
        "mean error",
        "rms error",
        "mean σ",
        "pull rms",
        "in 1 σ %",
        "in 2 σ %"
    );
    for (i, name) in QUANTITIES.iter().enumerate() {
        let all: Vec<(f64, f64)> = compared.iter().map(|c| c[i]).collect();
        let mean =
            |f: &dyn Fn(f64, f64) -> f64| all.iter().map(|(e, s)| f(*e, *s)).sum::<f64>() / n;
        let within = |k: f64| 100.0 * mean(&|e, s| f64::from(u8::from(e.abs() <= k * s)));
        let _ = writeln!(
            text,
            "{name:18} {:11.6} {:11.6} {:11.6} {:9.2} {:9.1} {:9.1}",
            mean(&|e, _| e),
            mean(&|e, _| e * e).sqrt(),
            mean(&|_, s| s),
            mean(&|e, s| (e / s).powi(2)).sqrt(),
            within(1.0),
            within(2.0)
        );
    }
    // Binomial scatter of a coverage of 68.3 and 95.4 %.
    let scatter = |p: f64| 100.0 * (p * (1.0 - p) / n).sqrt();
    let _ = writeln!(
        text,
        "true errors would give {:.1} ± {:.1} % and {:.1} ± {:.1} %",
        68.3,
        scatter(0.683),
        95.4,
        scatter(0.954)
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of exactly ±σ lie within 1 σ, those of 1.5 σ do not; the mean and rms are those of
    /// the numbers put in.
    #[test]
    fn the_table_counts_coverage() {
        let compared = vec![[(0.5, 0.5); 5], [(-1.5, 1.0); 5]];
        let text = table(&compared);
        let line = text.lines().find(|l| l.starts_with("twist")).unwrap();
        let numbers: Vec<f64> = line
            .split_whitespace()
            .filter_map(|w| w.parse().ok())
            .collect();
        assert_eq!(numbers[0], -0.5);
        assert!((numbers[1] - 1.25f64.sqrt()).abs() < 1e-5);
        assert_eq!(numbers[2], 0.75);
        assert_eq!(&numbers[4..], [50.0, 100.0]);
    }
}
