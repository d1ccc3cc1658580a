//! Which samples there are: one folder each, or as a table says.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use moiregauge_report::FailedInput;

use super::error::{SamplesError, at};
use crate::find::{find, holds_scans};
use crate::names::in_words;
use crate::reading::read_text;
use crate::sink::{MANIFEST, Manifest, UNFINISHED};

/// One sample: its name and where its scans are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sample {
    /// Its name, unique among all.
    pub name: String,
    /// Files, folders and wildcards.
    pub(super) paths: Vec<PathBuf>,
}

/// The files of a sample under the names that results know them by: seen from the folder of all samples.
#[derive(Debug, Default)]
pub(super) struct SampleFiles {
    /// Name and place of each.
    pub(super) files: Vec<(String, PathBuf)>,
    pub(super) failed: Vec<FailedInput>,
}

impl Sample {
    /// Looks for its files.
    pub(super) fn files(&self, root: &Path) -> SampleFiles {
        let (files, failed) = find(&self.paths).frames();
        // No place on this machine is in results.
        let root_words = in_words(root);
        let here = root_words.trim_end_matches(['/', '\\']);
        let inside = |words: &str| {
            if here.is_empty() {
                return words.to_owned();
            }
            let inside = words.replace(&format!("{here}/"), "");
            inside.replace(&format!("{here}\\"), "")
        };
        let failed = failed.into_iter().map(|failed| FailedInput {
            file: inside(&failed.file),
            error: inside(&failed.error),
        });
        SampleFiles {
            files: files.into_iter().map(|f| (name(root, &f), f)).collect(),
            failed: failed.collect(),
        }
    }
}

/// A path as seen from the folder of all samples, parts divided by `/`; that folder itself is `.`.
fn name(root: &Path, path: &Path) -> String {
    let inside = path.strip_prefix(root).unwrap_or(path);
    // What lies elsewhere is named without the way up to it.
    let parts = inside
        .components()
        .filter(|part| matches!(part, Component::Normal(_)))
        .map(|p| in_words(p.as_os_str().as_ref()));
    let name = parts.collect::<Vec<_>>().join("/");
    if name.is_empty() {
        ".".to_owned()
    } else {
        name
    }
}

/// Every folder below `root`, and `root` itself, that holds scans: one sample each, sorted by name. Folders of results,
/// `leave` and hidden ones are left alone.
///
/// # Errors
/// A folder cannot be read; there are no scans at all.
pub fn samples_in(root: &Path, leave: &Path) -> Result<Vec<Sample>, SamplesError> {
    let mut found = Vec::new();
    let leave = real(leave).ok();
    walk(root, root, leave.as_deref(), &mut Vec::new(), &mut found)?;
    if found.is_empty() {
        return Err(SamplesError::NoSamples(root.to_owned()));
    }
    found.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(found)
}

/// Where a folder is, without links; in memory there are none.
fn real(folder: &Path) -> std::io::Result<PathBuf> {
    if cfg!(target_family = "wasm") {
        return Ok(folder.to_owned());
    }
    folder.canonicalize()
}

/// Looks through a folder; `above` are the folders above it, lest links lead round in circles.
fn walk(
    root: &Path,
    folder: &Path,
    leave: Option<&Path>,
    above: &mut Vec<PathBuf>,
    found: &mut Vec<Sample>,
) -> Result<(), SamplesError> {
    let real = real(folder).map_err(at(folder))?;
    if Some(real.as_path()) == leave || above.contains(&real) || holds_results(folder) {
        return Ok(());
    }
    let mut folders = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(at(folder))? {
        let entry = entry.map_err(at(folder))?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let hidden = name.starts_with('.') || name.starts_with(UNFINISHED);
        if !hidden && entry.path().is_dir() {
            folders.push(entry.path());
        }
    }
    if holds_scans(folder) {
        found.push(Sample {
            name: name(root, folder),
            paths: vec![folder.to_owned()],
        });
    }
    above.push(real);
    folders.sort();
    for folder in folders {
        walk(root, &folder, leave, above, found)?;
    }
    above.pop();
    Ok(())
}

/// Whether a run has written results here; scans of the simulator are no results.
fn holds_results(folder: &Path) -> bool {
    folder.join(MANIFEST).is_file()
        && Manifest::read(folder).is_ok_and(|m| m.is_some_and(|m| m.kind != "simulate"))
}

