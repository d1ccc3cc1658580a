//! Ctrl-C: the first one ends the work cleanly, the second one at once.

use std::process::ExitCode;

use anyhow::Context as _;
use moiregauge_pipeline::{Cancel, Cancelled, Events, Job};

/// What shells expect of a program that Ctrl-C has ended.
const INTERRUPTED: u8 = 130;

/// Runs a command so that it can be stopped, on threads of its own.
pub(crate) fn stoppable(
    threads: Option<usize>,
    events: &dyn Events,
    command: impl FnOnce(&Job) -> anyhow::Result<ExitCode> + Send,
) -> anyhow::Result<ExitCode> {
    let cancel = Cancel::new();
    let job = Job::new(threads, cancel.clone(), events)?;
    let handler = move || {
        if cancel.is_cancelled() {
            std::process::exit(INTERRUPTED.into());
        }
        cancel.cancel();
        eprintln!("stopping; once more to stop at once");
    };
    ctrlc::set_handler(handler).context("cannot listen to Ctrl-C")?;
    match job.run(|| command(&job)) {
        Ok(Err(error)) if error.is::<Cancelled>() => {
            eprintln!("stopped: {error:#}");
            Ok(ExitCode::from(INTERRUPTED))
        }
        Ok(ended) => ended,
        Err(Cancelled) => {
            eprintln!("stopped: nothing was written but what is complete");
            Ok(ExitCode::from(INTERRUPTED))
        }
    }
}
