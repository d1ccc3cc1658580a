//! Where the bytes of a file are: on the disk, or in memory beside its neighbours.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use moiregauge_report::InputFile;
use serde::{Deserialize, Serialize};
use spmfile::Seekable;
use spmfile::matrix::log_file;

use crate::content::Content;
use crate::hash;
use crate::in_memory::ScanInMemory;
use crate::reading::{self, FileError};
use crate::session::file_of;

/// Where files are that are not where their names say: elsewhere on the disk, or in memory (uploads, arrays).
///
/// Written with a campaign, it keeps what lies elsewhere; what is in memory has to be given again.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Places {
    moved: BTreeMap<PathBuf, PathBuf>,
    #[serde(skip)]
    held: BTreeMap<PathBuf, Arc<Vec<u8>>>,
    #[serde(skip)]
    scans: BTreeMap<PathBuf, ScanInMemory>,
}

impl Places {
    /// Every file is where its name says.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The file of this name lies at `place`.
    pub fn insert(&mut self, name: PathBuf, place: PathBuf) {
        self.moved.insert(name, place);
    }

    /// The file of this name has these bytes. Its neighbours, such as a log beside it, are looked for among what is
    /// held, too, and never on the disk.
    pub fn hold(&mut self, name: PathBuf, bytes: Vec<u8>) {
        self.held.insert(name, Arc::new(bytes));
    }

    /// What this name stands for is no file but a scan in memory.
    pub fn hold_scan(&mut self, name: PathBuf, scan: ScanInMemory) {
        self.scans.insert(name, scan);
    }

    /// The scan in memory of this name.
    pub fn scan(&self, name: &Path) -> Option<&ScanInMemory> {
        self.scans.get(name)
    }

    /// Where a file lies on the disk, if it is not held.
    pub fn place<'a>(&'a self, name: &'a Path) -> &'a Path {
        file_of(self.moved.get(name).map_or(name, PathBuf::as_path))
    }

    /// The file of this name.
    pub fn source<'a>(&'a self, name: &'a Path) -> Source<'a> {
        if self.held.contains_key(name) {
            return Source {
                held: Some(&self.held),
                path: Cow::Borrowed(name),
            };
        }
        Source {
            held: None,
            path: Cow::Borrowed(self.place(name)),
        }
    }

    /// The file of this name, wherever others of its name may have been moved.
    pub(crate) fn named<'a>(&'a self, name: &'a Path) -> Source<'a> {
        let name = file_of(name);
        Source {
            held: Some(&self.held).filter(|held| held.contains_key(name)),
            path: Cow::Borrowed(name),
        }
    }
}

/// A file, read when it is wanted.
#[derive(Clone, Debug)]
pub struct Source<'a> {
    /// What is in memory, if this is, too.
    held: Option<&'a BTreeMap<PathBuf, Arc<Vec<u8>>>>,
    path: Cow<'a, Path>,
}

impl<'a> Source<'a> {
    /// A file on the disk.
    pub fn disk(path: &'a Path) -> Self {
        Self {
            held: None,
            path: Cow::Borrowed(path),
        }
    }

    /// Its path, or its name in memory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is held of it, if it is in memory.
    fn held(&self) -> Option<Result<&Arc<Vec<u8>>, FileError>> {
        let missing = || FileError::System(io::ErrorKind::NotFound.into());
        let held = self.held?;
        Some(held.get(self.path.as_ref()).ok_or_else(missing))
    }

    /// All its bytes.
    ///
    /// # Errors
    /// As [`crate::read`].
    pub fn content(&self) -> Result<Content, FileError> {
        match self.held() {
            Some(held) => Ok(Content::shared(Arc::clone(held?))),
            None => Ok(Content::of(reading::read(&self.path)?)),
        }
    }

    /// Number of its bytes.
    ///
    /// # Errors
    /// There is no such file.
    pub fn length(&self) -> Result<u64, FileError> {
        match self.held() {
            Some(held) => Ok(held?.len() as u64),
            None => Ok(std::fs::metadata(&self.path)?.len()),
        }
    }

    /// What identifies it, read piece by piece; `name` is what the user calls it.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn identity(&self, name: &Path) -> Result<InputFile, FileError> {
        match self.held() {
            Some(_) => Ok(self.content()?.identity(name)),
            None => hash::identity(name, &self.path),
        }
    }

    /// Its bytes where they are wanted, for files larger than memory.
    ///
    /// # Errors
    /// As [`crate::open`].
    pub fn pieces(&self) -> Result<Arc<dyn spmfile::Source>, FileError> {
        match self.held() {
            Some(held) => Ok(Arc::new(Held(Arc::clone(held?)))),
            None => Ok(Arc::new(Seekable::new(reading::open(&self.path)?))),
        }
    }

    /// The file of this name beside it.
    #[must_use]
    pub fn beside(&self, name: &str) -> Self {
        Self {
            held: self.held,
            path: Cow::Owned(self.path.with_file_name(name)),
        }
    }

    /// Whether there is such a file.
    fn is_there(&self) -> bool {
        match self.held() {
            Some(held) => held.is_ok(),
            None => self.path.is_file(),
        }
    }

    /// The parts of the log beside a file of an Omicron Matrix session; none beside any other file.
    pub(crate) fn logs(&self) -> Vec<Self> {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let part = |number| Some(self.beside(&log_file(&name, number)?));
        (1..).map_while(part).take_while(Self::is_there).collect()
    }
}

/// Bytes in memory that are read like those of a large file.
struct Held(Arc<Vec<u8>>);

impl spmfile::Source for Held {
    fn length(&self) -> io::Result<u64> {
        self.0.as_slice().length()
    }

    fn read_at(&self, at: u64, into: &mut [u8]) -> io::Result<()> {
        self.0.as_slice().read_at(at, into)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_is_read_as_a_file_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        std::fs::write(&path, b"1 2\n3 4\n").unwrap();
        let mut places = Places::new();
        let name = Path::new("upload.txt");
        places.hold(name.to_owned(), b"1 2\n3 4\n".to_vec());
        let (held, disk) = (places.source(name), places.source(&path));
        assert_eq!(held.identity(name).unwrap(), disk.identity(name).unwrap());
        assert_eq!(held.length().unwrap(), disk.length().unwrap());
        assert_eq!(
            held.content().unwrap().bytes(),
            disk.content().unwrap().bytes()
        );
        for source in [held, disk] {
            let mut two = [0; 2];
            source.pieces().unwrap().read_at(4, &mut two).unwrap();
            assert_eq!(&two, b"3 ");
        }
    }

    /// A log lies beside an upload where it was uploaded, too; what else the disk holds is nobody's business.
    #[test]
    fn neighbours_of_uploads_are_uploads() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("s_0001.mtrx"), b"disk").unwrap();
        let scan = at("s--1_1.Z_mtrx");
        let mut places = Places::new();
        assert_eq!(places.source(&scan).logs().len(), 1);
        places.hold(scan.clone(), b"upload".to_vec());
        assert!(places.source(&scan).logs().is_empty());
        let missing = places.source(&scan).beside("s_0001.mtrx").content();
        assert!(missing.unwrap_err().is_missing());
        places.hold(at("s_0001.mtrx"), b"upload".to_vec());
        let logs = places.source(&scan).logs();
        assert_eq!(logs[0].content().unwrap().bytes(), b"upload");
    }
}
