//! Names of files, folders and wildcards → files to read.
//!
//! Of a folder the scans are taken, without subfolders. What looks like one, by its first bytes or by its name, and
//! cannot be used is named with the reason; everything else is left alone and counted.

use std::fmt;
use std::path::{Path, PathBuf};

use moiregauge_report::FailedInput;
use spmfile::{Format, detect, named_like_scan};

use crate::names::in_words;
use crate::reading;
use crate::session::{channels_of_one_frame, one_per_frame, with_second_frames};
use crate::sink::MANIFEST;

/// Bytes that identify the format of a file.
const HEAD: u64 = 4096;
/// Number of ignored files that are named.
const NAMED: usize = 3;

/// What names of files, folders and wildcards mean.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// In the order of the names: files to read, and what cannot be used, with the reason.
    pub files: Vec<Result<PathBuf, FailedInput>>,
    /// What else the folders hold.
    pub left_alone: LeftAlone,
}

/// Files of folders that are no scans: notes, pictures, results, logs, other channels of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LeftAlone {
    /// How many.
    pub count: usize,
    /// The first of them.
    pub names: Vec<String>,
}

impl LeftAlone {
    fn add(&mut self, path: &Path) {
        self.count += 1;
        if self.names.len() < NAMED {
            let name = path.file_name().unwrap_or_default();
            self.names.push(name.to_string_lossy().into_owned());
        }
    }
}

/// One line, as in `left alone: 4 other files (a.txt, b.png, c.json, …)`.
impl fmt::Display for LeftAlone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let files = if self.count == 1 { "file" } else { "files" };
        let names = self.names.join(", ");
        let more = if self.count > self.names.len() {
            ", …"
        } else {
            ""
        };
        write!(
            f,
            "left alone: {} other {files} ({names}{more})",
            self.count
        )
    }
}

/// Looks for the files that are meant.
pub fn find(paths: &[PathBuf]) -> Found {
    let mut found = Found::default();
    for path in paths {
        if path.is_dir() {
            found.folder(path);
        } else if path.exists() {
            found.files.push(Ok(path.clone()));
        } else {
            match matching(path) {
                Ok(files) => found.files.extend(files.into_iter().map(Ok)),
                Err(error) => found.fail(path, error),
            }
        }
    }
    found
}

/// Whether a folder has a scan, or what should be one.
pub(crate) fn holds_scans(folder: &Path) -> bool {
    let inside = entries(folder).unwrap_or_default();
    inside
        .iter()
        .any(|file| matches!(look(file), Look::Scan(_) | Look::Failed(_)))
}

impl Found {
    /// What is to be measured apart from what cannot be, each frame once: of files that hold two, both.
    pub fn frames(self) -> (Vec<PathBuf>, Vec<FailedInput>) {
        let (mut files, mut failed) = (Vec::new(), Vec::new());
        for file in self.files {
            match file {
                Ok(path) => files.push(path),
                Err(error) => failed.push(error),
            }
        }
        let (files, others) = channels_of_one_frame(files);
        failed.extend(others.into_iter().map(|(file, first)| FailedInput {
            file: in_words(&file),
            error: format!(
                "this is another channel of the frame of {}, which was measured already. Give the files of one \
                 channel, as in '*.Z_mtrx'",
                first.display()
            ),
        }));
        (with_second_frames(files), failed)
    }

    fn fail(&mut self, path: &Path, error: String) {
        self.files.push(Err(FailedInput {
            file: in_words(path),
            error,
        }));
    }

    /// The scans of a folder, by name, and what should be one.
    fn folder(&mut self, path: &Path) {
        let entries = match entries(path) {
            Ok(entries) => entries,
            Err(error) => return self.fail(path, error),
        };
        let mut scans = Vec::new();
        let mut failed = Vec::new();
        for file in &entries {
            match look(file) {
                Look::Scan(format) => scans.push((file.clone(), format)),
                Look::Failed(reason) => failed.push((file, reason)),
                // The list of what the simulator wrote beside its scans.
                Look::Other if file.file_name().is_some_and(|name| name == MANIFEST) => {}
                Look::Other => self.left_alone.add(file),
                Look::Folder => {}
            }
        }
        let kept = one_per_frame(scans.clone());
        for (file, _) in scans.iter().filter(|(file, _)| !kept.contains(file)) {
            self.left_alone.add(file);
        }
        if kept.is_empty() && failed.is_empty() {
            self.fail(path, no_scans(&entries));
        }
        self.files.extend(kept.into_iter().map(Ok));
        for (file, reason) in failed {
            self.fail(file, reason);
        }
    }
}

