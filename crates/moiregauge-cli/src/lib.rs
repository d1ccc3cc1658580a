//! The `moiregauge` program: a table of contents. A library, since the Python package runs the same program.

mod analyze;
mod calibrate;
mod campaign;
mod conditions;
mod config;
mod convert;
mod demo;
mod errors;
mod explain;
mod hints;
mod info;
mod input;
mod interrupt;
mod map;
mod merge;
mod moire;
mod nearest;
mod numbers;
mod outputs;
mod paths;
mod places;
mod plan;
mod progress;
mod say;
mod scanner;
mod screen;
mod serve;
mod shells;
mod simulate;
mod stripes;
mod typed;
mod validate;
mod watch;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use moiregauge_pipeline::Job;

use progress::Bars;

/// The strain gauge for moiré superlattices
///
/// Scanning-probe images of stacked two-dimensional crystals in; drift velocity, moiré lattice, twist
/// angle and heterostrain out, each with its uncertainty.
#[derive(Parser)]
#[command(name = "moiregauge", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Analyze(Box<analyze::AnalyzeCommand>),
    Map(Box<map::MapArgs>),
    Watch(Box<watch::WatchArgs>),
    Campaign(Box<campaign::CampaignArgs>),
    Merge(merge::MergeArgs),
    Calibrate(Box<calibrate::CalibrateArgs>),
    Convert(Box<convert::ConvertArgs>),
    Moire(Box<moire::MoireArgs>),
    Info(info::InfoArgs),
    Simulate(Box<simulate::SimulateArgs>),
    Demo(demo::DemoArgs),
    Validate(validate::ValidateArgs),
    Plan(Box<plan::PlanArgs>),
    Serve(serve::ServeArgs),
    Config(config::ConfigArgs),
    Explain(explain::ExplainArgs),
    Completions(shells::CompletionsArgs),
    Man(shells::ManArgs),
}

/// The arguments. A negative number is a value everywhere, so that its option is named where it is refused.
fn arguments() -> clap::Command {
    let commands = Cli::command()
        .mut_subcommands(|command| screen::short(command.allow_negative_numbers(true)));
    screen::grouped(commands)
}

/// The program, once in a process: runs the command of these arguments, the name of the program first. It ends the
/// process where the arguments are wrong, and listens to Ctrl-C.
pub fn program(typed: Vec<OsString>) -> ExitCode {
    let matches = arguments().get_matches_from(typed::keep(typed));
    let parsed = Cli::from_arg_matches(&matches).unwrap_or_else(|e| e.exit());
    let command = parsed.command;
    let bars = Bars::new(command.is_loud());
    interrupt::stoppable(command.threads(), &bars, |job| run(&command, job)).unwrap_or_else(
        |error| {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        },
    )
}

impl Command {
    /// How many threads are wanted; `None`: as many as there are processors.
    fn threads(&self) -> Option<usize> {
        match self {
            Self::Analyze(args) => args.args().threads,
            Self::Map(args) => args.threads(),
            Self::Watch(args) => args.analyze.threads,
            Self::Campaign(args) => args.analyze.threads,
            _ => None,
        }
    }

    /// Whether progress is shown.
    fn is_loud(&self) -> bool {
        match self {
            Self::Analyze(args) => args.args().is_loud(),
            Self::Map(args) => args.is_loud(),
            Self::Watch(args) => args.analyze.is_loud(),
            Self::Campaign(args) => args.analyze.is_loud(),
            Self::Merge(args) => !args.quiet,
            Self::Calibrate(args) => !args.quiet,
            Self::Convert(args) => !args.quiet,
            Self::Validate(args) => !args.quiet,
            _ => true,
        }
    }
}

fn run(command: &Command, job: &Job) -> anyhow::Result<ExitCode> {
    match command {
        Command::Analyze(args) => analyze::run(&args.args(), job),
        Command::Map(args) => map::run(args, job),
        Command::Watch(args) => watch::run(args, job),
        Command::Campaign(args) => campaign::run(args, job),
        Command::Merge(args) => merge::run(args, job),
        Command::Calibrate(args) => calibrate::run(args, job),
        Command::Convert(args) => convert::run(args, job),
        Command::Moire(args) => moire::run(args),
        Command::Info(args) => info::run(args),
        Command::Simulate(args) => simulate::run(args, job),
        Command::Demo(args) => demo::run(args, job),
        Command::Validate(args) => validate::run(args, job),
        Command::Plan(args) => plan::run(args, job),
        Command::Serve(args) => serve::run(args, job),
        Command::Config(args) => config::run(args),
        Command::Explain(args) => explain::run(args),
        Command::Completions(args) => shells::completions(args, arguments()),
        Command::Man(args) => shells::man(args, arguments()),
    }
}