/// The samples that a table names: CSV with the columns `sample` and `path` (files, folders or names with wildcards,
/// seen from `root`); several lines of one name are one sample.
///
/// # Errors
/// The table cannot be read or understood.
pub fn samples_of_table(table: &Path, root: &Path) -> Result<Vec<Sample>, SamplesError> {
    let text = read_text(table).map_err(|source| SamplesError::Table {
        path: table.to_owned(),
        source,
    })?;
    let wrong = |line: usize, reason: String| SamplesError::TableLine {
        path: table.to_owned(),
        line,
        reason,
    };
    let mut lines = text.trim_start_matches('\u{feff}').lines().zip(1..);
    let (head, _) = lines.next().unwrap_or_default();
    let head: Vec<String> = fields(head).iter().map(|f| f.to_lowercase()).collect();
    let column = |wanted: &str| {
        let found = head.iter().position(|name| name == wanted);
        found.ok_or_else(|| {
            wrong(
                1,
                format!(
                    "expected the columns sample and path, found {}",
                    head.join(", ")
                ),
            )
        })
    };
    let [sample, path] = [column("sample")?, column("path")?];
    let mut all: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for (line, number) in lines.filter(|(line, _)| !line.trim().is_empty()) {
        let fields = fields(line);
        let (Some(name), Some(path)) = (fields.get(sample), fields.get(path)) else {
            return Err(wrong(
                number,
                format!("expected {} fields, found {}", head.len(), fields.len()),
            ));
        };
        if name.is_empty() || path.is_empty() {
            return Err(wrong(number, "expected a name and a path".to_owned()));
        }
        all.entry(name.clone()).or_default().push(root.join(path));
    }
    if all.is_empty() {
        return Err(SamplesError::NoSamples(table.to_owned()));
    }
    let all = all.into_iter();
    Ok(all.map(|(name, paths)| Sample { name, paths }).collect())
}

/// The fields of a line of RFC 4180, within one line; blanks around them do not count.
fn fields(line: &str) -> Vec<String> {
    let (mut fields, mut field, mut quoted) = (Vec::new(), String::new(), false);
    let mut signs = line.chars().peekable();
    while let Some(sign) = signs.next() {
        match sign {
            '"' if quoted && signs.next_if_eq(&'"').is_some() => field.push('"'),
            '"' => quoted = !quoted,
            ',' | ';' | '\t' if !quoted => fields.push(std::mem::take(&mut field)),
            other => field.push(other),
        }
    }
    fields.push(field);
    fields.iter().map(|f| f.trim().to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCAN: &[u8] = b":NANONIS_VERSION:\n2\n";

    fn tree() -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for file in [
            "b/1.sxm",
            "a/x/1.sxm",
            "a/x/2.sxm",
            "a/notes/n.txt",
            ".h/1.sxm",
            "r/1.sxm",
        ] {
            let path = root.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, SCAN).unwrap();
        }
        std::fs::write(root.path().join("a/notes/n.txt"), "x").unwrap();
        let list = r#"{"schema":"moiregauge/files/1","program":"p","kind":"analyze","files":[]}"#;
        std::fs::write(root.path().join("r").join(MANIFEST), list).unwrap();
        root
    }

    fn names(samples: &[Sample]) -> Vec<&str> {
        samples.iter().map(|s| s.name.as_str()).collect()
    }

    #[test]
    fn folders_with_scans_are_samples() {
        let root = tree();
        let found = samples_in(root.path(), &root.path().join("out")).unwrap();
        assert_eq!(names(&found), ["a/x", "b"]);
        let files = found[0].files(root.path());
        let files: Vec<&str> = files.files.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(files, ["a/x/1.sxm", "a/x/2.sxm"]);
        let found = samples_in(root.path(), &root.path().join("b")).unwrap();
        assert_eq!(names(&found), ["a/x"]);
        let none = samples_in(&root.path().join("a/notes"), Path::new("")).unwrap_err();
        assert!(none.to_string().starts_with("no scans in"), "{none}");
    }

    #[cfg(unix)]
    #[test]
    fn links_do_not_lead_round_in_circles() {
        let root = tree();
        std::os::unix::fs::symlink(root.path(), root.path().join("a/loop")).unwrap();
        let found = samples_in(root.path(), Path::new("")).unwrap();
        assert_eq!(names(&found), ["a/x", "b"]);
    }

    #[test]
    fn tables_name_samples() {
        let root = tree();
        let table = root.path().join("t.csv");
        let text = "path,Sample\r\nb,two\r\n\"a/x/1.sxm\",\"the, first\"\r\n\r\na/x/2.sxm,\"the, first\"\r\n";
        std::fs::write(&table, text).unwrap();
        let found = samples_of_table(&table, root.path()).unwrap();
        assert_eq!(names(&found), ["the, first", "two"]);
        assert_eq!(found[0].files(root.path()).files.len(), 2);
        std::fs::write(&table, "sample,file\na,b\n").unwrap();
        let error = samples_of_table(&table, root.path())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("line 1: expected the columns sample and path"),
            "{error}"
        );
        std::fs::write(&table, "sample,path\na\n").unwrap();
        let error = samples_of_table(&table, root.path())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("line 2: expected 2 fields, found 1"),
            "{error}"
        );
    }
}
