//! The run: conditions → many sets, analysed, compared, written.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use moiregauge::numbers::interrupt;
use moiregauge::simulate::{MOST_PIXELS, Simulation, Simulator};
use moiregauge::spectrum::Method;
use moiregauge_pipeline::Job;
use moiregauge_pipeline::sink::Target;
use rayon::prelude::*;

use super::compare::{Comparison, compare};
use super::conditions::given_conditions;
use super::output::{self, Validation};
use super::samples::{self, Tally};
use crate::analyze::MethodArg;
use crate::numbers;
use crate::outputs;
use crate::say::say;

/// Simulate many sets, analyse them, and report bias, efficiency and coverage of the errors
///
/// Each set has noise and a lattice orientation of its own. The table shows, for drift, twist and both
/// components of the strain vector: the mean error, the root-mean-square error beside the mean of the
/// stated σ and the Cramér–Rao bound, and how often the truth lies within the 68.3 % and 95.4 % intervals
/// (1 σ and 2 σ). The bound is that of white pixel noise alone.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge validate
  moiregauge validate --like scans/*.spm --sets 500 --out validation
  moiregauge validate --method autocorrelation --sets 1000
  moiregauge validate --sample edge --sample hole:share=0.3 --sets 50
  moiregauge validate --sample all --sets 20 --pixels 192
  moiregauge simulate --print-config > mine.toml     (put in your size, rate, noise …)
  moiregauge validate --config mine.toml")]
pub(crate) struct ValidateArgs {
    /// Number of simulated sets
    #[arg(long, default_value_t = 200, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    sets: u32,
    /// Estimator of the lattice vectors
    #[arg(long, value_enum, default_value = "lattice")]
    method: MethodArg,
    /// Conditions: a file as `moiregauge simulate --print-config` prints it
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Conditions: those of your own scans of one set (size, rate, contrast, noise, drift, lattice)
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with = "config")]
    like: Vec<PathBuf>,
    /// In place of the table, sets of real samples, as in `moiregauge simulate --sample CLASS --vary`: how many are
    /// answered, refused, wrong; all for one of each class; may be repeated
    #[arg(long, value_name = "CLASS[:KEY=VALUE,…]", conflicts_with = "like")]
    sample: Vec<String>,
    /// Side of the frames, pixels, where no file gives it; small frames are quick
    #[arg(long, default_value_t = 128, value_name = "N", value_parser = numbers::count(2, MOST_PIXELS))]
    pixels: usize,
    /// Scans per set, where no file gives it
    #[arg(long, default_value_t = 4, value_name = "N", value_parser = numbers::count(1, 9999))]
    scans: usize,
    /// Seed of all noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for validation.json, sets.csv, the conditions and the figure of pulls
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write into a folder that already holds a validation
    #[arg(long, requires = "out")]
    force: bool,
    /// No progress bar
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Runs the validation.
pub(crate) fn run(args: &ValidateArgs, job: &Job) -> anyhow::Result<ExitCode> {
    if !args.sample.is_empty() {
        return run_samples(args, job);
    }
    let names = output::NAMES.map(str::to_owned);
    let folder = |out| {
        outputs::folder(&Target {
            folder: out,
            kind: "validate",
            names: &names,
            inputs: &args.like,
            force: args.force,
        })
    };
    let sink = args.out.as_deref().map(folder).transpose()?;
    let conditions = conditions(args)?;
    Simulator::new(conditions.clone()).context("these conditions cannot be simulated")?;
    let stage = job.stage("validating", "sets", args.sets as usize);
    let method = Method::from(args.method);
    let compared: Vec<Option<Comparison>> = (0..args.sets)
        .into_par_iter()
        .map(|index| {
            interrupt::check();
            let result = compare(&conditions, method, args.seed, index);
            stage.step();
            result
        })
        .collect();
    drop(stage);
    let failed = compared.iter().filter(|c| c.is_none()).count();
    let compared: Vec<Comparison> = compared.into_iter().flatten().collect();
    anyhow::ensure!(
        compared.len() >= 2,
        "{failed} of {} sets gave no drift and twist: nothing to compare",
        args.sets
    );
    let validation = Validation::new(method, args.seed, failed, &compared, conditions);
    say(&validation.table())?;
    if let (Some(out), Some(sink)) = (&args.out, sink) {
        outputs::write_all(&sink, "", &validation.files(&compared)?)?;
        outputs::commit(sink)?;
        say(&format!("Written to {}\n", out.join("pulls.png").display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The table of real samples.
fn run_samples(args: &ValidateArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let names = [SAMPLES.to_owned()];
    let folder = |out| {
        outputs::folder(&Target {
            folder: out,
            kind: "validate",
            names: &names,
            inputs: &[],
            force: args.force,
        })
    };
    let sink = args.out.as_deref().map(folder).transpose()?;
    let base = conditions(args)?;
    let given = samples::samples_of(&args.sample)?;
    let count = args.sets as usize;
    let stage = job.stage("validating", "sets", given.len() * count);
    let method = Method::from(args.method);
    let outcomes = (0..given.len() * count).into_par_iter().map(|index| {
        interrupt::check();
        let seed = args.seed + (index % count) as u64;
        let outcome = samples::outcome(&base, &given[index / count], method, seed);
        stage.step();
        outcome
    });
    let outcomes: Vec<samples::Outcome> = outcomes.collect::<anyhow::Result<_>>()?;
    drop(stage);
    let tallies: Vec<Tally> = given
        .iter()
        .zip(outcomes.chunks(count))
        .map(|(sample, outcomes)| Tally {
            sample: sample.clone(),
            outcomes: outcomes.to_vec(),
        })
        .collect();
    say(&samples::table(&tallies))?;
    if let (Some(out), Some(sink)) = (&args.out, sink) {
        sink.write(SAMPLES, samples::rows(&tallies).as_bytes())?;
        outputs::commit(sink)?;
        say(&format!("Written to {}\n", out.join(SAMPLES).display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Every set of real samples.
const SAMPLES: &str = "samples.csv";

fn conditions(args: &ValidateArgs) -> anyhow::Result<Simulation> {
    if let Some(given) = given_conditions(args.config.as_deref(), &args.like)? {
        return Ok(given);
    }
    let mut conditions = Simulation::default();
    conditions.raster.pixels = [args.pixels; 2];
    conditions.raster.scans = args.scans;
    Ok(conditions)
}
