//! Maps: made in a thread, asked as often as wanted.

use std::sync::{Arc, Mutex};

use moiregauge_pipeline::campaign::{Advice, Campaign, Kept};
use moiregauge_pipeline::maps::{MapFound, MapRequest, NotMapped, Shown};
use moiregauge_pipeline::sink::{Forget, MemorySink};
use moiregauge_pipeline::{Cancel, Found, Job, Known, record_files};
use moiregauge_report::results::Run;
use moiregauge_report::{Choice, ColorMap, FailedInput, map_scan, stripe_scan};
use serde_json::{Value, json};
use spmfile::Channel;

use super::asked::Asked;
use super::done::Written;
use super::table::Table;
use super::task::{NoResult, Progress, run_beside};
use crate::host::{Hub, begin};
use crate::lock::lock;
use crate::problem::{Answer, Problem};
use crate::roots::places;
use crate::typed::map_as_options;

/// Maps at a time: each holds all its quantities.
const MOST: usize = 20;

/// All maps.
#[derive(Debug)]
pub(crate) struct Maps {
    hub: Arc<Hub>,
    advice: Advice,
    all: Table<MapWork>,
}

/// A map that is made, or was.
#[derive(Debug)]
pub(crate) struct MapWork {
    pub(crate) id: String,
    pub(crate) asked: Asked,
    pub(crate) request: MapRequest,
    cancel: Cancel,
    inner: Mutex<Inner>,
}

#[derive(Debug)]
struct Inner {
    state: &'static str,
    error: Option<String>,
    failed: Vec<FailedInput>,
    found: Option<Arc<Mapped>>,
}

/// A finished map.
#[derive(Debug)]
pub(crate) struct Mapped {
    pub(crate) found: MapFound,
    /// `map.json`.
    pub(crate) document: Vec<u8>,
    /// All quantities.
    pub(crate) planes: Vec<Channel>,
    request: MapRequest,
    written: Mutex<Option<Arc<Written>>>,
}

impl Maps {
    pub(crate) fn new(hub: &Arc<Hub>, advice: Advice) -> Self {
        Self {
            hub: Arc::clone(hub),
            advice,
            all: Table::new('m', "map"),
        }
    }

    pub(crate) fn ids(&self) -> Vec<String> {
        self.all.ids()
    }

    pub(crate) fn get(&self, id: &str) -> Answer<Arc<MapWork>> {
        self.all.get(id)
    }

    /// Begins a map; the oldest one goes where there are too many. `kept` is what was measured of the files already.
    pub(crate) fn add(
        &self,
        asked: Asked,
        request: MapRequest,
        kept: Kept,
    ) -> Answer<Arc<MapWork>> {
        request
            .check()
            .map_err(|e| Problem::wrong(e).at("request"))?;
        for old in self.all.make_room(MOST) {
            old.cancel.cancel();
        }
        let map = self.all.add(usize::MAX, "", |id| MapWork {
            id,
            asked,
            request,
            cancel: Cancel::new(),
            inner: Mutex::new(Inner {
                state: "running",
                error: None,
                failed: Vec::new(),
                found: None,
            }),
        })?;
        let (made, advice) = (Arc::clone(&map), self.advice);
        let progress = Progress::new(&self.hub, "map", &map.id);
        begin(move || made.make(advice, kept, &progress)).map_err(Problem::fault)?;
        Ok(map)
    }

    /// Stops all, for the end.
    pub(crate) fn cancel(&self) {
        for map in self.all.all() {
            map.cancel.cancel();
        }
    }
}

impl MapWork {
    pub(crate) fn cancel(&self) {
        self.cancel.cancel();
    }

    /// What there is to tell of it.
    pub(crate) fn shown(&self) -> Value {
        let inner = lock(&self.inner);
        let mut shown = json!({
            "map": self.id,
            "state": inner.state,
            "error": inner.error,
            "failed": inner.failed,
            "files": self.asked.files.iter().map(|f| f.id.as_str()).collect::<Vec<_>>(),
            "settings": self.asked.settings,
            "known": self.asked.known,
            "request": self.request,
        });
        if let Some(mapped) = &inner.found {
            let grid = &mapped.found.map().grid;
            let names: Vec<&str> = mapped.planes.iter().map(|p| p.name.as_str()).collect();
            let sigma = |name: &str| {
                let sigma = format!("{name} sigma");
                names.contains(&sigma.as_str()).then_some(sigma)
            };
            let quantities = mapped.planes.iter().map(|plane| {
                json!({"name": plane.name, "unit": plane.unit, "sigma": sigma(&plane.name)})
            });
            shown["quantities"] = quantities.collect();
            shown["is_stripes"] = matches!(mapped.found.shown, Shown::Stripes(_)).into();
            shown["nodes"] = json!(grid.size);
            shown["origin_nm"] = json!([grid.origin.x, grid.origin.y]);
            let step = |i: usize| [grid.step[(0, i)], grid.step[(1, i)]];
            shown["step_nm"] = json!([step(0), step(1)]);
        }
        shown
    }

