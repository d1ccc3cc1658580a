//! All works of a server.

use std::path::Path;
use std::sync::{Arc, Mutex};

use moiregauge_pipeline::Cancel;
use moiregauge_pipeline::campaign::{Advice, Kept, Outcome};
use moiregauge_report::FailedInput;
use serde_json::{Value, json};

use super::asked::{Asked, Change};
use super::done::Done;
use super::history::History;
use super::keep::{Keeper, OnDisk, Results};
use super::table::Table;
use super::task::{NoResult, Progress, run_beside};
use crate::host::{Hub, Running, SAVES, begin, ended};
use crate::lock::lock;
use crate::problem::{Answer, Problem};
use crate::roots::Roots;

/// Works at a time.
const MOST: usize = 500;

/// All works.
#[derive(Debug)]
pub(crate) struct Works {
    hub: Arc<Hub>,
    advice: Advice,
    keeper: Option<Keeper>,
    all: Table<Work>,
}

/// Files that are analysed together.
#[derive(Debug)]
pub(crate) struct Work {
    pub(crate) id: String,
    hub: Arc<Hub>,
    advice: Advice,
    keeper: Option<Keeper>,
    inner: Mutex<Inner>,
}

/// Whether a result is on the disk.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Saved {
    Yes,
    No,
    /// It should be. Why not.
    Not(String),
}

#[derive(Debug)]
struct Inner {
    history: History<Asked>,
    state: &'static str,
    error: Option<String>,
    failed: Vec<FailedInput>,
    kept: Kept,
    done: Option<Arc<Done>>,
    /// Whether the result is on the disk.
    saved: Saved,
    /// The result that is on the disk, which may be one before the last.
    on_disk: Option<Results>,
    /// The number of the last result that was to be kept.
    version: u64,
    cancel: Cancel,
    /// The number of the last run: earlier ones tell nothing any more.
    run: u64,
    thread: Option<Running>,
}

impl Works {
    /// Those of an earlier server among them.
    pub(crate) fn new(hub: &Arc<Hub>, advice: Advice, keep: Option<&Path>, roots: &Roots) -> Self {
        let works = Self {
            hub: Arc::clone(hub),
            advice,
            keeper: keep.map(Keeper::new),
            all: Table::new('w', "work"),
        };
        let kept = works.keeper.iter().flat_map(Keeper::all);
        for (id, on_disk, documents, kept) in kept {
            for file in &on_disk.history.now().files {
                roots.show_again(file);
            }
            let answered = on_disk.results.as_ref().map(|r| r.answered.clone());
            let done = answered.map(|asked| Arc::new(Done::read(asked, documents)));
            let inner = Inner {
                state: if done.is_some() { "done" } else { "idle" },
                saved: if done.is_some() {
                    Saved::Yes
                } else {
                    Saved::No
                },
                version: on_disk.results.as_ref().map_or(0, |r| r.version),
                on_disk: on_disk.results,
                done,
                kept,
                ..Inner::new(on_disk.history)
            };
            works.all.put(&id, works.work(id.clone(), inner));
        }
        works
    }

    fn work(&self, id: String, inner: Inner) -> Work {
        Work {
            id,
            hub: Arc::clone(&self.hub),
            advice: self.advice,
            keeper: self.keeper.clone(),
            inner: Mutex::new(inner),
        }
    }

    /// Their ids.
    pub(crate) fn ids(&self) -> Vec<String> {
        self.all.ids()
    }

    /// One of them.
    pub(crate) fn get(&self, id: &str) -> Answer<Arc<Work>> {
        self.all.get(id)
    }

    /// A new one.
    pub(crate) fn add(&self, asked: Asked) -> Answer<Arc<Work>> {
        let too_many = format!("there are {MOST} works already");
        let inner = Inner::new(History::new(asked));
        let work = self.all.add(MOST, &too_many, |id| self.work(id, inner))?;
        work.save(&mut lock(&work.inner), false);
        Ok(work)
    }

    /// Stops all, for the end.
    pub(crate) fn cancel(&self) {
        for work in self.all.all() {
            work.cancel();
        }
    }
}

impl Inner {
    fn new(history: History<Asked>) -> Self {
        Self {
            history,
            state: "idle",
            error: None,
            failed: Vec::new(),
            kept: Kept::default(),
            done: None,
            saved: Saved::No,
            on_disk: None,
            version: 0,
            cancel: Cancel::new(),
            run: 0,
            thread: None,
        }
    }
}

impl Work {
    /// What there is to tell of it.
    pub(crate) fn shown(&self) -> Value {
        let inner = lock(&self.inner);
        let asked = inner.history.now();
        let files: Vec<&str> = asked.files.iter().map(|f| f.id.as_str()).collect();
        let names = asked.files.iter().map(|file| {
            let name = moiregauge_pipeline::names::in_words(&file.name);
            (file.id.clone(), Value::from(name))
        });
        let result = inner.done.as_ref().map(|done| {
            let unsaved = match &inner.saved {
                Saved::Not(why) => Some(why),
                _ => None,
            };
            let saved = SAVES && inner.saved == Saved::Yes;
            let current = done.asked == *asked;
            json!({"moires": done.documents.len(), "current": current, "saved": saved, "unsaved": unsaved})
        });
        json!({
            "work": self.id,
            "files": files,
            "names": names.collect::<serde_json::Map<_, _>>(),
            "excluded": asked.excluded,
            "settings": asked.settings,
            "known": asked.known,
            "state": inner.state,
            "can_undo": inner.history.can_undo(),
            "can_redo": inner.history.can_redo(),
            "error": inner.error,
            "failed": inner.failed,
            "result": result,
        })
    }

