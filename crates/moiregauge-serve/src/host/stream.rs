//! What happens, told to every open page: events with ids, the last ones kept for pages that were away.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use axum::response::sse::{Event, KeepAlive, Sse};
use futures_util::stream::{self, Stream};
use serde_json::Value;
use tokio::sync::watch;

use crate::lock::lock;

/// Events that are kept.
const KEPT: usize = 1024;
/// How often a page hears that the server is there.
const HEARTBEAT: Duration = Duration::from_secs(15);

/// All events.
#[derive(Debug)]
pub(crate) struct Hub {
    /// Tells this run of the server from others.
    run: String,
    events: Mutex<Events>,
    /// The number of the last event.
    last: watch::Sender<u64>,
}

#[derive(Debug, Default)]
struct Events {
    /// The number of the first one kept.
    first: u64,
    /// Kind and JSON: text takes a tenth of the memory of values.
    kept: VecDeque<(&'static str, String)>,
}

impl Hub {
    pub(crate) fn new(run: &str) -> Self {
        Self {
            run: run.to_owned(),
            events: Mutex::default(),
            last: watch::Sender::new(0),
        }
    }

    /// Tells every page.
    pub(crate) fn tell(&self, kind: &'static str, value: &Value) {
        let mut events = lock(&self.events);
        events.kept.push_back((kind, value.to_string()));
        if events.kept.len() > KEPT {
            events.kept.pop_front();
            events.first += 1;
        }
        let last = events.first + events.kept.len() as u64;
        drop(events);
        self.last.send_replace(last);
    }

    /// What came after the event of this number, and the number of the last; none where some of it is gone.
    fn after(&self, number: u64) -> Option<(Vec<Event>, u64)> {
        let events = lock(&self.events);
        let last = events.first + events.kept.len() as u64;
        if number < events.first || number > last {
            return None;
        }
        let new = events.kept.iter().skip((number - events.first) as usize);
        let numbered = (number + 1..).zip(new);
        let all = numbered.map(|(n, (kind, json))| self.event(n, kind, json));
        Some((all.collect(), last))
    }

    fn event(&self, number: u64, kind: &str, json: &str) -> Event {
        Event::default()
            .id(format!("{}-{number}", self.run))
            .event(kind)
            .data(json)
    }

    /// All from now on, or from the event on that a page has heard last. Where some of it is gone an event `reset` comes
    /// first: the page has to ask for everything anew. It ends with the server.
    pub(crate) fn stream(
        self: Arc<Self>,
        heard: Option<String>,
        stop: watch::Receiver<bool>,
    ) -> Sse<impl Stream<Item = Result<Event, Infallible>>> {
        let of_this_run = |id: &str| id.strip_prefix(&self.run)?.strip_prefix('-')?.parse().ok();
        let now = *self.last.borrow();
        let from = match heard {
            None => Some(now),
            Some(id) => of_this_run(&id),
        };
        let listening = Listening {
            changed: self.last.subscribe(),
            hub: self,
            stop,
            number: from.unwrap_or(u64::MAX),
            ready: VecDeque::new(),
        };
        let next = |mut listening: Listening| async {
            let event = listening.next().await?;
            Some((Ok(event), listening))
        };
        Sse::new(stream::unfold(listening, next))
            .keep_alive(KeepAlive::new().interval(HEARTBEAT).text("here"))
    }
}

/// A page that listens.
struct Listening {
    hub: Arc<Hub>,
    changed: watch::Receiver<u64>,
    stop: watch::Receiver<bool>,
    /// The last event that was sent.
    number: u64,
    ready: VecDeque<Event>,
}

impl Listening {
    async fn next(&mut self) -> Option<Event> {
        loop {
            if *self.stop.borrow() {
                return None;
            }
            if let Some(event) = self.ready.pop_front() {
                return Some(event);
            }
            self.changed.mark_unchanged();
            let Some((new, last)) = self.hub.after(self.number) else {
                let now = *self.hub.last.borrow();
                self.number = now;
                return Some(self.hub.event(now, "reset", "null"));
            };
            self.number = last;
            self.ready.extend(new);
            if self.ready.is_empty() {
                tokio::select! {
                    changed = self.changed.changed() => changed.ok()?,
                    stopped = self.stop.changed() => stopped.ok()?,
                }
            }
        }
    }
}
