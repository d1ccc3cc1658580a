//! Folders that are watched, and what was told of them.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use moiregauge_pipeline::campaign::Advice;
use moiregauge_pipeline::watch::{Watch, WatchRequest};
use moiregauge_pipeline::{Cancel, Job, Quiet};
use serde_json::{Value, json};

use super::table::Table;
use crate::feed::Feed;
use crate::host::{Hub, repeat};
use crate::lock::lock;
use crate::problem::{Answer, Problem};

/// Lines that are kept for pages that come later.
const LINES: usize = 2000;
/// Folders that are watched at a time.
const MOST: usize = 10;
/// What is kept of a line once another has come: what a table and pictures in time are made of.
const NUMBERS: [&str; 10] = [
    "event",
    "file",
    "acquired",
    "set",
    "moire",
    "frames",
    "twist_deg",
    "heterostrain_percent",
    "uncorrected",
    "drift",
];
/// Between two looks into the folder.
const POLL: Duration = Duration::from_secs(2);

/// All watches.
#[derive(Debug)]
pub(crate) struct Watches {
    hub: Arc<Hub>,
    advice: Advice,
    all: Table<Watched>,
}

/// A folder that is watched.
#[derive(Debug)]
pub(crate) struct Watched {
    id: String,
    folder: String,
    hub: Arc<Hub>,
    cancel: Cancel,
    inner: Mutex<Inner>,
}

#[derive(Debug)]
struct Inner {
    state: &'static str,
    error: Option<String>,
    /// What is kept of earlier lines, as JSON: text takes a tenth of the memory of values.
    earlier: VecDeque<String>,
    last: Option<Value>,
}

impl Watches {
    pub(crate) fn new(hub: &Arc<Hub>, advice: Advice) -> Self {
        Self {
            hub: Arc::clone(hub),
            advice,
            all: Table::new('x', "watch"),
        }
    }

    pub(crate) fn ids(&self) -> Vec<String> {
        self.all.ids()
    }

    pub(crate) fn get(&self, id: &str) -> Answer<Arc<Watched>> {
        self.all.get(id)
    }

    fn insert(&self, folder: &std::path::Path) -> Answer<Arc<Watched>> {
        let too_many = format!("{MOST} folders are watched already");
        self.all.add(MOST, &too_many, |id| Watched {
            id,
            folder: moiregauge_pipeline::names::in_words(folder),
            hub: Arc::clone(&self.hub),
            cancel: Cancel::new(),
            inner: Mutex::new(Inner {
                state: "running",
                error: None,
                earlier: VecDeque::new(),
                last: None,
            }),
        })
    }

    /// Begins one.
    pub(crate) fn add(&self, request: WatchRequest) -> Answer<Arc<Watched>> {
        let folder = request.folder.clone();
        let watch = Watch::new(request).map_err(Problem::wrong)?;
        let mut watch = watch.with_advice(self.advice);
        let watched = self.insert(&folder)?;
        let of_thread = Arc::clone(&watched);
        let job = Job::new(None, watched.cancel.clone(), &Quiet).map_err(Problem::fault)?;
        let driven = repeat(POLL, watched.cancel.clone(), move || {
            let look = std::panic::AssertUnwindSafe(|| of_thread.look(&mut watch, &job));
            std::panic::catch_unwind(look).unwrap_or_else(|_| {
                lock(&of_thread.inner).error =
                    Some("a fault of moiregauge, please report it".to_owned());
                of_thread.ended("failed")
            })
        });
        driven.map_err(Problem::fault)?;
        Ok(watched)
    }

    /// One that somebody else drives.
    pub(crate) fn listen(&self, feed: &Feed) {
        if let Ok(watched) = self.insert(feed.folder()) {
            feed.listen(Box::new(move |line| watched.tell(line)));
        }
    }

    pub(crate) fn remove(&self, id: &str) -> Answer<()> {
        let watched = self.get(id)?;
        watched.cancel.cancel();
        self.all.remove(id);
        Ok(())
    }

    /// Stops all, for the end.
    pub(crate) fn cancel(&self) {
        for watch in self.all.all() {
            watch.cancel.cancel();
        }
    }
}

/// A line without words: doubts by their codes alone.
fn numbers(line: &Value) -> Value {
    let kept = |key: &&str| Some(((*key).to_owned(), line.get(*key)?.clone()));
    let mut all: serde_json::Map<String, Value> = NUMBERS.iter().filter_map(kept).collect();
    let caveats = line["caveats"].as_array().into_iter().flatten();
    let codes: Vec<Value> = caveats.map(|caveat| caveat["code"].clone()).collect();
    all.insert("caveats".to_owned(), codes.into());
    Value::Object(all)
}

impl Watched {
    /// What there is to tell of it.
    pub(crate) fn shown(&self) -> Value {
        let inner = lock(&self.inner);
        let last = inner.last.as_ref();
        let earlier = inner.earlier.iter().map(|line| serde_json::from_str(line));
        let mut lines: Vec<Value> = earlier.filter_map(Result::ok).collect();
        lines.extend(last.cloned());
        json!({
            "watch": self.id,
            "folder": self.folder,
            "state": inner.state,
            "error": inner.error,
            "frames": lines,
            "advice": last.map(|line| line["advice"].clone()),
            "warnings": last.map(|line| line["warnings"].clone()),
        })
    }

    fn tell(&self, line: &Value) {
        let mut inner = lock(&self.inner);
        if let Some(last) = inner.last.replace(line.clone()) {
            inner.earlier.push_back(numbers(&last).to_string());
        }
        if inner.earlier.len() >= LINES {
            inner.earlier.pop_front();
        }
        drop(inner);
        let event = json!({"watch": self.id, "state": "running", "line": line});
        self.hub.tell("watch", &event);
    }

    /// Tells how it ended; there is no more to do.
    fn ended(&self, state: &'static str) -> bool {
        lock(&self.inner).state = state;
        let event = json!({"watch": self.id, "state": state});
        self.hub.tell("watch", &event);
        false
    }

    /// Looks into the folder; whether it is to be looked into again.
    fn look(&self, watch: &mut Watch, job: &Job) -> bool {
        let Ok(lines) = watch.look(job) else {
            return self.ended("cancelled");
        };
        for line in lines {
            self.tell(&serde_json::to_value(line).unwrap_or_default());
        }
        if watch.is_reached() {
            return self.ended("done");
        }
        true
    }
}
