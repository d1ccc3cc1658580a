//! The run: wishes and conditions → the best plan, printed and written.

use std::path::PathBuf;
use std::process::ExitCode;

use moiregauge::settings::Settings;
use moiregauge::simulate::Simulation;
use moiregauge_pipeline::Job;
use moiregauge_pipeline::plan::{PlanError, PlanRequest, Wishes};

use super::words;
use crate::conditions::given_conditions;
use crate::numbers;
use crate::say::say;
use crate::scanner::ScannerArgs;

/// Find how many scans, how fast and how large, give the errors you want
///
/// For several frame sizes and line rates the program finds the smallest number of alternating scans that gives the
/// wanted standard errors. It uses the Fisher information of pixel and sensor noise and the covariance of the joint
/// fit; `moiregauge validate` checks the same by simulation. Calibration of the scanner, lattice constant and isotropic
/// strain add errors that more scans do not make smaller. If these alone exceed what you want, the plan says so and
/// names the largest.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge plan --twist-sigma 0.02
  moiregauge plan --twist-sigma 0.001 --strain-sigma 0.005 --like scan.000.spm scan.001.spm
  moiregauge plan --drift-sigma 0.01 --max-size 100 --max-rate 8 --calibration scanner.toml
  moiregauge plan --strain-sigma 0.02 --config mine.toml --out plan.toml
  moiregauge validate --config plan.toml              (simulates the recommended plan)

The wanted errors include calibration and model. If these alone exceed a wanted error, it is reported as out of
reach, and the plan reaches it with the statistical error of the scans alone.")]
pub(crate) struct PlanArgs {
    /// Wanted standard error of the twist, degrees
    #[arg(long, value_name = "DEG", required_unless_present_any = ["strain_sigma", "drift_sigma"], value_parser = numbers::number(numbers::WISH))]
    twist_sigma: Option<f64>,
    /// Wanted standard error of each component of the strain vector, per cent
    #[arg(long, value_name = "PERCENT", value_parser = numbers::number(numbers::WISH))]
    strain_sigma: Option<f64>,
    /// Wanted standard error of each component of the drift, nm/min
    #[arg(long, value_name = "NM/MIN", value_parser = numbers::number(numbers::WISH))]
    drift_sigma: Option<f64>,
    /// Instrument and sample, from a file in the form of `moiregauge simulate --print-config`
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Instrument and sample, from your own scans of one set
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with = "config")]
    like: Vec<PathBuf>,
    /// Largest frame, nm along the longer side [default: twice that of the conditions]
    #[arg(long, value_name = "NM", value_parser = numbers::number(numbers::LENGTH_NM))]
    max_size: Option<f64>,
    /// Largest line rate, Hz [default: twice that of the conditions]
    #[arg(long, value_name = "HZ", value_parser = numbers::number(numbers::LINE_RATE_HZ))]
    max_rate: Option<f64>,
    /// Assume that the noise of a pixel does not depend on the time per pixel. By default its variance is inversely
    /// proportional to this time
    #[arg(long)]
    noise_per_pixel: bool,
    /// Standard uncertainty of the times of frames, s
    #[arg(long, value_name = "S", default_value_t = 0.6, value_parser = numbers::number(numbers::TIME_S))]
    frame_time_sigma: f64,
    #[command(flatten)]
    scanner: ScannerArgs,
    /// Write the recommended plan as conditions for `moiregauge validate` and `simulate`
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace an earlier plan
    #[arg(long, requires = "out")]
    force: bool,
}

/// Searches and prints.
pub(crate) fn run(args: &PlanArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let inputs: Vec<PathBuf> = args.config.iter().chain(&args.like).cloned().collect();
    let file = |out| crate::outputs::file(out, args.force, &inputs);
    let file = args.out.as_deref().map(file).transpose()?;
    let given = given_conditions(args.config.as_deref(), &args.like, job)?;
    let conditions = given.unwrap_or_default();
    let request = PlanRequest {
        wishes: Wishes {
            twist_deg: args.twist_sigma,
            strain_percent: args.strain_sigma,
            drift_nm_per_min: args.drift_sigma,
        },
        settings: args.settings(&conditions)?,
        conditions,
        max_size_nm: args.max_size,
        max_rate_hz: args.max_rate,
        noise_per_pixel: args.noise_per_pixel,
    };
    let found = moiregauge_pipeline::plan(&request, job).map_err(|error| match error {
        PlanError::Cancelled(cancelled) => cancelled.into(),
        PlanError::Settings(error) => crate::config::with_option(error),
        PlanError::NoFrame => anyhow::anyhow!(
            "no frame within --max-size and --max-rate shows the lattice. Needed are at least four periods across the \
             frame, five pixels per period, and a signal above the noise"
        ),
        other => other.into(),
    })?;
    say(&words::plan(&found))?;
    if let (Some(out), Some(file)) = (&args.out, file) {
        file.write(toml::to_string_pretty(&found.plans[0].set)?.into_bytes())?;
        say(&format!(
            "\nWritten to {0}; moiregauge validate --config {0} simulates it\n",
            out.display()
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

impl PlanArgs {
    /// What is known of scanner and layers.
    fn settings(&self, conditions: &Simulation) -> anyhow::Result<Settings> {
        let mut settings = Settings {
            material: conditions.sample.material.clone(),
            strain_convention: conditions.sample.strain_convention,
            frame_time_sigma_s: self.frame_time_sigma,
            ..Settings::default()
        };
        self.scanner.apply(&mut settings)?;
        crate::config::check(&settings)?;
        Ok(settings)
    }
}
