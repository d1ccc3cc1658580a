//! The page of constants has the values of the sources.

use std::path::{Path, PathBuf};

use crate::sources::sources;

/// The values of all definitions of a constant in a source.
fn values<'a>(text: &'a str, name: &str) -> impl Iterator<Item = &'a str> {
    let start = format!("const {name}: ");
    let after: Vec<&str> = text.split(&start).skip(1).collect();
    after
        .into_iter()
        .filter_map(|rest| Some(rest.split_once(" = ")?.1.split_once(';')?.0.trim()))
}

/// Whether a source is where the page says: the names of the place are among those of its path, in order.
fn is_at(source: &Path, place: &str) -> bool {
    let path = source.with_extension("");
    let mut parts = path.iter().filter_map(|part| part.to_str());
    place
        .split('/')
        .all(|wanted| parts.any(|part| part == wanted))
}

/// Rows are `| place::NAME | value | …`. Names and values have to stand in the sources, wherever the file is by now.
#[test]
fn the_page_has_the_values_of_the_sources() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("../../docs/constants.md")).expect("the page");
    let mut all = sources(&root.join("src"));
    all.extend(sources(&root.join("../heterostrain/src")));
    let texts: Vec<(&PathBuf, String)> = all
        .iter()
        .map(|path| (path, std::fs::read_to_string(path).expect("a source")))
        .collect();
    let mut rows = 0;
    for row in page.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = row.split('|').map(|c| c.trim().trim_matches('`')).collect();
        let (place, name) = cells[1].split_once("::").expect("a place and a name");
        let found: Vec<&str> = texts
            .iter()
            .filter(|(path, _)| is_at(path, place))
            .flat_map(|(_, text)| values(text, name))
            .collect();
        assert!(
            found.contains(&cells[2]),
            "{row}: the sources have {found:?}"
        );
        rows += 1;
    }
    assert!(rows >= 30, "{rows} rows");
}
