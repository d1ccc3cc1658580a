//! `moiregauge explain`: the code of a caveat → what it means and what to do.

use std::cmp::Reverse;
use std::fmt::Write as _;
use std::process::ExitCode;

use anyhow::bail;
use moiregauge::caveat::{Explained, SUBJECTS, Severity, explained};

use crate::hints;
use crate::say::say;

/// What a caveat means and what to do
///
/// Caveats are doubts that you should know before you trust the numbers. Each has a code and one of three grades. note:
/// how a number was made, or what was assumed for it. warning: a number is less certain than its error says, or can
/// mean something else. serious: a result is probably wrong, or was left out.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge explain                          (all codes, one line each)
  moiregauge explain drift-undetermined
  moiregauge explain --json")]
pub(crate) struct ExplainArgs {
    /// The code of a caveat, as in no-position-sensors [default: all, one line each]
    code: Option<String>,
    /// Print JSON: a list with the code, the severity, the meaning and what to do
    #[arg(long)]
    json: bool,
    /// Print docs/caveats.md
    #[arg(long, hide = true, conflicts_with_all = ["code", "json"])]
    markdown: bool,
}

/// Codes that are shown where there is none of the name.
const NEAREST: usize = 3;

/// Says what was asked for.
pub(crate) fn run(args: &ExplainArgs) -> anyhow::Result<ExitCode> {
    let entries = match &args.code {
        None => explained().collect(),
        Some(code) => vec![named(code)?],
    };
    let text = if args.markdown {
        markdown()
    } else if args.json {
        format!("{}\n", serde_json::to_string_pretty(&entries)?)
    } else if args.code.is_some() {
        at_length(entries[0])
    } else {
        in_short(&entries)
    };
    say(&text)?;
    Ok(ExitCode::SUCCESS)
}

fn named(code: &str) -> anyhow::Result<&'static Explained> {
    if let Some(found) = explained().find(|e| e.code == code) {
        return Ok(found);
    }
    bail!(
        "no caveat has the code {code:?}; the nearest are {}",
        nearest(code).join(", ")
    )
}

/// The codes that are most like some text: those that hold it, then by how few letters differ.
fn nearest(text: &str) -> Vec<&'static str> {
    let mut codes: Vec<&str> = explained().map(|e| e.code).collect();
    codes.sort_by_key(|code| {
        let holds = !text.is_empty() && code.contains(text);
        (Reverse(holds), distance(code, text))
    });
    codes.truncate(NEAREST);
    codes
}

/// How many letters have to be put in, taken out or replaced.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut before = row[0];
        row[0] = i + 1;
        for (j, other) in b.iter().enumerate() {
            let replaced = before + usize::from(letter != *other);
            before = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
}

fn at_length(entry: &Explained) -> String {
    let Explained {
        code,
        severity,
        meaning,
        what_to_do,
    } = entry;
    let mut text = format!(
        "{code}: {}. {}\n\nMeaning: {meaning}\nWhat to do: {what_to_do}\n",
        severity.name(),
        severity.meaning()
    );
    if let Some(option) = hints::of(code) {
        let _ = writeln!(text, "Options: {option}");
    }
    text
}

fn in_short(entries: &[&Explained]) -> String {
    let width = entries.iter().map(|e| e.code.len()).max().unwrap_or(0);
    let mut text = String::new();
    for entry in entries {
        let first = entry.meaning.split_inclusive(". ").next();
        let _ = writeln!(
            text,
            "{:width$}  {:7}  {}",
            entry.code,
            entry.severity.name(),
            first.unwrap_or_default().trim_end()
        );
    }
    text
}

/// The page of the documentation.
fn markdown() -> String {
    let mut text = "\
# Caveats

Caveats are doubts that you should know before you trust the numbers. They are shown on the screen, in the report, in
`results.json` and in `map.json`. Each has a code, a message, and what it concerns. What several scans of a set have is
one caveat of the set: its message is that of the worst scan, and ends with how many scans have it. `moiregauge explain
CODE` says the same as this page, which `moiregauge explain --markdown` makes.

"
    .to_owned();
    for severity in [Severity::Note, Severity::Warning, Severity::Serious] {
        let _ = writeln!(text, "- **{}**: {}", severity.name(), severity.meaning());
    }
    for (subject, table) in SUBJECTS {
        let _ = write!(
            text,
            "\n## {subject}\n\n| code | grade | what it means | what to do |\n|---|---|---|---|\n"
        );
        for entry in table {
            let _ = writeln!(
                text,
                "| `{}` | {} | {} | {} |",
                entry.code,
                entry.severity.name(),
                entry.meaning,
                entry.what_to_do
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelt_codes_are_found() {
        assert_eq!(nearest("drift-undetermind")[0], "drift-undetermined");
        assert_eq!(nearest("sensor-lagg")[0], "sensor-lag");
        assert!(nearest("atomic").iter().all(|c| c.starts_with("atomic-")));
    }

    #[test]
    fn distances_are_numbers_of_changes() {
        assert_eq!(distance("kitten", "sitting"), 3);
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(distance("same", "same"), 0);
    }
}
