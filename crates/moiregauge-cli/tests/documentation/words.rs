//! Options, keys, settings and caveats: each is in the documentation, and none that the program does not have.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::pages::{below, commands, long_options, options, pages, parts, read, root, says, spans};

const RENEW: &str = "renew it: python3 docs/generate.py target/release/moiregauge .";

/// Options of other programs, and those that help does not show.
const OTHERS: [&str; 7] = [
    "--workspace",
    "--release",
    "--example",
    "--test",
    "--no-default-features",
    "--markdown",
    "--locked",
];

#[test]
fn every_option_is_on_the_page_of_its_command() {
    for command in commands() {
        let path = root().join(format!("docs/reference/commands/{command}.md"));
        let page = read(&path);
        let entries = page.lines().filter(|line| line.starts_with("`-"));
        let shown: BTreeSet<String> = entries
            .filter_map(|line| long_options(line).next())
            .collect();
        assert_eq!(shown, options(&command), "{command}: {RENEW}");
    }
}

#[test]
fn every_command_has_a_page() {
    let folder = root().join("docs/reference/commands");
    let names = std::fs::read_dir(folder).expect("the pages");
    let mut names: Vec<String> = names
        .map(|entry| entry.expect("an entry").path())
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .filter(|name| name != "index")
        .collect();
    names.sort();
    let mut wanted = commands();
    wanted.sort();
    assert_eq!(names, wanted, "{RENEW}");
}

/// Where the schema of a document lies.
fn schema_of(name: &str) -> PathBuf {
    root().join(format!(
        "crates/moiregauge-report/schema/{name}-1.schema.json"
    ))
}

/// Keys of all objects of a schema.
fn keys(schema: &Value) -> BTreeSet<String> {
    let parts = schema["$defs"].as_object().expect("parts").values();
    let objects = parts.flat_map(|part| match part["oneOf"].as_array() {
        Some(forms) => forms.iter().collect(),
        None => vec![part],
    });
    let objects = objects.chain([schema]);
    let properties = objects.filter_map(|object| object["properties"].as_object());
    properties.flat_map(|p| p.keys().cloned()).collect()
}

#[test]
fn every_key_of_the_documents_is_on_their_pages() {
    for name in ["results", "map", "watch"] {
        let schema: Value = serde_json::from_str(&read(&schema_of(name))).expect("a schema");
        let page = read(&root().join(format!("docs/reference/{name}.md")));
        let rows = page.lines().filter_map(|line| line.strip_prefix("| `"));
        // A row begins with a key, or with the keys of one form of a choice.
        let shown: BTreeSet<String> = rows
            .map(|row| row.split('`').next().unwrap_or_default())
            .filter(|key| !key.starts_with('"'))
            .map(str::to_owned)
            .collect();
        assert_eq!(shown, keys(&schema), "{name}: {RENEW}");
    }
}

/// Names of settings in a commented file.
fn settings(text: &str) -> BTreeSet<&str> {
    let names = text.lines().filter_map(|line| line.split_once(" = "));
    let names = names.map(|(name, _)| name.trim_start_matches(['#', ' ']));
    names
        .filter(|name| name.chars().all(|c| c.is_ascii_lowercase() || c == '_'))
        .collect()
}

#[test]
fn every_setting_is_on_the_page_of_settings() {
    let page = read(&root().join("docs/reference/settings.md"));
    let config = says(&["config"]);
    assert!(settings(&config).len() > 20);
    assert_eq!(settings(&page), settings(&config), "{RENEW}");
}

/// A command line that stands in a page: the command, and its options.
fn typed(line: &str) -> Option<(&str, Vec<String>)> {
    let line = line.trim_start().trim_start_matches("$ ");
    let words = line.strip_prefix("moiregauge ")?;
    let words = words.split(['#', '|', ';', '>']).next()?;
    let command = words.split_whitespace().next()?;
    command
        .chars()
        .all(|c| c.is_ascii_lowercase())
        .then(|| (command, long_options(words).collect()))
}

