//! A watch that somebody else drives: the program, which tells its lines in the terminal and here.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use moiregauge_pipeline::watch::Line;
use serde_json::Value;

use crate::lock::lock;

/// Who hears of a line.
type Listener = Box<dyn Fn(&Value) + Send>;

/// Lines of a watch, for every page.
#[derive(Clone, Default)]
pub struct Feed {
    folder: PathBuf,
    inner: Arc<Mutex<Inner>>,
}

#[derive(Default)]
struct Inner {
    /// Those that came before anybody listened.
    waiting: Vec<Value>,
    listener: Option<Listener>,
}

impl std::fmt::Debug for Feed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Feed")
            .field("folder", &self.folder)
            .finish_non_exhaustive()
    }
}

impl Feed {
    /// That of a folder.
    #[must_use]
    pub fn new(folder: PathBuf) -> Self {
        Self {
            folder,
            inner: Arc::default(),
        }
    }

    /// Tells a line.
    pub fn tell(&self, line: &Line) {
        let value = serde_json::to_value(line).unwrap_or_default();
        let mut inner = lock(&self.inner);
        match &inner.listener {
            Some(listener) => listener(&value),
            None => inner.waiting.push(value),
        }
    }

    pub(crate) fn folder(&self) -> &std::path::Path {
        &self.folder
    }

    /// Hears all lines, those before among them.
    pub(crate) fn listen(&self, listener: Listener) {
        let mut inner = lock(&self.inner);
        for line in inner.waiting.drain(..) {
            listener(&line);
        }
        inner.listener = Some(listener);
    }
}
