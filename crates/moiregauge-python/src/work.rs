//! Where all work is done: on threads of its own, while the interpreter is free and listens to Ctrl-C.
//!
//! Every call makes its threads and ends them: none is left over for a forked child to wait for, and no other pool of the
//! process is used.

use std::panic::AssertUnwindSafe;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use moiregauge_pipeline::{Cancel, Event, Events, Job};
use pyo3::prelude::*;

use crate::errors::{fault, stopped, wrong};

/// How often signals are looked for.
const OFTEN: Duration = Duration::from_millis(50);

/// How far a job is: what it does, how much is done, how much there is.
#[derive(Clone, Debug, Default, PartialEq)]
struct Progress {
    doing: String,
    done: usize,
    count: usize,
}

/// What a job has told. It is asked for by the thread of the interpreter: threads of a job never call Python.
#[derive(Default)]
struct UserSpecified(Mutex<Progress>);

impl UserSpecified {
    fn now(&self) -> Progress {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

impl Events for UserSpecified {
    fn tell(&self, event: &Event<'_>) {
        let mut told = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            Event::Stage { doing, count, .. } => {
                *told = Progress {
                    doing: (*doing).to_owned(),
                    done: 0,
                    count: *count,
                };
            }
            Event::Step => told.done += 1,
            _ => {}
        }
    }
}

/// Does work, and comes back with what came of it.
///
/// # Errors
/// What the work says; `KeyboardInterrupt`; an exception of a signal handler or of `progress`.
pub(crate) fn work<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Py<PyAny>>,
    task: impl FnOnce(&Job) -> PyResult<T> + Send,
) -> PyResult<T> {
    if threads == Some(0) {
        return Err(wrong("threads: expected at least 1, found 0"));
    }
    let (cancel, told) = (Cancel::new(), UserSpecified::default());
    py.detach(|| {
        std::thread::scope(|scope| {
            let (done, waiting) = channel::<()>();
            let (cancel, told) = (&cancel, &told);
            let worker = scope.spawn(move || {
                // Dropped at the end, however that comes.
                let _done = done;
                let job = Job::new(threads, cancel.clone(), told).map_err(wrong)?;
                // Nothing of the task is looked at after a panic.
                let task = AssertUnwindSafe(|| task(&job));
                job.run(|| task.0()).unwrap_or_else(|_| Err(stopped()))
            });
            let mut shown = Progress::default();
            let mut failed = None;
            while let Err(RecvTimeoutError::Timeout) = waiting.recv_timeout(OFTEN) {
                if failed.is_none()
                    && let Err(error) = Python::attach(|py| look(py, progress, told, &mut shown))
                {
                    failed = Some(error);
                    cancel.cancel();
                }
            }
            let result = worker
                .join()
                .unwrap_or_else(|cause| Err(fault(&in_words(&*cause))));
            if let Some(error) = failed {
                return Err(error);
            }
            Python::attach(|py| look(py, progress, told, &mut shown))?;
            result
        })
    })
}

/// Signals, then progress.
fn look(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    told: &UserSpecified,
    shown: &mut Progress,
) -> PyResult<()> {
    py.check_signals()?;
    let now = told.now();
    if let Some(progress) = progress
        && now != *shown
    {
        progress.call1(py, (&now.doing, now.done, now.count))?;
        *shown = now;
    }
    Ok(())
}

fn in_words(cause: &(dyn std::any::Any + Send)) -> String {
    let text = cause.downcast_ref::<&str>().map(|t| (*t).to_owned());
    text.or_else(|| cause.downcast_ref::<String>().cloned())
        .unwrap_or_default()
}
