//! How far the work is, on a terminal.

use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressStyle};
use moiregauge_pipeline::{Event, Events};

/// A bar for the stage under way, as in `measuring ███ 3/26 scans`.
#[derive(Debug, Default)]
pub(crate) struct Bars {
    /// Whether bars are wanted.
    loud: bool,
    bar: Mutex<Option<ProgressBar>>,
}

impl Bars {
    /// Bars, or none.
    pub(crate) fn new(loud: bool) -> Self {
        Self {
            loud,
            bar: Mutex::default(),
        }
    }
}

impl Events for Bars {
    fn tell(&self, event: &Event<'_>) {
        let mut bar = self.bar.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            Event::Stage {
                doing,
                things,
                count,
            } if self.loud => *bar = Some(new_bar(doing, things, *count)),
            Event::Step => {
                if let Some(bar) = &*bar {
                    bar.inc(1);
                }
            }
            Event::Ended => {
                if let Some(bar) = bar.take() {
                    bar.finish_and_clear();
                }
            }
            Event::Note { words } => match &*bar {
                Some(bar) => bar.suspend(|| eprintln!("{words}")),
                None => eprintln!("{words}"),
            },
            _ => {}
        }
    }
}

fn new_bar(doing: &str, things: &str, count: usize) -> ProgressBar {
    // Draws on a terminal only.
    let bar = ProgressBar::new(count as u64);
    let template = format!("{doing} {{bar:30}} {{pos}}/{{len}} {things}, {{eta}} left");
    match ProgressStyle::with_template(&template) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}