    /// What is asked now.
    pub(crate) fn asked(&self) -> Asked {
        lock(&self.inner).history.now().clone()
    }

    /// What was measured.
    pub(crate) fn kept(&self) -> Kept {
        lock(&self.inner).kept.clone()
    }

    /// The moirés that came out last, the largest cell first.
    pub(crate) fn outcomes(&self) -> Answer<(Arc<Done>, Arc<Vec<Outcome>>)> {
        let (done, kept) = self.done()?;
        let outcomes = done.outcomes(self.advice, &kept)?;
        Ok((done, outcomes))
    }

    /// What came out last, and what was measured.
    pub(crate) fn done(&self) -> Answer<(Arc<Done>, Kept)> {
        let inner = lock(&self.inner);
        let done = inner.done.clone();
        let done = done.ok_or_else(|| Problem::conflict("there is no result yet"))?;
        Ok((done, inner.kept.clone()))
    }

    /// Asks something else.
    pub(crate) fn change(self: &Arc<Self>, change: Change, roots: &Roots) -> Answer<()> {
        let run = change.run;
        let asked = self.asked().with(change, roots)?;
        {
            let mut inner = lock(&self.inner);
            if inner.history.change(asked) {
                self.save(&mut inner, false);
            }
        }
        self.told(run, roots)
    }

    /// Asks what was asked before, or again what was undone; analyses it where there is a result already.
    pub(crate) fn step(self: &Arc<Self>, back: bool, roots: &Roots) -> Answer<()> {
        let run = {
            let mut inner = lock(&self.inner);
            let moved = if back {
                inner.history.undo()
            } else {
                inner.history.redo()
            };
            if !moved {
                let what = if back { "undo" } else { "redo" };
                return Err(Problem::conflict(format!("nothing to {what}")));
            }
            self.save(&mut inner, false);
            inner.done.is_some()
        };
        self.told(run, roots)
    }

    fn told(self: &Arc<Self>, run: bool, roots: &Roots) -> Answer<()> {
        if run {
            return self.run(roots);
        }
        let state = lock(&self.inner).state;
        Progress::new(&self.hub, "work", &self.id).state(state);
        Ok(())
    }

    /// Stops what is under way.
    pub(crate) fn cancel(&self) {
        lock(&self.inner).cancel.cancel();
    }

    /// Analyses what is asked now; what was under way is stopped.
    pub(crate) fn run(self: &Arc<Self>, roots: &Roots) -> Answer<()> {
        let mut inner = lock(&self.inner);
        for file in &inner.history.now().files {
            roots.file(&file.id)?;
        }
        inner.cancel.cancel();
        inner.cancel = Cancel::new();
        inner.run += 1;
        (inner.state, inner.error) = ("running", None);
        inner.failed.clear();
        let (work, run, before) = (Arc::clone(self), inner.run, inner.thread.take());
        let thread = begin(move || {
            // It has measured something, perhaps.
            if let Some(before) = before {
                ended(before);
            }
            work.analyse(run);
        });
        inner.thread = Some(thread.map_err(Problem::fault)?);
        drop(inner);
        Progress::new(&self.hub, "work", &self.id).state("running");
        Ok(())
    }

    fn analyse(&self, run: u64) {
        let (asked, mut kept, cancel) = {
            let inner = lock(&self.inner);
            // Another one was begun before this had its turn.
            if inner.run != run {
                return;
            }
            (
                inner.history.now().clone(),
                inner.kept.clone(),
                inner.cancel.clone(),
            )
        };
        let progress = Progress::new(&self.hub, "work", &self.id);
        let heard = self.keeper.as_ref().map(|keeper| keeper.each(&self.id));
        let found = run_beside(&cancel, &progress, |job| {
            Done::of(&asked, self.advice, &mut kept, heard, job)
        });
        let mut inner = lock(&self.inner);
        // Nothing that was measured is lost by a panic.
        if !kept.is_empty() {
            inner.kept = kept;
        }
        if inner.run != run {
            return;
        }
        match found {
            Ok(done) => {
                inner.done = Some(Arc::new(done));
                inner.state = "done";
                self.save(&mut inner, true);
            }
            Err(NoResult::Cancelled) => inner.state = "cancelled",
            Err(NoResult::Fault(words)) => {
                inner.state = "failed";
                inner.error = Some(format!("a fault of moiregauge, please report it: {words}"));
            }
            Err(NoResult::Refused(why)) => {
                let (words, failed) = why.in_words();
                (inner.state, inner.error, inner.failed) = ("failed", Some(words), failed);
            }
        }
        let state = inner.state;
        drop(inner);
        progress.state(state);
    }

    /// Keeps it on the disk, if that is wished; `result`: with what just came out.
    fn save(&self, inner: &mut Inner, result: bool) {
        let Some(keeper) = &self.keeper else {
            return;
        };
        // What could not be saved before may be now.
        let result = result || matches!(inner.saved, Saved::Not(_));
        let new = inner.done.clone().filter(|_| result);
        let results = match &new {
            Some(done) => {
                inner.version += 1;
                Some(Results {
                    version: inner.version,
                    answered: done.asked.clone(),
                    moires: done.documents.len(),
                })
            }
            None => inner.on_disk.clone(),
        };
        let history = inner.history.clone();
        let on_disk = OnDisk { history, results };
        let with = new
            .as_ref()
            .map(|done| (done.documents.as_slice(), &inner.kept));
        let saved = keeper.save(&self.id, &on_disk, with);
        match saved {
            Ok(()) if new.is_some() => {
                inner.saved = Saved::Yes;
                inner.on_disk = on_disk.results;
            }
            Ok(()) => {}
            // What was kept before is there still.
            Err(error) => inner.saved = Saved::Not(format!("not saved: {error}")),
        }
    }
}