    pub(crate) fn mapped(&self) -> Answer<Arc<Mapped>> {
        let found = lock(&self.inner).found.clone();
        found.ok_or_else(|| Problem::conflict("there is no map yet"))
    }

    fn make(&self, advice: Advice, kept: Kept, progress: &Progress) {
        progress.state("running");
        let made = run_beside(&self.cancel, progress, |job| {
            self.mapping(advice, kept, job)
        });
        let mut inner = lock(&self.inner);
        match made {
            Ok(mapped) => (inner.state, inner.found) = ("done", Some(Arc::new(mapped))),
            Err(NoResult::Cancelled) => inner.state = "cancelled",
            Err(NoResult::Fault(words)) => {
                inner.state = "failed";
                inner.error = Some(format!("a fault of moiregauge, please report it: {words}"));
            }
            Err(NoResult::Refused((words, failed))) => {
                (inner.state, inner.error, inner.failed) = ("failed", Some(words), failed);
            }
        }
        let state = inner.state;
        drop(inner);
        progress.state(state);
    }

    fn mapping(
        &self,
        advice: Advice,
        kept: Kept,
        job: &Job,
    ) -> Result<Mapped, (String, Vec<FailedInput>)> {
        let of_problem = |problem: Problem| (problem.words().to_owned(), Vec::new());
        let of_error = |error: &dyn std::error::Error| {
            (moiregauge_pipeline::names::in_full(error), Vec::new())
        };
        let named = Found {
            files: self.asked.inputs().into_iter().map(Ok).collect(),
            ..Found::default()
        };
        let (inputs, left_out) = named.frames();
        let mut arguments = self.asked.arguments().map_err(of_problem)?;
        "map".clone_into(&mut arguments[0]);
        arguments.extend(map_as_options(&self.request));
        let mut run = Run {
            command: "map".to_owned(),
            arguments,
            left_out,
            ..self.asked.run().map_err(of_problem)?
        };
        let places = places(&self.asked.files);
        let campaign = Campaign::of_run(&run, &inputs, &places, advice);
        let mut campaign = campaign.map_err(|e| of_error(&e))?.illustrated(false);
        campaign.take(kept);
        let found = moiregauge_pipeline::map(&mut campaign, &self.request, &Forget, job);
        let mut found = found.map_err(|error| {
            let failed = match &error {
                NotMapped::Nothing { failed } => failed.clone(),
                _ => Vec::new(),
            };
            (of_error(&error).0, failed)
        })?;
        let known = Known::new(&run.known, &inputs).at(&places);
        record_files(&mut run, &known, &inputs, &found.provenance.inputs);
        found.provenance.run = Some(run);
        let nothing_drawn = Choice {
            figures: false,
            png: false,
            html: false,
            colormap: ColorMap::default(),
        };
        let sink = MemorySink::new();
        let written = found.write(&self.request, nothing_drawn, &sink);
        written.map_err(|e| of_error(&e))?;
        let mut files = sink.commit("map").map_err(|e| of_error(&e))?;
        let planes = match &found.shown {
            Shown::Lattice(found) => map_scan(&found.map, found.registry.as_ref()).channels,
            Shown::Stripes(found) => stripe_scan(&found.stripes).channels,
        };
        Ok(Mapped {
            document: files.remove("map.json").unwrap_or_default(),
            planes,
            found,
            request: self.request.clone(),
            written: Mutex::default(),
        })
    }
}

impl Mapped {
    /// Everything that the program would write.
    pub(crate) fn written(&self) -> Answer<Arc<Written>> {
        // Whoever asks meanwhile waits for the same.
        let mut written = lock(&self.written);
        if let Some(files) = &*written {
            return Ok(Arc::clone(files));
        }
        let sink = MemorySink::new();
        let made = self.found.write(&self.request, Choice::default(), &sink);
        made.map_err(|e| Problem::unusable(&e))?;
        let made = Arc::new(sink.commit("map").map_err(Problem::fault)?);
        *written = Some(Arc::clone(&made));
        Ok(made)
    }
}
