//! The `moiregauge` program: a table of contents.

mod analyze;
mod calibrate;
mod config;
mod convert;
mod demo;
mod explain;
mod hints;
mod info;
mod input;
mod map;
mod moire;
mod numbers;
mod outputs;
mod paths;
mod plan;
mod progress;
mod reading;
mod say;
mod scanner;
mod simulate;
mod stripes;
mod validate;

use std::process::ExitCode;

use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

/// The strain gauge for moiré superlattices
///
/// Scanning-probe images of stacked two-dimensional crystals in; drift velocity, moiré lattice, twist
/// angle and heterostrain out, each with its uncertainty.
#[derive(Parser)]
#[command(version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Analyze(Box<analyze::AnalyzeArgs>),
    Map(Box<map::MapArgs>),
    Calibrate(Box<calibrate::CalibrateArgs>),
    Convert(Box<convert::ConvertArgs>),
    Moire(Box<moire::MoireArgs>),
    Info(info::InfoArgs),
    Simulate(Box<simulate::SimulateArgs>),
    Demo(demo::DemoArgs),
    Validate(validate::ValidateArgs),
    Plan(Box<plan::PlanArgs>),
    Config(config::ConfigArgs),
    Explain(explain::ExplainArgs),
}

/// The arguments. A negative number is a value everywhere, so that its option is named where it is refused.
fn arguments() -> clap::Command {
    Cli::command().mut_subcommands(|command| command.allow_negative_numbers(true))
}

fn main() -> ExitCode {
    let parsed = Cli::from_arg_matches(&arguments().get_matches()).unwrap_or_else(|e| e.exit());
    run(parsed.command).unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    })
}

fn run(command: Command) -> anyhow::Result<ExitCode> {
    match command {
        Command::Analyze(args) => analyze::run(&args),
        Command::Map(args) => map::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Moire(args) => moire::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Demo(args) => demo::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Config(args) => config::run(&args),
        Command::Explain(args) => explain::run(&args),
    }
}
