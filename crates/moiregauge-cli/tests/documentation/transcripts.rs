//! Sessions in README and docs (blocks named `console`) are run, in a folder of their own for each page.
//!
//! Lines that begin with `$ ` are typed; the lines below are what has to come out. A line `…` stands for any number of
//! lines, and `…` within a line for any text.

use std::path::Path;
use std::process::Command;

use crate::pages::{pages, parts, read, root};

/// One command of a session and what it prints.
struct Step {
    typed: String,
    prints: Vec<String>,
}

fn steps(block: &str) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::new();
    for line in block.lines() {
        if let Some(typed) = line.strip_prefix("$ ") {
            steps.push(Step {
                typed: typed.to_owned(),
                prints: Vec::new(),
            });
        } else {
            let step = steps.last_mut().expect("a session begins with a command");
            step.prints.push(line.to_owned());
        }
    }
    steps
}

/// Words of a command line; quotes are not used in sessions.
fn words(typed: &str) -> Vec<&str> {
    let typed = typed
        .strip_prefix("cargo run --release -- ")
        .or(typed.strip_prefix("moiregauge "));
    let typed = typed.expect("sessions run the program and nothing else");
    assert!(!typed.contains(['\'', '"', '|', '>', '*']), "{typed}");
    typed.split_whitespace().collect()
}

/// Whether a line is what a pattern with `…` in it says.
fn fits(pattern: &str, line: &str) -> bool {
    let mut parts = pattern.trim_end().split('…');
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = line.trim_end().strip_prefix(first) else {
        return false;
    };
    let parts: Vec<&str> = parts.collect();
    let Some((last, middle)) = parts.split_last() else {
        return rest.is_empty();
    };
    for part in middle {
        let Some(at) = rest.find(part) else {
            return false;
        };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

/// Whether lines are what patterns say; a pattern `…` alone takes any number of lines.
fn all_fit(patterns: &[String], lines: &[&str]) -> bool {
    match patterns.split_first() {
        None => lines.iter().all(|line| line.trim().is_empty()),
        Some((pattern, others)) if pattern == "…" => {
            (0..=lines.len()).any(|n| all_fit(others, &lines[n..]))
        }
        Some((pattern, others)) => lines
            .split_first()
            .is_some_and(|(line, rest)| fits(pattern, line) && all_fit(others, rest)),
    }
}

fn run(step: &Step, folder: &Path, place: &str) {
    let output = Command::new(env!("CARGO_BIN_EXE_moiregauge"))
        .args(words(&step.typed))
        .current_dir(folder)
        .output()
        .expect("the program starts");
    let said = String::from_utf8(output.stdout).expect("UTF-8");
    let problem = String::from_utf8(output.stderr).expect("UTF-8");
    assert!(
        output.status.success(),
        "{place}: $ {}\n{problem}",
        step.typed
    );
    let lines: Vec<&str> = said.lines().collect();
    assert!(
        all_fit(&step.prints, &lines),
        "{place}: $ {}\n\nThe page says:\n{}\n\nIt prints:\n{said}",
        step.typed,
        step.prints.join("\n")
    );
}

#[test]
fn sessions_are_what_the_program_prints() {
    let mut run_steps = 0;
    for page in pages() {
        let (_, blocks) = parts(&read(&page));
        let place = page.strip_prefix(root()).unwrap_or(&page).display();
        let folder = tempfile::tempdir().expect("a folder");
        for (_, block) in blocks.iter().filter(|(word, _)| word == "console") {
            for step in steps(block) {
                run(&step, folder.path(), &place.to_string());
                run_steps += 1;
            }
        }
    }
    assert!(run_steps > 20, "{run_steps}");
}

#[test]
fn patterns_fit_what_they_say() {
    assert!(fits("a … c", "a b c"));
    assert!(fits("twist 1.13…", "twist 1.1300 ± 0.0011°"));
    assert!(!fits("twist 1.13…", "twist 1.12"));
    assert!(!fits("a", "a b"));
    let pattern = ["…", "b", "…"].map(str::to_owned);
    assert!(all_fit(&pattern, &["a", "b", "c"]));
    assert!(!all_fit(&pattern, &["a", "c"]));
}
