//! What a job tells of its progress: for progress bars, streams of a page, callbacks.

use serde::Serialize;

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