/// What a file of a folder is.
pub(crate) enum Look {
    /// By its first bytes.
    Scan(Format),
    /// It should be a scan, and cannot be used.
    Failed(String),
    /// A file that is left alone.
    Other,
    /// A folder, which is not searched.
    Folder,
}

/// Looks at the name and the first bytes of a file.
pub(crate) fn look(path: &Path) -> Look {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    if name.starts_with('.') {
        return Look::Other;
    }
    let failed_by_name = |reason: String| {
        if named_like_scan(&name) {
            Look::Failed(reason)
        } else {
            Look::Other
        }
    };
    let metadata = match std::fs::metadata(path) {
        Ok(metadata) => metadata,
        Err(error) => return failed_by_name(error.to_string()),
    };
    if metadata.is_dir() {
        return Look::Folder;
    }
    if !metadata.is_file() {
        let kind = reading::kind(&metadata);
        return failed_by_name(format!("expected a file, found {kind}"));
    }
    let head = match reading::head(path, HEAD) {
        Ok(head) => head,
        // Nobody knows what is in it.
        Err(error) => return Look::Failed(error.to_string()),
    };
    let format = format_of(path, &head);
    if is_own_result(path, &name) {
        Look::Other
    } else if format.is_scan() {
        Look::Scan(format)
    } else {
        failed_by_name(format!(
            "the name is that of a scan, but {}",
            instead(format, &head)
        ))
    }
}

/// Maps that this program wrote lie beside their numbers.
fn is_own_result(path: &Path, name: &str) -> bool {
    name == "map.gwy" && path.with_file_name("map.json").is_file()
}

/// The format by the first bytes. The directory of a TIFF file, which tells the instrument, may lie at its end.
fn format_of(path: &Path, head: &[u8]) -> Format {
    match detect(head) {
        Format::Tiff => reading::read(path).map_or(Format::Tiff, |bytes| detect(&bytes)),
        other => other,
    }
}

/// What a file holds that should be a scan by its name.
fn instead(format: Format, head: &[u8]) -> String {
    match format {
        Format::Npy | Format::Npz => "it holds an array".to_owned(),
        Format::Tiff | Format::Png | Format::Jpeg => "it holds a picture".to_owned(),
        Format::TextMatrix => "it holds a matrix of numbers as text".to_owned(),
        other => match spmfile::read_as(other, head, &|_| true) {
            Err(error) => error.to_string(),
            Ok(_) => "it holds something else".to_owned(),
        },
    }
}

/// Everything in a folder, by name.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let words = |error: std::io::Error| error.to_string();
    let mut paths = std::fs::read_dir(folder)
        .map_err(words)?
        .map(|entry| Ok(entry.map_err(words)?.path()))
        .collect::<Result<Vec<PathBuf>, String>>()?;
    paths.sort();
    Ok(paths)
}

/// Words for a folder without scans. Its subfolders are named where they hold some.
fn no_scans(entries: &[PathBuf]) -> String {
    let holds_scans = |folder: &&PathBuf| {
        let inside = self::entries(folder).unwrap_or_default();
        inside
            .iter()
            .any(|file| matches!(look(file), Look::Scan(_)))
    };
    let folders: Vec<String> = entries
        .iter()
        .filter(|path| path.is_dir())
        .filter(holds_scans)
        .map(|path| path.display().to_string())
        .collect();
    if folders.is_empty() {
        return "the folder holds no scan files (subfolders are not searched)".to_owned();
    }
    let more = folders.len().saturating_sub(NAMED);
    let more = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    format!(
        "the folder holds no scan files; subfolders are not searched, and there are some in {}{more}",
        folders[..folders.len().min(NAMED)].join(", ")
    )
}

/// Wildcards in the last part of a path, for shells that leave them alone.
fn matching(path: &Path) -> Result<Vec<PathBuf>, String> {
    let pattern = path
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    let Some(pattern) = pattern.filter(|p| p.contains(['*', '?'])) else {
        return Err("no such file or folder".to_owned());
    };
    let pattern: Vec<char> = pattern.chars().collect();
    let parent = match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    let mut files = entries(parent)?;
    files.retain(|file| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        !file.is_dir() && fits(&pattern, &name.chars().collect::<Vec<_>>())
    });
    if files.is_empty() {
        return Err("no file matches this name".to_owned());
    }
    Ok(files)
}

