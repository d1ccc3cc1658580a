//! The `moiregauge` program: a table of contents.

mod analyze;
mod calibrate;
mod config;
mod convert;
mod demo;
mod info;
mod input;
mod map;
mod moire;
mod outputs;
mod plan;
mod say;
mod scanner;
mod simulate;
mod validate;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

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
}

/// The command of a command line, its program first, with or without a place for results.
fn command(arguments: impl IntoIterator<Item = String>) -> Result<Command, clap::Error> {
    // Where results go is no part of what was asked.
    let place = ["--out".to_owned(), ".".to_owned()];
    let mut arguments: Vec<String> = arguments.into_iter().collect();
    let after = arguments.len().min(2);
    arguments.splice(after..after, place);
    Ok(Cli::try_parse_from(arguments)?.command)
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
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
    };
    result.unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    })
}
