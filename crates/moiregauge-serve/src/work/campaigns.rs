//! Campaigns: every sample below a folder, into one table.

use std::path::Path;
use std::sync::{Arc, Mutex};

use moiregauge::settings::Settings;
use moiregauge_pipeline::campaign::Advice;
use moiregauge_pipeline::samples::{Samples, SamplesError, analyse_samples, samples_in};
use moiregauge_pipeline::{Cancel, names};
use moiregauge_report::results::UserSpecified;
use serde_json::{Value, json};

use super::table::Table;
use super::task::{NoResult, Progress, run_beside};
use crate::host::{Hub, begin};
use crate::lock::lock;
use crate::problem::{Answer, Problem};
use crate::roots::{DROPPED, Folder};

/// Campaigns that are remembered.
const MOST: usize = 100;

/// All campaigns.
#[derive(Debug)]
pub(crate) struct Campaigns {
    hub: Arc<Hub>,
    advice: Advice,
    all: Table<Campaign>,
}

/// One that runs, or ran.
#[derive(Debug)]
pub(crate) struct Campaign {
    id: String,
    /// The folder of results, as it is shown.
    under: String,
    cancel: Cancel,
    inner: Mutex<Inner>,
}

#[derive(Debug)]
struct Inner {
    state: &'static str,
    error: Option<String>,
    /// Samples without a result.
    failed: usize,
}

impl Campaigns {
    pub(crate) fn new(hub: &Arc<Hub>, advice: Advice) -> Self {
        Self {
            hub: Arc::clone(hub),
            advice,
            all: Table::new('c', "campaign"),
        }
    }

    pub(crate) fn get(&self, id: &str) -> Answer<Arc<Campaign>> {
        self.all.get(id)
    }

    /// Begins one of the samples below a folder. Its results lie in `out` under a name that tells the folder, so that one that
    /// was stopped goes on where it was.
    pub(crate) fn add(
        &self,
        folder: &Folder,
        under: &str,
        out: &Path,
        settings: Settings,
        known: UserSpecified,
    ) -> Answer<Arc<Campaign>> {
        let parts = [folder.root.as_str(), under];
        let parts = parts
            .iter()
            .filter(|part| !part.is_empty() && **part != DROPPED);
        let name = parts.map(|part| part.replace('/', "-"));
        let name = ["campaign".to_owned()].into_iter().chain(name);
        let under = name.collect::<Vec<_>>().join("-");
        let out = out.join(&under);
        let refused = |e: SamplesError| Problem::unusable(&e).at("under");
        let samples = samples_in(&folder.real, &out).map_err(refused)?;
        let samples = Samples::new(&folder.real, samples, settings, known);
        let samples = samples.map_err(|e| Problem::wrong(&e).at(e.setting))?;
        let samples = samples.advice(self.advice);
        for old in self.all.make_room(MOST) {
            old.cancel.cancel();
        }
        let campaign = self.all.add(usize::MAX, "", |id| Campaign {
            id,
            under,
            cancel: Cancel::new(),
            inner: Mutex::new(Inner {
                state: "running",
                error: None,
                failed: 0,
            }),
        })?;
        let run = Arc::clone(&campaign);
        let progress = Progress::new(&self.hub, "campaign", &campaign.id);
        begin(move || run.run(&samples, &out, &progress)).map_err(Problem::fault)?;
        Ok(campaign)
    }

    /// Stops all, for the end.
    pub(crate) fn cancel(&self) {
        for campaign in self.all.all() {
            campaign.cancel();
        }
    }
}

impl Campaign {
    pub(crate) fn cancel(&self) {
        self.cancel.cancel();
    }

    /// What there is to tell of it.
    pub(crate) fn shown(&self) -> Value {
        let inner = lock(&self.inner);
        json!({
            "campaign": self.id,
            "state": inner.state,
            "error": inner.error,
            "failed": inner.failed,
            "root": DROPPED,
            "under": self.under,
        })
    }

    fn run(&self, samples: &Samples, out: &Path, progress: &Progress) {
        progress.state("running");
        let done = run_beside(&self.cancel, progress, |job| {
            analyse_samples(samples, out, job)
        });
        let mut inner = lock(&self.inner);
        match done {
            Ok(done) => (inner.state, inner.failed) = ("done", done.failed),
            Err(NoResult::Cancelled) => inner.state = "cancelled",
            Err(NoResult::Fault(words)) => {
                inner.state = "failed";
                inner.error = Some(format!("a fault of moiregauge, please report it: {words}"));
            }
            Err(NoResult::Refused(error)) => {
                (inner.state, inner.error) = ("failed", Some(names::in_full(&error)));
            }
        }
        let state = inner.state;
        drop(inner);
        progress.state(state);
    }
}