#[test]
fn pages_name_no_option_that_does_not_exist() {
    let known: BTreeMap<String, BTreeSet<String>> = commands()
        .into_iter()
        .map(|c| (c.clone(), options(&c)))
        .collect();
    let any: BTreeSet<&String> = known.values().flatten().collect();
    let mut lines = 0;
    for page in pages() {
        let text = read(&page);
        let (prose, blocks) = parts(&text);
        let place = page.display();
        let mut check = |line: &str| {
            let Some((command, given)) = typed(line) else {
                return;
            };
            lines += 1;
            if command == "help" {
                return;
            }
            let Some(options) = known.get(command) else {
                panic!("{place}: there is no command {command:?}: {line}");
            };
            for option in given {
                let hidden = OTHERS.contains(&option.as_str());
                assert!(
                    hidden || options.contains(&option),
                    "{place}: {option} in {line}"
                );
            }
        };
        for (_, body) in &blocks {
            body.lines().for_each(&mut check);
        }
        for span in spans(&prose) {
            check(span);
            if span.starts_with("--") {
                for option in long_options(span) {
                    let hidden = OTHERS.contains(&option.as_str());
                    assert!(hidden || any.contains(&option), "{place}: {option}");
                }
            }
        }
    }
    assert!(lines > 100, "{lines}");
}

/// Words with a hyphen between backticks are codes of caveats, or words that the reference has.
#[test]
fn pages_name_no_caveat_that_does_not_exist() {
    let entries: Vec<Value> = serde_json::from_str(&says(&["explain", "--json"])).expect("a list");
    let codes: BTreeSet<&str> = entries.iter().filter_map(|e| e["code"].as_str()).collect();
    let caveats = read(&root().join("docs/caveats.md"));
    for code in &codes {
        assert!(
            caveats.contains(&format!("| `{code}` |")),
            "{code}: {RENEW}"
        );
    }
    let mut reference = says(&["simulate", "--list-samples"]);
    for command in commands() {
        reference += &says(&[&command, "--help"]);
    }
    reference += &says(&["config"]);
    for name in ["results", "map", "watch"] {
        reference += &read(&schema_of(name));
    }
    let is_code = |span: &str| {
        span.contains('-')
            && span.starts_with(|c: char| c.is_ascii_lowercase())
            && span
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-')
    };
    let mut seen = 0;
    for page in pages() {
        let (prose, _) = parts(&read(&page));
        for span in spans(&prose).into_iter().filter(|span| is_code(span)) {
            let is_crate = root().join("crates").join(span).is_dir();
            seen += usize::from(codes.contains(span));
            assert!(
                codes.contains(span) || reference.contains(span) || is_crate,
                "{}: {span:?} is neither the code of a caveat nor a word of the program",
                page.display()
            );
        }
    }
    assert!(seen > codes.len(), "{seen}");
}

/// The site takes a line that begins with a per cent sign for a comment, and leaves it out.
#[test]
fn no_line_begins_as_a_comment() {
    for page in pages() {
        let text = read(&page);
        let (prose, _) = parts(&text);
        for line in prose.lines() {
            assert!(
                !line.trim_start().starts_with('%'),
                "{}: {line}",
                page.display()
            );
        }
    }
}

/// Words, but for numbers and marks alone.
fn words(text: &str) -> usize {
    let all = text.split_whitespace();
    all.filter(|word| word.contains(char::is_alphanumeric))
        .count()
}

/// Pages that the program makes do not count, nor do the tables of formats.
fn is_written(path: &Path) -> bool {
    !read(path).starts_with("<!-- Made by") && !path.ends_with("docs/caveats.md")
}

#[test]
fn the_pages_are_short() {
    let count = |name: &str| words(&read(&root().join(name)));
    assert!(count("README.md") <= 700, "{}", count("README.md"));
    assert!(count("DESIGN.md") <= 2500, "{}", count("DESIGN.md"));
    let all = pages().into_iter().filter(|path| is_written(path));
    let total: usize = all.map(|path| words(&read(&path))).sum();
    assert!((10_000..=30_000).contains(&total), "{total} words");
}

