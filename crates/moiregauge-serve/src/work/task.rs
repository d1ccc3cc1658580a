//! Long work on threads of its own, that tells how far it is.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use moiregauge_pipeline::{Cancel, Event, Events, Job};
use serde_json::{Value, json};

use crate::host::Hub;
use crate::lock::lock;

/// Steps are told at most that often.
const OFTEN: Duration = Duration::from_millis(100);

/// Tells pages of the progress of a thing.
#[derive(Debug)]
pub(crate) struct Progress {
    hub: Arc<Hub>,
    kind: &'static str,
    id: String,
    now: Mutex<Now>,
}

#[derive(Debug, Default)]
struct Now {
    stage: Option<String>,
    done: usize,
    of: usize,
    told: Option<Instant>,
}

impl Progress {
    pub(crate) fn new(hub: &Arc<Hub>, kind: &'static str, id: &str) -> Self {
        Self {
            hub: Arc::clone(hub),
            kind,
            id: id.to_owned(),
            now: Mutex::default(),
        }
    }

    /// Tells the state of the thing, and what else there is to tell.
    pub(crate) fn state(&self, state: &str) {
        self.hub.tell(self.kind, &self.value(state));
    }

    fn value(&self, state: &str) -> Value {
        json!({(self.kind): self.id, "state": state})
    }

    fn step(&self, now: &mut Now) {
        now.told = Some(Instant::now());
        let mut value = self.value("running");
        value["stage"] = now.stage.clone().into();
        value["done"] = now.done.into();
        value["of"] = now.of.into();
        self.hub.tell(self.kind, &value);
    }
}

impl Events for Progress {
    fn tell(&self, event: &Event<'_>) {
        let mut now = lock(&self.now);
        match event {
            Event::Stage {
                doing,
                things,
                count,
            } => {
                now.stage = Some(format!("{doing} {things}"));
                (now.done, now.of) = (0, *count);
                self.step(&mut now);
            }
            Event::Step => {
                now.done += 1;
                let due = now.told.is_none_or(|told| told.elapsed() >= OFTEN);
                if due || now.done == now.of {
                    self.step(&mut now);
                }
            }
            _ => {}
        }
    }
}

/// Why work has no result.
#[derive(Debug)]
pub(crate) enum NoResult<E> {
    Cancelled,
    /// A fault of ours, in words.
    Fault(String),
    /// What it says itself.
    Refused(E),
}

/// Does work on threads of a job, and comes back with what came of it, however that ended.
pub(crate) fn run_beside<T: Send, E: Send>(
    cancel: &Cancel,
    events: &dyn Events,
    work: impl FnOnce(&Job) -> Result<T, E> + Send,
) -> Result<T, NoResult<E>> {
    let job = Job::new(None, cancel.clone(), events);
    let job = job.map_err(|error| NoResult::Fault(error.to_string()))?;
    // Nothing of it is looked at after a panic but what is locked.
    let done = catch_unwind(AssertUnwindSafe(|| job.run(|| work(&job))));
    match done {
        Ok(Ok(Ok(value))) => Ok(value),
        Ok(Ok(Err(_)) | Err(_)) if cancel.is_cancelled() => Err(NoResult::Cancelled),
        Ok(Ok(Err(error))) => Err(NoResult::Refused(error)),
        Ok(Err(_)) => Err(NoResult::Cancelled),
        Err(cause) => {
            let text = cause.downcast_ref::<&str>().map(|t| (*t).to_owned());
            let text = text.or_else(|| cause.downcast_ref::<String>().cloned());
            Err(NoResult::Fault(text.unwrap_or_default()))
        }
    }
}
