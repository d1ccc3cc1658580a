//! Reading the pages, and asking the program.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The root of the sources.
pub(crate) fn root() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    root.canonicalize().expect("the root")
}

/// A file, by its path from the root.
pub(crate) fn read(path: &Path) -> String {
    let text = std::fs::read_to_string(path);
    text.unwrap_or_else(|e| panic!("{}: {e}", path.display()))
        .replace("\r\n", "\n")
}

/// Every page: README, DESIGN, CONTRIBUTING, and what is in docs/.
pub(crate) fn pages() -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = ["README.md", "DESIGN.md", "CONTRIBUTING.md"]
        .map(|name| root().join(name))
        .into();
    below(&root().join("docs"), &mut found);
    found.retain(|path| path.extension().is_some_and(|e| e == "md"));
    assert!(found.len() > 60, "{}", found.len());
    found
}

/// All files below a folder.
pub(crate) fn below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            below(&path, found);
        } else {
            found.push(path);
        }
    }
    found.sort();
}

/// A page without its fenced blocks, and the blocks with the word behind the fence.
pub(crate) fn parts(text: &str) -> (String, Vec<(String, String)>) {
    let (mut prose, mut blocks) = (String::new(), Vec::new());
    let mut open: Option<(String, String)> = None;
    for line in text.lines() {
        match (line.trim_start().strip_prefix("```"), open.take()) {
            (Some(word), None) => open = Some((word.trim().to_owned(), String::new())),
            (Some(_), Some(block)) => blocks.push(block),
            (None, Some((word, body))) => open = Some((word, body + line + "\n")),
            (None, None) => {
                prose.push_str(line);
                prose.push('\n');
            }
        }
    }
    assert!(open.is_none(), "a block is not closed");
    (prose, blocks)
}

/// What stands between backticks, line by line.
pub(crate) fn spans(prose: &str) -> Vec<&str> {
    let lines = prose.lines();
    lines
        .flat_map(|line| line.split('`').skip(1).step_by(2))
        .collect()
}

/// What the program prints.
pub(crate) fn says(words: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_moiregauge"))
        .args(words)
        .output()
        .expect("the program starts");
    assert!(output.status.success(), "{words:?}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// The commands of the program: they stand under headings, indented by two.
pub(crate) fn commands() -> Vec<String> {
    let help = says(&["help"]);
    let list = help.split("\nOptions:").next().expect("a list");
    let names = list
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names: Vec<String> = names
        .filter_map(|line| line.split_whitespace().next())
        .map(str::to_owned)
        .collect();
    assert!(names.len() > 10, "{names:?}");
    names
}

/// The options of a command: the names at the beginning of the entries of its help.
pub(crate) fn options(command: &str) -> BTreeSet<String> {
    let help = says(&[command, "--help"]);
    // Descriptions stand further to the right.
    let entries = help.lines().filter(|line| {
        let entry = line.trim_start();
        entry.starts_with('-') && line.len() - entry.len() <= 6
    });
    entries
        .filter_map(|line| long_options(line).next())
        .collect()
}

/// All `--names` in a text.
pub(crate) fn long_options(text: &str) -> impl Iterator<Item = String> + '_ {
    let starts = text.match_indices("--").map(|(at, _)| at);
    starts.filter_map(move |at| {
        let before = text[..at].chars().next_back();
        let name: String = text[at + 2..]
            .chars()
            .take_while(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || *c == '-')
            .collect();
        let begins = before.is_none_or(|c| !(c.is_alphanumeric() || c == '-'));
        let is_name = name.starts_with(|c: char| c.is_ascii_lowercase());
        (begins && is_name).then(|| format!("--{name}"))
    })
}
