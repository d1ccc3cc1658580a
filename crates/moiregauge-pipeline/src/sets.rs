//! Sets made by hand: which files belong to which.

use std::path::{Component, Path, PathBuf};

use moiregauge_report::results::NamedSet;

use crate::session::file_of;

/// A set made by hand that has no file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SetError {
    /// Nothing lies under its path.
    #[error(
        "the set {name:?} should hold the files under {path}, but none of the {inputs} inputs lies there{}",
        .first.as_ref().map_or(String::new(), |first| format!(": expected a folder or file among them, the first of which is {first}"))
    )]
    Empty {
        /// Its name.
        name: String,
        /// Its path.
        path: String,
        /// Number of inputs.
        inputs: usize,
        /// The first of them.
        first: Option<String>,
    },
    /// All its files belong to sets named before.
    #[error("the set {name:?} has no files: all files under {path} belong to sets named before it")]
    Taken {
        /// Its name.
        name: String,
        /// Its path.
        path: String,
    },
}

/// The path from the root, without `.`, `..` and separators at its end. Links are not followed.
#[must_use]
pub fn absolute(path: &Path) -> PathBuf {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut plain = PathBuf::new();
    for part in whole.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                plain.pop();
            }
            other => plain.push(other),
        }
    }
    plain
}

/// The first set that has the file.
pub fn set_of<'a>(sets: &'a [NamedSet], file: &Path) -> Option<&'a str> {
    let file = absolute(file_of(file));
    let found = sets
        .iter()
        .find(|set| file.starts_with(absolute(Path::new(&set.path))));
    found.map(|set| set.name.as_str())
}

/// Refuses sets that get no file.
///
/// # Errors
/// The first of them.
pub fn check_sets(sets: &[NamedSet], inputs: &[PathBuf]) -> Result<(), SetError> {
    for (number, set) in sets.iter().enumerate() {
        let under = |file: &&PathBuf| set_of(std::slice::from_ref(set), file).is_some();
        let mut own = inputs.iter().filter(under).peekable();
        if own.peek().is_none() {
            return Err(SetError::Empty {
                name: set.name.clone(),
                path: set.path.clone(),
                inputs: inputs.len(),
                first: inputs.first().map(|f| f.display().to_string()),
            });
        }
        if own.all(|file| set_of(&sets[..number], file).is_some_and(|name| name != set.name)) {
            return Err(SetError::Taken {
                name: set.name.clone(),
                path: set.path.clone(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(name: &str, path: &str) -> NamedSet {
        NamedSet {
            name: name.to_owned(),
            path: path.to_owned(),
        }
    }

    #[test]
    fn paths_are_the_same_however_they_are_spelt() {
        let file = Path::new("s/scan.000");
        for path in ["s", "./s", "s/", "s/.", "t/../s", "s/scan.000", "."] {
            assert_eq!(set_of(&[set("a", path)], file), Some("a"), "{path}");
        }
        let whole = absolute(file);
        assert_eq!(set_of(&[set("a", "./s")], &whole), Some("a"));
        for path in ["t", "s/scan", "s/scan.000/x", "S2"] {
            assert_eq!(set_of(&[set("a", path)], file), None, "{path}");
        }
    }

    #[test]
    fn sets_without_files_are_refused() {
        let inputs = ["a/1", "a/2", "b/1"].map(PathBuf::from);
        assert_eq!(
            check_sets(&[set("x", "./a/"), set("y", "b")], &inputs),
            Ok(())
        );
        // One name for two folders is one set.
        assert_eq!(
            check_sets(&[set("x", "a"), set("x", "a/1")], &inputs),
            Ok(())
        );
        let error = check_sets(&[set("x", "a"), set("y", "c")], &inputs).unwrap_err();
        let words = error.to_string();
        assert!(words.contains("\"y\"") && words.contains("a/1"), "{words}");
        let error = check_sets(&[set("x", "."), set("y", "b")], &inputs).unwrap_err();
        assert!(matches!(error, SetError::Taken { name, .. } if name == "y"));
    }
}
