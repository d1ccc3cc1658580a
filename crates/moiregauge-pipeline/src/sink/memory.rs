//! Results in memory, and as one archive.

use std::collections::BTreeMap;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::SinkError;
use super::error::at;
use super::file::OneFile;
use super::folder::FolderSink;
use super::manifest::{Entry, MANIFEST, Manifest, check_name};

/// Somewhere to write files of results to, from any thread. What is written is there when the sink is committed.
pub trait Sink: Sync {
    /// Writes a file; parts of its name are divided by `/`. A second one of the same name replaces the first.
    ///
    /// # Errors
    /// [`SinkError`] if it cannot be written.
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), SinkError>;
}

impl Sink for FolderSink {
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), SinkError> {
        FolderSink::write(self, name, bytes)
    }
}

/// Files that stay in memory: for pages and interpreters.
#[derive(Debug, Default)]
pub struct MemorySink(Mutex<BTreeMap<String, Vec<u8>>>);

impl MemorySink {
    /// One without files.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The files by their names, with the list of them as a folder has it.
    ///
    /// # Errors
    /// None in practice: everything is written into memory.
    pub fn commit(self, kind: &str) -> Result<BTreeMap<String, Vec<u8>>, SinkError> {
        let mut files = self.0.into_inner().unwrap_or_else(PoisonError::into_inner);
        let entries = files
            .iter()
            .map(|(name, bytes)| Entry::of_bytes(name, bytes));
        let manifest = Manifest::new(kind, entries.collect());
        let mut text =
            serde_json::to_vec_pretty(&manifest).map_err(|e| at(Path::new(MANIFEST))(e.into()))?;
        text.push(b'\n');
        files.insert(MANIFEST.to_owned(), text);
        Ok(files)
    }
}

impl Sink for MemorySink {
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), SinkError> {
        check_name(name)?;
        let mut files = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        files.insert(name.to_owned(), bytes.to_vec());
        Ok(())
    }
}

/// All files in one ZIP archive, to be sent or downloaded. It holds no time of day: the same results make the same
/// bytes.
#[derive(Debug)]
pub struct ZipSink {
    file: OneFile,
    path: PathBuf,
    files: MemorySink,
}

impl ZipSink {
    /// Finds out before the work whether the archive can be written.
    ///
    /// # Errors
    /// [`SinkError`] says why not.
    pub fn open(path: &Path, force: bool, inputs: &[PathBuf]) -> Result<Self, SinkError> {
        Ok(Self {
            file: OneFile::open(path, force, inputs)?,
            path: path.to_owned(),
            files: MemorySink::new(),
        })
    }

    /// Writes the archive as a whole.
    ///
    /// # Errors
    /// [`SinkError`] if it cannot be written.
    pub fn commit(self, kind: &str) -> Result<(), SinkError> {
        let files = self.files.commit(kind)?;
        let bytes = archive(&files).map_err(at(&self.path))?;
        self.file.write(bytes)
    }
}

impl Sink for ZipSink {
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), SinkError> {
        self.files.write(name, bytes)
    }
}

/// Files as one ZIP archive: the same files make the same bytes.
///
/// # Errors
/// None in practice: everything is written into memory.
pub fn archive(files: &BTreeMap<String, Vec<u8>>) -> std::io::Result<Vec<u8>> {
    packed(files).map_err(std::io::Error::other)
}

fn packed(files: &BTreeMap<String, Vec<u8>>) -> zip::result::ZipResult<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // The earliest date that the format has.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default());
    for (name, bytes) in files {
        zip.start_file(name.as_str(), options)?;
        zip.write_all(bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read as _;

    #[test]
    fn archives_hold_what_was_written_and_its_list() {
        let folder = tempfile::tempdir().unwrap();
        let made = |name: &str| {
            let path = folder.path().join(name);
            let sink = ZipSink::open(&path, false, &[]).unwrap();
            sink.write("b/two.csv", b"2").unwrap();
            sink.write("one.json", b"0").unwrap();
            sink.write("one.json", b"1").unwrap();
            assert!(sink.write("../out", b"").is_err());
            assert!(!path.exists());
            sink.commit("analyze").unwrap();
            std::fs::read(path).unwrap()
        };
        let bytes = made("a.zip");
        assert_eq!(bytes, made("b.zip"));
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
        let names: Vec<String> = archive
            .file_names()
            .map(|n| n.unwrap().into_owned())
            .collect();
        assert_eq!(names, ["b/two.csv", MANIFEST, "one.json"]);
        let mut text = String::new();
        let mut one = archive.by_name("one.json").unwrap();
        one.read_to_string(&mut text).unwrap();
        assert_eq!(text, "1");
        let again = ZipSink::open(&folder.path().join("a.zip"), false, &[]).unwrap_err();
        assert!(again.can_be_forced());
    }
}
