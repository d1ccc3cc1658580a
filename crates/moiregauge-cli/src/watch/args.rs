//! The options of `moiregauge watch`.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::ensure;
use clap::builder::Resettable;
use moiregauge_pipeline::watch::{Until, WatchRequest};

use moiregauge_serve::{Feed, Options};

use super::duration;
use crate::analyze::AnalyzeArgs;
use crate::errors::advice;

/// Options of an analysis that make or describe results that are written once.
const NOT_HERE: [&str; 15] = [
    "out",
    "replay",
    "data",
    "sets",
    "colormap",
    "survey_image",
    "no_report",
    "no_png",
    "export",
    "parquet",
    "open",
    "force",
    "atomic",
    "atomic_channel",
    "rotate_to_lab",
];

/// Watch a folder while it fills: after each frame, twist, strain and drift with their errors
///
/// Looks into PATH at regular times. Each complete frame is analysed together with all frames before it. One line shows
/// the results so far, what two more frames would give, and errors in the way of scanning. At every moment the numbers
/// are those of `moiregauge analyze PATH`. Files may come late, in pieces and in any order; a file that cannot be read
/// is reported, and the watch goes on. A file that is written again replaces its frame; a file that is deleted removes
/// it. Nothing is written into the folder, and its subfolders are not searched.
///
/// Ctrl-C, SIGTERM or --until end the watch, with exit code 0. When it is started again, it takes the files that are
/// there.
#[derive(clap::Args, Clone, Debug)]
#[command(
    override_usage = "moiregauge watch [OPTIONS] <PATH>",
    mut_args(hidden),
    mut_arg("paths", |path| path.help("The folder into which the microscope saves").long_help(None)
        .required_unless_present(Resettable::Reset).required(true).num_args(1)),
    mut_arg("json", |json| json.help("Print only JSON on standard output: one object on one line for each new result. \
                                      Values that are not known are null").long_help(None)),
    after_long_help = "\
Examples:
  moiregauge watch scans/
  moiregauge watch scans/ --until twist=0.01,strain=0.02
  moiregauge watch scans/ --channel 'TR Amplitude' --layers graphene/hBN --keep ~/watched.json
  moiregauge watch //server/tonight --poll 5s --json >> tonight.jsonl
  moiregauge watch scans/ --exec 'python3 next_frame.py'
  moiregauge watch scans/ --serve

COMMAND gets one line of JSON on its standard input, the same that --json prints. Commands run one after the other beside
the watch, which never waits for them; one that takes longer than --exec-timeout is killed, with all that it started. What
a command prints goes to standard error."
)]
pub(crate) struct WatchArgs {
    /// End when the total standard errors are this small: twist in degrees, strain in per cent, as in twist=0.01 or
    /// twist=0.01,strain=0.02
    #[arg(long, value_name = "NAME=ERROR,…")]
    until: Option<Until>,
    /// Time between two readings of the folder
    #[arg(long, value_name = "TIME", default_value = "2s", value_parser = duration::parse)]
    poll: Duration,
    /// Run this shell command for each new result; it gets the line as JSON on its standard input
    #[arg(long, value_name = "COMMAND")]
    exec: Option<String>,
    /// Kill a command of --exec that takes longer than this
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = duration::parse, requires = "exec")]
    exec_timeout: Duration,
    /// Report a file that cannot be read and has not changed for this long
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = duration::parse)]
    patience: Duration,
    /// Keep the measured scans in this file outside the folder; a watch that is started again with it measures no scan
    /// twice
    #[arg(long, value_name = "FILE")]
    keep: Option<PathBuf>,
    /// Show the watch on a page too, as `moiregauge serve` does
    #[arg(long)]
    serve: bool,
    /// Port of the page [default: one that is free]
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        hide_default_value = true,
        requires = "serve"
    )]
    port: u16,
    /// Do not open a browser; the address of the page is printed
    #[arg(long, requires = "serve")]
    no_browser: bool,
    #[command(flatten)]
    pub(crate) analyze: AnalyzeArgs,
}

/// Leaves options of an analysis out of the help; they are refused with words.
fn hidden(arg: clap::Arg) -> clap::Arg {
    let is_not_here = NOT_HERE.iter().any(|name| arg.get_id() == name);
    if is_not_here {
        arg.hide(true).required_unless_present(Resettable::Reset)
    } else {
        arg
    }
}

impl WatchArgs {
    /// What is to be watched.
    pub(super) fn request(&self) -> anyhow::Result<WatchRequest> {
        let [folder] = self.analyze.paths() else {
            anyhow::bail!(
                "watch takes one folder, found {}",
                self.analyze.paths().len()
            );
        };
        ensure!(folder.is_dir(), "{}: expected a folder", folder.display());
        self.analyze.only_numbers()?;
        let steps = self.patience.as_secs_f64() / self.poll.as_secs_f64();
        Ok(WatchRequest {
            folder: folder.clone(),
            settings: self.analyze.settings()?,
            told: self.analyze.known.user_specified(),
            until: self.until.unwrap_or_default(),
            patience: (steps.ceil() as usize).max(2),
        })
    }

    pub(super) fn poll(&self) -> Duration {
        self.poll
    }

    /// The command for each result, and how long it may take.
    pub(super) fn exec(&self) -> Option<(&str, Duration)> {
        Some((self.exec.as_deref()?, self.exec_timeout))
    }

    /// The page on which the watch is shown, too.
    pub(super) fn page(&self, folder: &std::path::Path) -> Option<(Options, Feed)> {
        let feed = Feed::new(folder.to_owned());
        let options = Options {
            roots: vec![folder.to_owned()],
            port: self.port,
            browser: !self.no_browser,
            feed: Some(feed.clone()),
            advice,
            ..Options::default()
        };
        self.serve.then_some((options, feed))
    }

    pub(super) fn keep(&self) -> Option<&std::path::Path> {
        self.keep.as_deref()
    }
}
