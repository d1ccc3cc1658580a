//! What a job tells of its progress: for progress bars, streams of a page, callbacks.

use serde::Serialize;

use super::Job;

/// Somebody whom a job tells how far it is. Calls come from any thread of the job, several at once, and should be short.
pub trait Events: Sync {
    /// Something happened.
    fn tell(&self, event: &Event<'_>);
}

/// What happens in a job. As JSON: one object with the name of the event under `event`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Event<'a> {
    /// A piece of work begins.
    Stage {
        /// What is being done, as in `measuring`.
        doing: &'a str,
        /// What is counted, as in `scans`.
        things: &'a str,
        /// How many there are.
        count: usize,
    },
    /// One of the things of the stage is done.
    Step,
    /// The stage is over, or was stopped.
    Ended,
    /// Something that a user may want to know, in words; no doubt about results.
    Note {
        /// The words.
        words: &'a str,
    },
}

/// Nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet;

impl Events for Quiet {
    fn tell(&self, _: &Event<'_>) {}
}

/// A stage under way; over when it is dropped, however that comes.
pub struct Stage<'a> {
    job: &'a Job<'a>,
}

impl<'a> Stage<'a> {
    pub(super) fn new(job: &'a Job<'a>, doing: &str, things: &str, count: usize) -> Self {
        job.tell(&Event::Stage {
            doing,
            things,
            count,
        });
        Self { job }
    }

    /// One more is done.
    pub fn step(&self) {
        self.job.tell(&Event::Step);
    }
}

impl Drop for Stage<'_> {
    fn drop(&mut self) {
        self.job.tell(&Event::Ended);
    }
}
