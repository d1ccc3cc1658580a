//! The rooms of the core stand on floors: each takes from those below it, never from those above.

use std::collections::BTreeMap;
use std::path::Path;

use crate::sources::sources;

/// From the top floor down, as in DESIGN.md.
const FLOORS: [&[&str]; 13] = [
    &["survey"],
    &["campaign", "plan"],
    &["scan", "meaning"],
    &["domains"],
    &["region", "stripes"],
    &["map"],
    &["window", "drift"],
    &["settings", "caveat"],
    &["lattice", "calibration"],
    &["coverage", "explain"],
    &["spectrum", "simulate"],
    &["frame"],
    &["numbers"],
];

fn floor(room: &str) -> usize {
    let found = FLOORS.iter().position(|rooms| rooms.contains(&room));
    found.unwrap_or_else(|| {
        panic!("{room} has no floor: DESIGN.md and this list say where it stands")
    })
}

/// The paths within the crate that the code of a source names, but for its tests and comments.
fn paths(text: &str) -> impl Iterator<Item = &str> {
    let code = text.split("#[cfg(test)]\nmod").next().unwrap_or_default();
    let lines = code
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default());
    lines
        .flat_map(|line| line.split("crate::").skip(1))
        .filter_map(|rest| {
            rest.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'))
                .next()
        })
}

/// The rooms that they are of.
fn named(text: &str) -> Vec<&str> {
    paths(text)
        .filter_map(|path| path.split("::").next())
        .filter(|room| room.starts_with(char::is_lowercase))
        .collect()
}

#[test]
fn no_room_takes_from_one_above_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let all = sources(&root);
    let (mut seen, mut wrong) = (0, Vec::new());
    for path in all.iter().filter(|path| !path.ends_with("tests.rs")) {
        let inside = path
            .strip_prefix(&root)
            .expect("a source")
            .with_extension("");
        let own = inside
            .iter()
            .next()
            .and_then(|part| part.to_str())
            .expect("a room");
        if own == "lib" {
            continue;
        }
        let text = std::fs::read_to_string(path).expect("a source");
        for room in named(&text).into_iter().filter(|room| *room != own) {
            seen += 1;
            if floor(room) <= floor(own) {
                wrong.push(format!("{}: {room}", inside.display()));
            }
        }
    }
    assert!(seen > 300, "{seen} imports");
    assert!(
        wrong.is_empty(),
        "these take from a room that is not below: {wrong:#?}"
    );
}

/// A file that takes from another one, by its path, is not taken from by that one, nor by what that one takes from.
#[test]
fn no_files_take_from_each_other() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let name = |path: &Path| {
        let inside = path
            .strip_prefix(&root)
            .expect("a source")
            .with_extension("");
        let parts: Vec<&str> = inside.iter().filter_map(|part| part.to_str()).collect();
        parts.join("::")
    };
    let mut left: BTreeMap<String, String> = sources(&root)
        .iter()
        .filter(|path| !path.ends_with("tests.rs"))
        .map(|path| (name(path), std::fs::read_to_string(path).expect("a source")))
        .collect();
    assert!(left.len() > 200, "{} sources", left.len());
    // Files that take from none that is left are put aside, until all are or a circle stays.
    loop {
        let file = |path: &str| {
            let mut path = path.trim_end_matches(':');
            while !left.contains_key(path) {
                path = path.rsplit_once("::")?.0;
            }
            Some(path.to_owned())
        };
        let takes = |own: &str, text: &str| paths(text).filter_map(file).any(|of| of != own);
        let free: Vec<String> = left
            .iter()
            .filter(|(own, text)| !takes(own, text))
            .map(|(own, _)| own.clone())
            .collect();
        if free.is_empty() {
            break;
        }
        left.retain(|own, _| !free.contains(own));
    }
    let circle: Vec<&String> = left.keys().collect();
    assert!(circle.is_empty(), "in a circle, or above one: {circle:#?}");
}
