//! The rooms of the core stand on floors: each takes from those below it, never from those above.

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

/// The rooms that the code of a source names, but for its tests and comments.
fn named(text: &str) -> Vec<&str> {
    let code = text.split("#[cfg(test)]\nmod").next().unwrap_or_default();
    let lines = code
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default());
    lines
        .flat_map(|line| line.split("crate::").skip(1))
        .map(|rest| {
            rest.split(|c: char| !(c.is_alphanumeric() || c == '_'))
                .next()
        })
        .map(Option::unwrap_or_default)
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
