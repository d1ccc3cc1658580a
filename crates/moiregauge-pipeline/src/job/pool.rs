//! Threads, a cancel and events together.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use moiregauge::numbers::interrupt::{self, Interrupted};

use super::cancel::{Cancel, Cancelled};
use super::events::{Event, Events, Quiet};
use super::threads::Threads;

/// Threads that cannot be made.
#[derive(Debug, thiserror::Error)]
#[error("cannot make {} threads: {source}", threads.map_or("any".to_owned(), |n| n.to_string()))]
pub struct JobError {
    threads: Option<usize>,
    source: rayon::ThreadPoolBuildError,
}

/// What every long call takes.
///
/// Its threads are its own: no other pool of the process is used or changed, and results do not depend on their number.
pub struct Job<'a> {
    pool: Threads,
    cancel: Cancel,
    events: &'a dyn Events,
}

impl<'a> Job<'a> {
    /// A job of a number of threads; `None`: as many as there are processors.
    ///
    /// # Errors
    /// The system gives no threads.
    pub fn new(
        threads: Option<usize>,
        cancel: Cancel,
        events: &'a dyn Events,
    ) -> Result<Self, JobError> {
        let pool = Threads::new(threads, cancel.flag());
        Ok(Self {
            pool: pool.map_err(|source| JobError { threads, source })?,
            cancel,
            events,
        })
    }

    /// A job that nobody watches and nobody stops.
    ///
    /// # Errors
    /// As [`Job::new`].
    pub fn quiet(threads: Option<usize>) -> Result<Self, JobError> {
        Self::new(threads, Cancel::new(), &Quiet)
    }

    /// The same threads and the same cancel, and nobody to tell.
    #[must_use]
    pub fn silent(&self) -> Job<'static> {
        Job {
            pool: self.pool.clone(),
            cancel: self.cancel.clone(),
            events: &Quiet,
        }
    }

    /// Does work on the threads of the job, and comes back when it is done or stopped.
    ///
    /// # Errors
    /// [`Cancelled`].
    ///
    /// # Panics
    /// If the work does.
    pub fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, Cancelled> {
        let checked = || {
            interrupt::check();
            work()
        };
        // What was under way is dropped with the unwinding; callers see nothing of it but what they lock.
        let done = catch_unwind(AssertUnwindSafe(|| self.pool.install(checked)));
        done.map_err(|cause| {
            if cause.is::<Interrupted>() {
                return Cancelled;
            }
            resume_unwind(cause)
        })
    }

    /// An error if the job is to stop.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.cancel.is_cancelled() {
            return Err(Cancelled);
        }
        Ok(())
    }

    /// What stops the job.
    pub fn cancel(&self) -> &Cancel {
        &self.cancel
    }

    /// Tells those who listen.
    pub fn tell(&self, event: &Event<'_>) {
        self.events.tell(event);
    }

    /// Begins a stage of `count` steps, as in `measuring`, `scans`.
    pub fn stage(&self, doing: &str, things: &str, count: usize) -> Stage<'_> {
        Stage::new(self, doing, things, count)
    }
}

/// A stage under way; over when it is dropped, however that comes.
pub struct Stage<'a> {
    job: &'a Job<'a>,
}

impl<'a> Stage<'a> {
    fn new(job: &'a Job<'a>, doing: &str, things: &str, count: usize) -> Self {
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

impl std::fmt::Debug for Job<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Job")
            .field("threads", &self.pool.count())
            .field("cancel", &self.cancel)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use rayon::prelude::*;

    use super::*;

    #[test]
    fn work_ends_with_its_value_or_with_the_cancel() {
        let cancel = Cancel::new();
        let job = Job::new(Some(3), cancel.clone(), &Quiet).unwrap();
        let sum = || (0..1000_u64).into_par_iter().sum::<u64>();
        assert_eq!(job.run(sum), Ok(499_500));
        let endless = || {
            (0..100_u64).into_par_iter().for_each(|n| {
                if n == 50 {
                    cancel.cancel();
                }
                if n >= 50 {
                    loop {
                        interrupt::check();
                    }
                }
            });
        };
        assert_eq!(job.run(endless), Err(Cancelled));
        assert_eq!(job.run(sum), Err(Cancelled));
        assert_eq!(job.check(), Err(Cancelled));
        // Other threads of the process go on.
        interrupt::check();
        assert_eq!(Job::quiet(Some(1)).unwrap().run(sum), Ok(499_500));
    }

    #[test]
    fn a_panic_stays_a_panic() {
        let job = Job::quiet(Some(1)).unwrap();
        let work = AssertUnwindSafe(|| job.run(|| resume_unwind(Box::new("words"))));
        let cause = catch_unwind(work).map(|r: Result<(), _>| r).unwrap_err();
        assert_eq!(cause.downcast_ref(), Some(&"words"));
    }

    #[test]
    fn events_are_lines_of_json_and_stages_end() {
        struct Lines(Mutex<Vec<String>>);
        impl Events for Lines {
            fn tell(&self, event: &Event<'_>) {
                let line = serde_json::to_string(event).unwrap();
                self.0.lock().unwrap().push(line);
            }
        }
        let lines = Lines(Mutex::default());
        let job = Job::new(Some(1), Cancel::new(), &lines).unwrap();
        job.stage("measuring", "scans", 2).step();
        let lines = lines.0.into_inner().unwrap();
        assert_eq!(
            lines[0],
            r#"{"event":"stage","doing":"measuring","things":"scans","count":2}"#
        );
        assert_eq!(lines[1..], [r#"{"event":"step"}"#, r#"{"event":"ended"}"#]);
    }
}
