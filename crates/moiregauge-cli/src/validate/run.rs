//! The run: conditions → many sets, analysed, compared, written.

use std::path::PathBuf;
use std::process::ExitCode;

use moiregauge::simulate::{MOST_PIXELS, Simulation};
use moiregauge_pipeline::Job;
use moiregauge_pipeline::sink::{FolderSink, Target};
use moiregauge_pipeline::validate::{
    SAMPLES_FILE, SamplesRequest, VALIDATION_FILES, ValidateError, ValidateRequest,
    validate_samples,
};

use super::words;
use crate::analyze::MethodArg;
use crate::conditions::given_conditions;
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
  moiregauge simulate --print-config > mine.toml     (then edit size, rate, noise …)
  moiregauge validate --config mine.toml")]
pub(crate) struct ValidateArgs {
    /// Number of simulated sets
    #[arg(long, default_value_t = 200, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    sets: u32,
    /// Estimator of the lattice vectors
    #[arg(long, value_enum, default_value = "lattice")]
    method: MethodArg,
    /// Conditions, from a file in the form of `moiregauge simulate --print-config`
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Conditions, from your own scans of one set (size, rate, contrast, noise, drift, lattice)
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with = "config")]
    like: Vec<PathBuf>,
    /// Simulate real samples instead, as in `moiregauge simulate --sample CLASS --vary`, and count how many are
    /// answered, refused and wrong; all: one of each class; may be repeated
    #[arg(long, value_name = "CLASS[:KEY=VALUE,…]", conflicts_with = "like")]
    sample: Vec<String>,
    /// Side of the frames, pixels, if no file gives it; small frames are faster
    #[arg(long, default_value_t = 128, value_name = "N", value_parser = numbers::count(2, MOST_PIXELS))]
    pixels: usize,
    /// Scans per set, if no file gives it
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
    let sink = sink(args, &VALIDATION_FILES)?;
    let request = ValidateRequest {
        conditions: conditions(args, job)?,
        method: args.method.into(),
        sets: args.sets,
        seed: args.seed,
    };
    let found = moiregauge_pipeline::validate(&request, job).map_err(stopped)?;
    say(&words::table(&found))?;
    if let (Some(out), Some(sink)) = (&args.out, sink) {
        found.write(&sink)?;
        outputs::commit(sink)?;
        say(&format!("Written to {}\n", out.join("pulls.png").display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The table of real samples.
fn run_samples(args: &ValidateArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let sink = sink(args, &[SAMPLES_FILE])?;
    let request = SamplesRequest {
        samples: args.sample.clone(),
        conditions: conditions(args, job)?,
        method: args.method.into(),
        sets: args.sets,
        seed: args.seed,
    };
    let found = validate_samples(&request, job).map_err(stopped)?;
    say(&words::samples(&found.samples))?;
    if let (Some(out), Some(sink)) = (&args.out, sink) {
        found.write(&sink)?;
        outputs::commit(sink)?;
        say(&format!(
            "Written to {}\n",
            out.join(SAMPLES_FILE).display()
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The folder, if one is wanted.
fn sink(args: &ValidateArgs, names: &[&str]) -> anyhow::Result<Option<FolderSink>> {
    let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    let folder = |out| {
        outputs::folder(&Target {
            folder: out,
            kind: "validate",
            names: &names,
            inputs: &args.like,
            force: args.force,
        })
    };
    args.out.as_deref().map(folder).transpose()
}

fn stopped(error: ValidateError) -> anyhow::Error {
    match error {
        ValidateError::Cancelled(cancelled) => cancelled.into(),
        other => other.into(),
    }
}

fn conditions(args: &ValidateArgs, job: &Job) -> anyhow::Result<Simulation> {
    if let Some(given) = given_conditions(args.config.as_deref(), &args.like, job)? {
        return Ok(given);
    }
    let mut conditions = Simulation::default();
    conditions.raster.pixels = [args.pixels; 2];
    conditions.raster.scans = args.scans;
    Ok(conditions)
}
