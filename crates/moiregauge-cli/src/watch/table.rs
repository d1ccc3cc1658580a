//! Lines as a table that grows.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use heterostrain::Estimate;
use moiregauge_pipeline::watch::{Happened, Line, Number, Warning};
use moiregauge_report::plus_minus;

/// What was said already.
#[derive(Default)]
pub(super) struct Table {
    set: Option<(Option<String>, usize)>,
    warnings: Vec<Warning>,
    caveats: BTreeSet<String>,
}

impl Table {
    /// A row, and below it what is new.
    pub(super) fn row(&mut self, line: &Line) -> String {
        let mut text = String::new();
        self.head(&mut text, line);
        if line.event == Happened::Folder {
            note(&mut text, "!", line.error.as_deref().unwrap_or_default());
            return text;
        }
        let file = line.file.as_deref().map_or("", name);
        let more = match line.files.len() {
            0 | 1 => String::new(),
            n => format!(" and {} more", n - 1),
        };
        let word = match line.event {
            Happened::Again => " (written anew)",
            Happened::Gone => " (deleted)",
            Happened::Unreadable => " (not readable)",
            _ => "",
        };
        let time = line.acquired.as_deref().and_then(|t| t.split('T').nth(1));
        let drift = [line.drift.x_nm_per_min, line.drift.y_nm_per_min].map(in_words);
        let _ = writeln!(
            text,
            "{:>6}  {:<8}  {:>17}  {:>17}  {:<35}  {file}{more}{word}",
            line.frames,
            time.unwrap_or_default(),
            in_words(line.twist_deg),
            in_words(line.heterostrain_percent),
            drift.join(", "),
        );
        if let Some(error) = &line.error {
            note(&mut text, "!", error);
        }
        if !line.advice.is_empty() {
            note(&mut text, "→", &line.advice);
        }
        for warning in line.warnings.iter().filter(|w| !self.warnings.contains(w)) {
            let words = format!("{}: {}", name(&warning.place), warning.message);
            note(&mut text, "!", &words);
        }
        self.warnings.clone_from(&line.warnings);
        for caveat in &line.caveats {
            if self.caveats.insert(caveat.code.clone()) {
                let words = format!(
                    "{} ({}): {}",
                    caveat.code,
                    name(&caveat.place),
                    caveat.message
                );
                note(&mut text, "·", &words);
            }
        }
        text
    }

    /// The names of the columns, where a set begins.
    fn head(&mut self, text: &mut String, line: &Line) {
        let set = (line.set.clone(), line.moire);
        if self.set.as_ref() == Some(&set) || (line.set.is_none() && self.set.is_some()) {
            return;
        }
        if let Some(name) = &line.set {
            let moire = if line.moire > 1 {
                format!(", moiré {}", line.moire)
            } else {
                String::new()
            };
            let apart = if self.set.is_some() { "\n" } else { "" };
            let _ = writeln!(text, "{apart}{name}{moire}");
        }
        let _ = writeln!(
            text,
            "{:>6}  {:<8}  {:>17}  {:>17}  {:<35}  file",
            "frames", "saved", "twist °", "strain %", "drift x, y nm/min"
        );
        self.set = Some(set);
    }
}

fn note(text: &mut String, sign: &str, words: &str) {
    let _ = writeln!(text, "        {sign} {words}");
}

/// The last part of a path, whatever its separators.
fn name(file: &str) -> &str {
    Path::new(file)
        .file_name()
        .and_then(|n| n.to_str())
        .unwrap_or(file)
}

/// With the total error where it is known.
fn in_words(number: Number) -> String {
    let Some(value) = number.value else {
        return "–".to_owned();
    };
    let sigma = number.sigma_total.or(number.sigma).unwrap_or(f64::NAN);
    plus_minus(Estimate::new(value, sigma))
}
