//! `moiregauge merge`: the shares of a campaign → its tables.

use std::path::PathBuf;
use std::process::ExitCode;

use moiregauge_pipeline::Job;
use moiregauge_pipeline::samples::{Merge, merge};

use crate::campaign::{counts, ended, in_words};
use crate::say::say;

/// Join the shares of a campaign into one table and one page
///
/// Reads the folders into which `moiregauge campaign --shard` wrote, and writes what one run over all samples would
/// have written, byte for byte. Refuses shares with different settings or from another version, and names shares that
/// are missing.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge merge /shared/all --out all
  moiregauge merge job-1 job-2 job-3 --out all")]
pub(crate) struct MergeArgs {
    /// Folders of `moiregauge campaign`
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Folder for samples.csv, failed.csv and campaign.html; may be one of the others
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Merge shares of different versions or settings too
    #[arg(long)]
    mixed: bool,
    /// Merge even if shares are missing
    #[arg(long)]
    incomplete: bool,
    /// Print nothing but errors
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Merges the shares.
pub(crate) fn run(args: &MergeArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let allowed = Merge {
        mixed: args.mixed,
        incomplete: args.incomplete,
    };
    let done = merge(&args.folders, &args.out, allowed, job).map_err(in_words)?;
    if !args.quiet {
        let page = args.out.join("campaign.html");
        say(&format!("{}Written to {}\n", counts(&done), page.display()))?;
    }
    Ok(ended(&done))
}
