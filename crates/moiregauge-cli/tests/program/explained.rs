//! What caveats mean: `moiregauge explain`, its page, and that there are no others.

#[path = "../../../moiregauge/tests/science/sources/mod.rs"]
mod sources;

use std::path::{Path, PathBuf};

use serde_json::Value;

use self::sources::sources;
use crate::common::{program, run, succeed};

fn explain(options: &[&str]) -> String {
    succeed(program().arg("explain").args(options)).stdout
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn entries(options: &[&str]) -> Vec<Value> {
    serde_json::from_str(&explain(options)).expect("a list")
}

/// The codes of all.
fn codes() -> Vec<String> {
    let code = |entry: Value| entry["code"].as_str().expect("a code").to_owned();
    entries(&["--json"]).into_iter().map(code).collect()
}

#[test]
fn a_code_is_told_at_length() {
    let said = explain(&["drift-undetermined"]);
    for words in [
        "drift-undetermined: serious.",
        "Meaning: The drift cannot be determined from these scans",
        "What to do: Take frames up and down",
        "Options: --drift X Y",
    ] {
        assert!(said.contains(words), "{said}");
    }
    assert!(!explain(&["sensor-lag"]).contains("Options"));
}

#[test]
fn all_codes_have_one_line_each() {
    let said = explain(&[]);
    let codes = codes();
    assert_eq!(said.lines().count(), codes.len());
    for (line, code) in said.lines().zip(codes) {
        assert_eq!(line.split_whitespace().next(), Some(code.as_str()));
        assert!(line.ends_with('.'), "{line}");
    }
}

#[test]
fn one_or_all_are_told_to_programs() {
    let one = entries(&["sensor-lag", "--json"]);
    assert_eq!(one.len(), 1);
    assert_eq!(one[0]["severity"], "note");
    let mut keys: Vec<&String> = one[0].as_object().unwrap().keys().collect();
    keys.sort();
    assert_eq!(keys, ["code", "meaning", "severity", "what_to_do"]);
    let all = entries(&["--json"]);
    assert!(all.contains(&one[0]) && all.len() > 50);
}

#[test]
fn an_unknown_code_is_refused_with_the_nearest_ones() {
    let refused = run(program().args(["explain", "sensor-lagg"]));
    assert_eq!(refused.code, Some(1));
    assert!(
        refused
            .stderr
            .contains("\"sensor-lagg\"; the nearest are sensor-lag,"),
        "{}",
        refused.stderr
    );
}

/// `moiregauge explain --markdown > docs/caveats.md` makes it anew.
#[test]
fn the_page_of_the_documentation_is_up_to_date() {
    let page = std::fs::read_to_string(root().join("docs/caveats.md")).expect("the page");
    assert!(page.replace("\r\n", "\n") == explain(&["--markdown"]));
}

/// Codes stand in the table, and nowhere else: what a program steers by are the doubts themselves. The options that help
/// are found by code.
#[test]
fn codes_stand_in_the_table_alone() {
    let mut files = Vec::new();
    for part in [
        "moiregauge",
        "moiregauge-report",
        "moiregauge-pipeline",
        "moiregauge-cli",
    ] {
        files.extend(sources(&root().join("crates").join(part).join("src")));
    }
    assert!(files.len() > 100, "{}", files.len());
    let codes = codes();
    for file in files {
        if file.ends_with("hints.rs") || file.parent().is_some_and(|p| p.ends_with("caveat")) {
            continue;
        }
        let text = std::fs::read_to_string(&file).expect("a source");
        let text = text.split("#[cfg(test)]").next().unwrap_or_default();
        // Single words are codes as well as other things.
        for code in codes.iter().filter(|code| code.contains('-')) {
            let quoted = format!("\"{code}\"");
            assert!(!text.contains(&quoted), "{}: {code}", file.display());
        }
    }
}
