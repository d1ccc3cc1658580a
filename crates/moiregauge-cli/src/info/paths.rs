//! Names of files, folders and wildcards → files.

use std::io::Read as _;
use std::path::{Path, PathBuf};

use moiregauge_pipeline::names::in_words;
use moiregauge_report::FailedInput;

use moiregauge_pipeline::session::{channels_of_one_frame, one_per_frame};

/// The files meant by names of files, folders and wildcards, in order; names that mean none come
/// back with the reason.
pub(crate) fn expand(paths: &[PathBuf]) -> Vec<Result<PathBuf, (PathBuf, String)>> {
    let mut files = Vec::new();
    for path in paths {
        let found = if path.is_dir() {
            scans(path)
        } else if path.exists() {
            Ok(vec![path.clone()])
        } else {
            matching(path)
        };
        match found {
            Ok(found) => files.extend(found.into_iter().map(Ok)),
            Err(error) => files.push(Err((path.clone(), error))),
        }
    }
    files
}

/// The same for measuring: what can be read apart from what cannot, and each frame once.
pub(crate) fn inputs(paths: &[PathBuf]) -> (Vec<PathBuf>, Vec<FailedInput>) {
    let (mut files, mut failed) = (Vec::new(), Vec::new());
    for path in expand(paths) {
        match path {
            Ok(path) => files.push(path),
            Err((path, error)) => failed.push(FailedInput {
                file: in_words(&path),
                error,
            }),
        }
    }
    let (files, others) = channels_of_one_frame(files);
    failed.extend(others.into_iter().map(|(file, first)| FailedInput {
        file: in_words(&file),
        error: format!(
            "another channel of the frame of {}, which is measured already; give the files of one channel, as in \
             '*.Z_mtrx'",
            first.display()
        ),
    }));
    (files, failed)
}

/// The files of a folder that pass `wanted`, by name.
fn folder(
    path: &Path,
    wanted: &dyn Fn(&str, &Path) -> bool,
    otherwise: &str,
) -> Result<Vec<PathBuf>, String> {
    let entries = std::fs::read_dir(path).map_err(|e| e.to_string())?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| {
            let entry = entry.ok()?;
            let file = entry.path();
            let name = entry.file_name().to_string_lossy().into_owned();
            (file.is_file() && wanted(&name, &file)).then_some(file)
        })
        .collect();
    files.sort();
    if files.is_empty() {
        return Err(otherwise.to_owned());
    }
    Ok(files)
}

/// The scans in a folder.
fn scans(path: &Path) -> Result<Vec<PathBuf>, String> {
    let none = "the folder holds no scan files (subfolders are not searched)";
    let found = folder(path, &|_, file| spmfile::looks_like_scan(&head(file)), none)?;
    let files = one_per_frame(found, head);
    if files.is_empty() {
        return Err(none.to_owned());
    }
    Ok(files)
}

/// The first bytes of a file, which tell its format; none of one that cannot be read.
fn head(path: &Path) -> Vec<u8> {
    let mut head = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(512).read_to_end(&mut head));
    if read.is_err() {
        head.clear();
    }
    head
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
    let fits = |name: &str, _: &Path| fits(&pattern, &name.chars().collect::<Vec<_>>());
    folder(parent, &fits, "no file fits this name")
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
}