/// Words that no textbook of the field has: the glossary has others.
const STRANGE: [&str; 8] = [
    "torn",
    "hollow",
    "says of",
    "said of",
    "is none",
    "are none",
    "so many",
    "outshines",
];

/// A word of [`STRANGE`] in a text, but for `there is none`.
fn strange(text: &str) -> Option<&'static str> {
    let text = text.to_lowercase();
    let marks = |word: &&str| !matches!(*word, "///" | "//!" | "//");
    let text: Vec<&str> = text.split_whitespace().filter(marks).collect();
    let text = text.join(" ");
    STRANGE.into_iter().find(|word| {
        text.match_indices(word).any(|(at, _)| {
            let before = &text[..at];
            let after = text[at + word.len()..].chars().next();
            let inside = [before.chars().next_back(), after];
            let ordinary = word.ends_with("none") && before.ends_with("there ");
            !ordinary && !inside.iter().flatten().any(|c| c.is_alphanumeric())
        })
    })
}

#[test]
fn pages_and_sources_speak_the_language_of_the_field() {
    assert_eq!(strange("as\n/// so many\n/// times"), Some("so many"));
    assert_eq!(strange("where there is none, somehow thorn"), None);
    for page in pages().into_iter().filter(|path| is_written(path)) {
        assert_eq!(strange(&read(&page)), None, "{}", page.display());
    }
    let mut sources = Vec::new();
    below(&root().join("crates"), &mut sources);
    sources.retain(|path| path.extension().is_some_and(|e| e == "rs"));
    sources.retain(|path| !path.ends_with("documentation/words.rs"));
    assert!(sources.len() > 300, "{}", sources.len());
    for source in sources {
        assert_eq!(strange(&read(&source)), None, "{}", source.display());
    }
}

/// Parts of names for which the glossary has another term.
const REPLACED: [&str; 13] = [
    "hollow",
    "leftover",
    "misfits",
    "outshines",
    "patch",
    "plainest",
    "sighting",
    "sightings",
    "stands_out",
    "strangers",
    "told",
    "torn",
    "towers",
];

/// The name of the public item that a line begins, in small letters with underlines.
fn public_name(line: &str) -> Option<String> {
    let rest = line.trim_start().strip_prefix("pub ")?;
    let kinds = [
        "fn ",
        "const fn ",
        "struct ",
        "enum ",
        "const ",
        "static ",
        "type ",
        "mod ",
        "trait ",
    ];
    let named = kinds
        .iter()
        .find_map(|kind| rest.trim_start().strip_prefix(kind));
    let name = named?.split(|c: char| !(c.is_alphanumeric() || c == '_'));
    let mut small = String::new();
    for c in name.map(str::trim).find(|name| !name.is_empty())?.chars() {
        if c.is_uppercase() && small.ends_with(|c: char| c.is_lowercase()) {
            small.push('_');
        }
        small.extend(c.to_lowercase());
    }
    Some(small)
}

#[test]
fn public_names_are_terms_of_the_glossary() {
    let replaced = |line: &str| {
        let name = format!("_{}_", public_name(line)?);
        REPLACED
            .into_iter()
            .find(|part| name.contains(&format!("_{part}_")))
    };
    assert_eq!(
        replaced("    pub fn is_torn(&self) -> bool {"),
        Some("torn")
    );
    assert_eq!(replaced("pub struct LatticePatch {"), Some("patch"));
    assert_eq!(replaced("pub(crate) fn told() {"), None);
    let mut sources = Vec::new();
    below(&root().join("crates"), &mut sources);
    sources.retain(|path| path.extension().is_some_and(|e| e == "rs"));
    sources.retain(|path| !path.ends_with("documentation/words.rs"));
    for source in sources {
        for line in read(&source).lines() {
            assert_eq!(replaced(line), None, "{}: {line}", source.display());
        }
    }
}