/// `*` stands for any characters, `?` for one. Remembers the last star only: earlier ones never
/// have to take more than they did.
fn fits(pattern: &[char], name: &[char]) -> bool {
    let (mut p, mut n) = (0, 0);
    let mut star = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                star = Some((p + 1, n));
                p += 1;
            }
            Some(&c) if c == '?' || c == name[n] => {
                p += 1;
                n += 1;
            }
            _ => match star {
                Some((after, taken)) => {
                    star = Some((after, taken + 1));
                    p = after;
                    n = taken + 1;
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCAN: &[u8] = b":NANONIS_VERSION:\n2\n";

    fn folder(files: &[(&str, &[u8])]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, bytes) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
        folder
    }

    fn names(files: &[PathBuf]) -> Vec<String> {
        let name = |p: &PathBuf| p.file_name().unwrap().to_string_lossy().into_owned();
        files.iter().map(name).collect()
    }

    #[test]
    fn wildcards() {
        let fit = |p: &str, n: &str| {
            fits(
                &p.chars().collect::<Vec<_>>(),
                &n.chars().collect::<Vec<_>>(),
            )
        };
        assert!(fit("*.spm", "scän 1.spm") && fit("a?c*", "abc") && fit("*a*b", "xaab"));
        assert!(!fit("*.spm", "scan.000") && !fit("a?c", "ac") && !fit("", "a"));
    }

    #[test]
    fn nothing_that_looks_like_a_scan_vanishes() {
        let files: [(&str, &[u8]); 10] = [
            ("a.sxm", SCAN),
            ("b.spm", b""),
            ("scan.002", b"dear diary\n"),
            ("c.gwy", b"\x89PNG\r\n\x1a\n"),
            ("odd name", SCAN),
            ("._a.sxm", b"\0\x05\x16\x07"),
            ("notes.txt", b"x"),
            ("map.json", b"{}"),
            ("map.gwy", b"GWYPGwyContainer\0"),
            ("empty.txt", b""),
        ];
        let folder = folder(&files);
        let found = find(&[folder.path().to_owned()]);
        assert_eq!(found.left_alone.count, 5, "{}", found.left_alone);
        let line = found.left_alone.to_string();
        assert!(
            line.starts_with("left alone: 5 other files (._a.sxm, "),
            "{line}"
        );
        assert!(line.ends_with(", …)"), "{line}");
        let (inputs, failed) = found.frames();
        assert_eq!(names(&inputs), ["a.sxm", "odd name"]);
        let failed: Vec<(bool, String)> = failed
            .into_iter()
            .map(|f| (f.file.starts_with(folder.path().to_str().unwrap()), f.error))
            .collect();
        assert_eq!(failed.len(), 3, "{failed:?}");
        assert!(failed.iter().all(|(inside, _)| *inside));
        for (words, (_, error)) in ["file is empty", "holds a picture", "dear diary"]
            .iter()
            .zip(&failed)
        {
            assert!(error.contains(words), "{words}: {error}");
        }
        // Without its numbers it is a container like any other.
        std::fs::remove_file(folder.path().join("map.json")).unwrap();
        let (inputs, _) = find(&[folder.path().to_owned()]).frames();
        assert_eq!(names(&inputs), ["a.sxm", "map.gwy", "odd name"]);
    }

    #[test]
    fn folders_without_scans_say_where_there_are_some() {
        let folder = folder(&[
            ("notes.txt", b"x"),
            ("one/a.sxm", SCAN),
            ("two/b.txt", b"x"),
        ]);
        let error = |path: &Path| {
            let found = find(&[path.to_owned()]);
            found.files[0].as_ref().unwrap_err().error.clone()
        };
        let words = error(folder.path());
        assert!(words.contains("there are some in"), "{words}");
        assert!(words.ends_with("one"), "{words}");
        assert!(error(&folder.path().join("two")).contains("no scan files (sub"));
        assert_eq!(
            error(&folder.path().join("three")),
            "no such file or folder"
        );
        assert_eq!(
            error(&folder.path().join("*.spm")),
            "no file matches this name"
        );
    }

    /// A pipe and a device are not even opened.
    #[cfg(target_os = "linux")]
    #[test]
    fn what_never_ends_is_not_begun() {
        let folder = folder(&[("a.sxm", SCAN)]);
        let link = |to: &str, name: &str| {
            std::os::unix::fs::symlink(to, folder.path().join(name)).unwrap();
        };
        link("/dev/zero", "zero.spm");
        link("/dev/zero", "zero");
        link("nowhere", "gone.001");
        link("a.sxm", "b.sxm");
        let found = find(&[folder.path().to_owned()]);
        assert_eq!(found.left_alone.names, ["zero"]);
        let (inputs, failed) = found.frames();
        assert_eq!(names(&inputs), ["a.sxm", "b.sxm"]);
        assert_eq!(failed.len(), 2);
        assert!(failed[1].error.contains("found a device"), "{failed:?}");
    }
}
