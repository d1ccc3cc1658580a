//! The loop: look, tell, wait.

use std::io::{ErrorKind, Write as _};
use std::process::ExitCode;
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use moiregauge_pipeline::watch::{Line, Watch, WatchError};
use moiregauge_pipeline::{Cancel, Job};
use moiregauge_serve::{Feed, Options};

use super::args::WatchArgs;
use super::exec::Exec;
use super::keep::Keep;
use super::table::Table;
use crate::config::with_option;
use crate::errors::advice;
use crate::say::say;

/// Between two looks whether the watch is to stop.
const STEP: Duration = Duration::from_millis(50);

/// Watches until it is stopped, or until the wished errors are reached.
pub(crate) fn run(args: &WatchArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let request = args.request()?;
    let watch = Watch::new(request).map_err(|error| match error {
        WatchError::Settings(error) => with_option(error),
        other => other.into(),
    })?;
    let mut watch = watch.with_advice(advice);
    let mut keep = match args.keep() {
        Some(path) => Some(Keep::open(path, &mut watch)?),
        None => None,
    };
    let exec = args
        .exec()
        .map(|(command, limit)| Exec::new(command, limit));
    if args.analyze.is_loud() {
        eprintln!("watching {}; Ctrl-C ends", watch.request().folder.display());
    }
    let page = args.page(&watch.request().folder);
    let page = page.map(|(options, feed)| Page::open(options, feed, args.analyze.json()));
    let page = page.transpose()?;
    let mut shown = Shown::new(args);
    let ended = watched(&mut watch, job, args.poll(), |watch, lines| {
        for line in lines {
            let json = serde_json::to_string(line)?;
            if let Some(exec) = &exec {
                exec.give(&json);
            }
            if let Some(page) = &page {
                page.feed.tell(line);
            }
            shown.show(line, &json)?;
        }
        if let Some(Err(why)) = keep.as_mut().map(|keep| keep.save(watch)) {
            eprintln!("--keep: {why:#}");
        }
        Ok(())
    });
    if let Some(exec) = exec {
        exec.end(job.check().is_err());
    }
    // Whoever read the lines may have seen enough.
    match ended {
        Err(error) if is_closed(&error) => Ok(ExitCode::SUCCESS),
        other => other.map(|()| ExitCode::SUCCESS),
    }
}

/// The page beside the watch; it ends with it.
struct Page {
    feed: Feed,
    cancel: Cancel,
    server: Option<JoinHandle<()>>,
}

impl Page {
    /// Starts the server, and prints its address: on standard error where standard output is for programs.
    fn open(options: Options, feed: Feed, json: bool) -> anyhow::Result<Self> {
        let (cancel, (told, hears)) = (Cancel::new(), channel());
        let stop = cancel.clone();
        let server = std::thread::spawn(move || {
            let mut ready = |address: &str| drop(told.send(Ok(address.to_owned())));
            let ended = moiregauge_serve::serve(&options, &stop, &mut ready);
            if let Err(error) = ended {
                drop(told.send(Err(error)));
            }
        });
        let address = hears.recv().context("the page cannot be started")??;
        if json {
            eprintln!("{address}");
        } else {
            say(&format!("{address}\n"))?;
        }
        Ok(Self {
            feed,
            cancel,
            server: Some(server),
        })
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.cancel.cancel();
        let _ = self.server.take().map(JoinHandle::join);
    }
}

fn watched(
    watch: &mut Watch,
    job: &Job,
    poll: Duration,
    mut tell: impl FnMut(&Watch, &[Line]) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    loop {
        let begun = Instant::now();
        let Ok(lines) = watch.look(job) else {
            return Ok(());
        };
        if !lines.is_empty() {
            tell(watch, &lines)?;
        }
        if watch.is_reached() {
            return Ok(());
        }
        while begun.elapsed() < poll {
            if job.check().is_err() {
                return Ok(());
            }
            std::thread::sleep(STEP.min(poll.saturating_sub(begun.elapsed())));
        }
    }
}

fn is_closed(error: &anyhow::Error) -> bool {
    let error = error.downcast_ref::<std::io::Error>();
    error.is_some_and(|error| error.kind() == ErrorKind::BrokenPipe)
}

/// Where lines go.
struct Shown {
    json: bool,
    quiet: bool,
    table: Table,
}

impl Shown {
    fn new(args: &WatchArgs) -> Self {
        Self {
            json: args.analyze.json(),
            quiet: !args.analyze.is_loud(),
            table: Table::default(),
        }
    }

    fn show(&mut self, line: &Line, json: &str) -> std::io::Result<()> {
        let text = match (self.json, self.quiet) {
            (true, _) => format!("{json}\n"),
            (false, false) => self.table.row(line),
            (false, true) => return Ok(()),
        };
        let mut out = std::io::stdout().lock();
        out.write_all(text.as_bytes())?;
        out.flush()
    }
}
