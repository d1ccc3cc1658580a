//! What was measured, in a file that grows: a line for what is new, each a document of its own.
//!
//! Nothing that was written is written again, so that a long watch costs as much per frame at its end as at its beginning. A line
//! counts when it is whole: one that a kill or a full disk cut off is taken off by whoever writes the next.

use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io::{Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use super::kept::{Kept, SCHEMA};
use crate::reading::{FileError, read};

/// A file of measured scans that grows.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    /// How much of it is whole.
    bytes: u64,
    /// Whether it ends in the middle of a line: one document without the end of its line is whole, too.
    open: bool,
    /// The keys of what is in it.
    written: BTreeSet<String>,
}

/// Why a file cannot be kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JournalError {
    /// It cannot be read.
    #[error("{}: {}", .0.display(), .1)]
    Read(PathBuf, FileError),
    /// It cannot be written.
    #[error("{}: {}", .0.display(), .1)]
    Write(PathBuf, std::io::Error),
    /// It holds something else.
    #[error("{}: line {line}: {why}", .path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        why: serde_json::Error,
    },
}

impl Journal {
    /// Opens a file that is there, or makes one; with what it holds.
    ///
    /// # Errors
    /// [`JournalError`]; a file that holds something else is left as it is.
    pub fn open(path: &Path) -> Result<(Self, Kept), JournalError> {
        let before = match read(path) {
            Err(error) if error.is_missing() => Ok(Vec::new()),
            other => other.map_err(|error| JournalError::Read(path.to_owned(), error)),
        }?;
        let (kept, whole) = documents(path, &before)?;
        let mut options = OpenOptions::new();
        let file = options.write(true).create(true).truncate(false).open(path);
        let journal = Self {
            path: path.to_owned(),
            file: file.map_err(|error| JournalError::Write(path.to_owned(), error))?,
            bytes: whole as u64,
            open: whole > 0 && before[whole - 1] != b'\n',
            written: kept.keys().cloned().collect(),
        };
        Ok((journal, kept))
    }

    /// Adds what is measured and not written yet, and waits until it is on the disk.
    ///
    /// # Errors
    /// [`JournalError::Write`]; what was written before stays.
    pub fn add(&mut self, kept: &Kept) -> Result<(), JournalError> {
        let new = kept.beside(&self.written);
        if new.is_empty() {
            return Ok(());
        }
        let mut line = Vec::new();
        if self.open {
            line.push(b'\n');
        }
        let written = serde_json::to_writer(&mut line, &new).map_err(std::io::Error::from);
        line.push(b'\n');
        let written = written.and_then(|()| self.write(&line));
        if let Err(error) = written {
            // What was begun is no line.
            self.file.set_len(self.bytes).ok();
            return Err(JournalError::Write(self.path.clone(), error));
        }
        self.bytes += line.len() as u64;
        self.open = false;
        self.written.extend(new.keys().cloned());
        Ok(())
    }

    fn write(&mut self, line: &[u8]) -> std::io::Result<()> {
        self.file.set_len(self.bytes)?;
        self.file.seek(SeekFrom::Start(self.bytes))?;
        self.file.write_all(line)?;
        self.file.sync_data()
    }
}

/// What the lines of a file hold, and how many of its bytes are whole lines.
fn documents(path: &Path, bytes: &[u8]) -> Result<(Kept, usize), JournalError> {
    let (mut all, mut whole) = (Kept::default(), 0);
    for (number, line) in (1..).zip(bytes.split_inclusive(|byte| *byte == b'\n')) {
        match serde_json::from_slice::<Kept>(line) {
            Ok(kept) => all.extend(kept),
            Err(_) if is_begun(line) => break,
            Err(why) => {
                return Err(JournalError::Foreign {
                    path: path.to_owned(),
                    line: number,
                    why,
                });
            }
        }
        whole += line.len();
    }
    Ok((all, whole))
}

/// Whether it is the beginning of a line of ours.
fn is_begun(line: &[u8]) -> bool {
    let head = format!("{{\"schema\":\"{SCHEMA}\",");
    let same = head.len().min(line.len());
    !line.ends_with(b"\n") && line[..same] == head.as_bytes()[..same]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::failure::Failure;

    fn failure() -> Failure {
        Failure {
            error: "no lattice".to_owned(),
            no_lattice: true,
        }
    }

    fn failed(keys: &[&str]) -> Kept {
        let mut kept = Kept::default();
        for key in keys {
            kept.put((*key).to_owned(), Err(failure()));
        }
        kept
    }

    /// Each line is written once; what was cut off counts as not written, wherever it was cut.
    #[test]
    fn lines_are_written_once_and_cut_ones_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept");
        let (mut journal, kept) = Journal::open(&path).unwrap();
        assert!(kept.is_empty());
        journal.add(&failed(&["a"])).unwrap();
        let one = std::fs::read(&path).unwrap();
        journal.add(&failed(&["a"])).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), one);
        journal.add(&failed(&["a", "b", "c"])).unwrap();
        let both = std::fs::read(&path).unwrap();
        assert!(both.starts_with(&one) && both.split_inclusive(|b| *b == b'\n').count() == 2);
        for cut in 0..both.len() {
            std::fs::write(&path, &both[..cut]).unwrap();
            let (mut journal, kept) = Journal::open(&path).unwrap();
            // A document is whole without the end of its line.
            let expected =
                2 * usize::from(cut + 1 == both.len()) + usize::from(cut + 1 >= one.len());
            assert_eq!(kept.len(), expected, "{cut}");
            journal.add(&failed(&["a", "b", "c"])).unwrap();
            assert_eq!(Journal::open(&path).unwrap().1.len(), 3, "{cut}");
        }
    }

    #[test]
    fn what_is_something_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept");
        for text in ["x", "{\"schema\":\"moiregauge/results/1\"}\n", "{}\n", "\n"] {
            std::fs::write(&path, text).unwrap();
            assert!(matches!(
                Journal::open(&path),
                Err(JournalError::Foreign { line: 1, .. })
            ));
            assert_eq!(std::fs::read(&path).unwrap(), text.as_bytes());
        }
    }
}
