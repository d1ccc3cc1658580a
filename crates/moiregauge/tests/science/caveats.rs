//! The table of doubts: every code once, with a meaning and an advice in sentences.

use std::path::Path;

use crate::sources::sources;
use moiregauge::caveat::{Caveat, FileDoubt, Severity, explained};

#[test]
fn codes_are_kebab_case_and_unique() {
    let mut codes: Vec<&str> = explained().map(|e| e.code).collect();
    let letters = |c: char| c.is_ascii_lowercase() || c == '-';
    assert!(codes.iter().all(|code| code.chars().all(letters)));
    let all = codes.len();
    codes.sort_unstable();
    codes.dedup();
    assert_eq!(codes.len(), all);
}

/// In the terms of the field: options are those of a program.
#[test]
fn the_table_is_in_sentences_without_options() {
    for entry in explained() {
        for text in [entry.meaning, entry.what_to_do] {
            assert!(text.ends_with(['.', '?']), "{}: {text}", entry.code);
            assert!(!text.contains("--"), "{}: {text}", entry.code);
            assert!(!text.contains("  "), "{}: {text}", entry.code);
            assert!(text.len() > 15, "{}: {text}", entry.code);
        }
    }
}

#[test]
fn a_doubt_has_the_entry_of_its_own() {
    let caveat = Caveat::new(FileDoubt::EverythingExcluded { scans: 4 }, "analysis");
    assert_eq!(caveat.code(), "everything-excluded");
    assert_eq!(caveat.severity(), Severity::Serious);
    assert_eq!(
        caveat.message(),
        "no scan is left to analyse: the user excluded all 4 scans"
    );
}

/// Words of the library do not name options: a front end adds those that it has.
#[test]
fn the_library_names_no_options() {
    let files = sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    for path in &files {
        let text = std::fs::read_to_string(path).expect("a source");
        for line in text.lines().filter(|l| !l.trim_start().starts_with("//")) {
            let after = line.split("--").skip(1);
            let named = after.filter(|rest| rest.starts_with(|c: char| c.is_ascii_lowercase()));
            assert_eq!(named.count(), 0, "{}: {line}", path.display());
        }
    }
    assert!(files.len() > 100, "{}", files.len());
}
