//! How far the work is, on a terminal.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar of `count` steps, as in `measuring ███ 3/26 scans`; hidden unless it is wanted.
pub(crate) fn bar(doing: &str, things: &str, count: usize, wanted: bool) -> ProgressBar {
    if !wanted {
        return ProgressBar::hidden();
    }
    // Draws on a terminal only.
    let bar = ProgressBar::new(count as u64);
    let template = format!("{doing} {{bar:30}} {{pos}}/{{len}} {things}, {{eta}} left");
    match ProgressStyle::with_template(&template) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}
