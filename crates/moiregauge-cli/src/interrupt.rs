//! Ctrl-C: the first one ends the work cleanly, the second one at once.

use std::process::ExitCode;

use anyhow::Context as _;
use moiregauge_pipeline::campaign::{Campaign, Kept};
use moiregauge_pipeline::sink::{FolderSink, Part, build};
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
        eprintln!("stopping; press Ctrl-C again to stop at once");
    };
    ctrlc::set_handler(handler).context("cannot listen to Ctrl-C")?;
    match job.run(|| command(&job)) {
        // With words on what is kept.
        Ok(Err(error)) if error.is::<Cancelled>() && error.chain().len() > 1 => {
            eprintln!("{error:#}");
            Ok(ExitCode::from(INTERRUPTED))
        }
        Ok(Err(error)) if error.is::<Cancelled>() => Ok(stopped()),
        Ok(ended) => ended,
        Err(Cancelled) => Ok(stopped()),
    }
}

/// Says that nothing is left of the run.
fn stopped() -> ExitCode {
    eprintln!("{Cancelled}; every file that was written is complete");
    ExitCode::from(INTERRUPTED)
}

/// The name of what is kept of a run that was stopped: measured scans belong to a build, as bands do.
fn name() -> Option<String> {
    Some(format!("measured-{}.json", &build()?[..16]))
}

/// Takes what a run into the same folder had measured when it was stopped.
pub(crate) fn take(sink: &FolderSink, campaign: &mut Campaign) {
    // The name takes a hash of the program, which takes as long as a small image.
    if !sink.keeps_parts() {
        return;
    }
    let Some(Part::Whole(bytes)) = name().map(|name| sink.kept(&name)) else {
        return;
    };
    // What cannot be understood is measured again.
    if let Ok(kept) = serde_json::from_slice::<Kept>(&bytes) {
        campaign.take(kept);
    }
}

/// Where a run was stopped: keeps what it has measured beside the results that are not there yet, and says so.
pub(crate) fn kept_for_next(
    error: anyhow::Error,
    sink: &FolderSink,
    campaign: &Campaign,
) -> anyhow::Error {
    let measured = campaign.kept().len();
    if !error.is::<Cancelled>() || measured == 0 {
        return error;
    }
    let keep = || -> anyhow::Result<()> {
        let name = name().context("the program cannot read itself")?;
        sink.keep(&name, &serde_json::to_vec(campaign.kept())?)?;
        Ok(())
    };
    match keep() {
        Ok(()) => {
            let scans = if measured == 1 {
                "scan is"
            } else {
                "scans are"
            };
            error.context(format!(
                "{measured} {scans} measured and kept; run the same command again to continue"
            ))
        }
        Err(why) => error.context(format!("the measured scans cannot be kept: {why:#}")),
    }
}
