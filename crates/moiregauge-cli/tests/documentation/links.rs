//! Links inside the pages lead somewhere, and what they say of the sources is there.

use std::path::Path;

use crate::pages::{pages, parts, read, root};

/// Targets of `[text](target)` and `![text](target)`.
fn targets(prose: &str) -> Vec<&str> {
    let ends = prose.match_indices("](").map(|(at, _)| &prose[at + 2..]);
    ends.filter_map(|rest| rest.split(')').next()).collect()
}

/// The anchor of a heading, as GitHub and the site make it.
fn anchor(heading: &str) -> String {
    let text = heading
        .trim_start_matches('#')
        .trim()
        .replace('`', "")
        .to_lowercase();
    text.chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c))
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

/// Pages of the gallery are made of scripts.
fn exists(path: &Path) -> bool {
    let text = path.to_string_lossy();
    let Some((docs, page)) = text.split_once("docs/examples/") else {
        return path.exists();
    };
    let script = if page == "index.rst" {
        "README.rst".to_owned()
    } else {
        page.replace(".rst", ".py")
    };
    Path::new(docs).join("docs/gallery").join(script).exists()
}

#[test]
fn links_lead_somewhere() {
    let mut checked = 0;
    for page in pages() {
        let (prose, _) = parts(&read(&page));
        for target in targets(&prose) {
            if target.contains("://") || target.starts_with("mailto:") {
                continue;
            }
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let path = if file.is_empty() {
                page.clone()
            } else {
                plain(&page.parent().expect("a folder").join(file))
            };
            let place = page.display();
            assert!(exists(&path), "{place}: {target}");
            checked += 1;
            if !heading.is_empty() && path.extension().is_some_and(|e| e == "md") {
                let (prose, _) = parts(&read(&path));
                let mut headings = prose.lines().filter(|line| line.starts_with('#'));
                assert!(
                    headings.any(|line| anchor(line) == heading),
                    "{place}: {target} has no such heading"
                );
            }
        }
    }
    assert!(checked > 300, "{checked}");
}

/// A path without `..` in it.
fn plain(path: &Path) -> std::path::PathBuf {
    let mut plain = std::path::PathBuf::new();
    for part in path.components() {
        if part.as_os_str() == ".." {
            plain.pop();
        } else {
            plain.push(part);
        }
    }
    plain
}

/// Theory pages name files, and functions and tests in them: `` `crates/…rs`: `name`, `name` ``.
#[test]
fn named_functions_and_tests_are_there() {
    let mut checked = 0;
    for page in pages() {
        for line in read(&page).lines().filter(|line| line.contains("`crates/")) {
            let mut source: Option<String> = None;
            let mut between = String::new();
            for (i, part) in line.split('`').enumerate() {
                if i % 2 == 0 {
                    between = part.to_owned();
                } else if part.starts_with("crates/")
                    && Path::new(part).extension().is_some_and(|e| e == "rs")
                    && !part.contains("NAME")
                {
                    let path = root().join(part);
                    assert!(path.exists(), "{}: {part}", page.display());
                    source = Some(read(&path));
                } else if let Some(text) = &source
                    && (between == ": " || between == ", ")
                {
                    let found = text.contains(&format!("fn {part}("))
                        || text.contains(&format!("fn {part}<"));
                    assert!(found, "{}: {part} in {line}", page.display());
                    checked += 1;
                } else {
                    source = None;
                }
            }
        }
    }
    assert!(checked > 60, "{checked}");
}
