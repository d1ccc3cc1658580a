//! Single files: written beside their places and renamed.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use moiregauge::numbers::interrupt;

use super::SinkError;
use super::error::at;
use super::folder::canonical;
use super::manifest::exists;
use super::work::{OLD, Work};

/// Files that are written into one folder, each by itself.
#[derive(Debug)]
pub struct FileSink {
    folder: PathBuf,
    work: Work,
    force: bool,
    inputs: Vec<PathBuf>,
    next: AtomicUsize,
}

impl FileSink {
    /// Makes the folder ready, before the work. It goes again if nothing is written.
    ///
    /// # Errors
    /// [`SinkError`] if the folder cannot be written.
    pub fn open(folder: &Path, force: bool, inputs: &[PathBuf]) -> Result<Self, SinkError> {
        let here = folder == Path::new("");
        let real = if here { Path::new(".") } else { folder };
        if exists(real) && !real.is_dir() {
            return Err(SinkError::NoFolder(folder.to_owned()));
        }
        Ok(Self {
            // Names are shown as they were given.
            folder: folder.to_owned(),
            work: Work::own(real)?,
            force,
            inputs: canonical(inputs),
            next: AtomicUsize::new(0),
        })
    }

    /// An error if a file of this name may not be written.
    ///
    /// # Errors
    /// [`SinkError`] says why not.
    pub fn check(&self, name: &Path) -> Result<(), SinkError> {
        let path = self.folder.join(name);
        if !exists(&path) {
            return Ok(());
        }
        if self.inputs.iter().any(|input| is_same(input, &path)) {
            return Err(SinkError::Input(path));
        }
        match std::fs::symlink_metadata(&path) {
            Ok(found) if found.is_file() && self.force => Ok(()),
            Ok(found) if found.is_file() => Err(SinkError::Exists(path)),
            _ => Err(SinkError::NoFile(path)),
        }
    }

    /// Writes files that belong together: all are whole before the first is moved to its place. Where the thread is to stop before, none is.
    ///
    /// # Errors
    /// [`SinkError`] if one cannot be written.
    pub fn write(&self, files: &[(PathBuf, Vec<u8>)]) -> Result<Vec<PathBuf>, SinkError> {
        self.put(files, &interrupt::check)
    }

    /// The same; `between` is called before each file and within large ones.
    fn put(
        &self,
        files: &[(PathBuf, Vec<u8>)],
        between: &dyn Fn(),
    ) -> Result<Vec<PathBuf>, SinkError> {
        for (name, _) in files {
            self.check(name)?;
        }
        let staged = files.iter().map(|(_, bytes)| {
            // What is stopped here has moved nothing.
            between();
            let number = self.next.fetch_add(1, Ordering::Relaxed);
            (self.work).stage_between(&number.to_string(), bytes, between)
        });
        let staged: Vec<PathBuf> = staged.collect::<Result<_, _>>()?;
        let mut written = Vec::new();
        for (staged, (name, _)) in staged.iter().zip(files) {
            let path = self.folder.join(name);
            // Somebody may have written it meanwhile.
            self.check(name)?;
            std::fs::rename(staged, &path).map_err(at(&path))?;
            written.push(path);
        }
        Ok(written)
    }

    /// An error if a folder of this name may not be written: nothing but a group that this program wrote is replaced.
    ///
    /// # Errors
    /// [`SinkError`] says why not.
    pub fn check_group(&self, name: &Path) -> Result<(), SinkError> {
        let path = self.folder.join(name);
        if !exists(&path) {
            return Ok(());
        }
        let inside = |input: &PathBuf| path.canonicalize().is_ok_and(|p| input.starts_with(p));
        if let Some(input) = self.inputs.iter().find(|input| inside(input)) {
            return Err(SinkError::Input(input.clone()));
        }
        if !self.force {
            return Err(SinkError::Exists(path));
        }
        if is_our_group(&path) {
            Ok(())
        } else {
            Err(SinkError::Foreign(path))
        }
    }

    /// Writes a Zarr group, a folder whose files are given by their names in it; it is replaced as a whole.
    ///
    /// # Errors
    /// [`SinkError`] if it cannot be written.
    pub fn write_group(
        &self,
        name: &Path,
        files: &[(String, Vec<u8>)],
    ) -> Result<PathBuf, SinkError> {
        self.check_group(name)?;
        let number = self.next.fetch_add(1, Ordering::Relaxed).to_string();
        for (inner, bytes) in files {
            super::manifest::check_name(inner)?;
            interrupt::check();
            self.work.stage(&format!("{number}/{inner}"), bytes)?;
        }
        self.check_group(name)?;
        let path = self.folder.join(name);
        // A run that is killed between these two is put right by the next one, see `work`.
        let aside = self.work.path(OLD).join(name);
        if exists(&path) {
            let set_aside = std::fs::create_dir_all(self.work.path(OLD))
                .and_then(|()| std::fs::rename(&path, &aside));
            set_aside.map_err(at(&path))?;
        }
        std::fs::rename(self.work.staged(&number), &path).map_err(at(&path))?;
        std::fs::remove_dir_all(&aside).ok();
        Ok(path)
    }
}

/// One file.
#[derive(Debug)]
pub struct OneFile {
    sink: FileSink,
    name: PathBuf,
}

impl OneFile {
    /// Finds out before the work whether it can be written.
    ///
    /// # Errors
    /// [`SinkError`] says why not.
    pub fn open(path: &Path, force: bool, inputs: &[PathBuf]) -> Result<Self, SinkError> {
        let Some(name) = path.file_name() else {
            return Err(SinkError::NoFile(path.to_owned()));
        };
        let folder = path.parent().unwrap_or(Path::new(""));
        let one = Self {
            sink: FileSink::open(folder, force, inputs)?,
            name: PathBuf::from(name),
        };
        one.sink.check(&one.name)?;
        Ok(one)
    }

    /// Writes it, also where the thread is to stop: what a watch keeps is what it has measured until then.
    ///
    /// # Errors
    /// [`SinkError`] if it cannot be written.
    pub fn write(self, bytes: Vec<u8>) -> Result<(), SinkError> {
        let files = [(self.name.clone(), bytes)];
        self.sink.put(&files, &|| ()).map(|_| ())
    }
}

/// Whether two names are those of one file.
fn is_same(input: &Path, path: &Path) -> bool {
    path.canonicalize().is_ok_and(|path| path == *input) || is_linked(input, path)
}

#[cfg(unix)]
fn is_linked(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let of = |path: &Path| std::fs::metadata(path).ok().map(|m| (m.dev(), m.ino()));
    of(a).is_some_and(|a| of(b) == Some(a))
}

/// Renaming leaves the data of other links alone.
#[cfg(not(unix))]
fn is_linked(_: &Path, _: &Path) -> bool {
    false
}

/// Whether a folder is a Zarr group whose log names this program.
fn is_our_group(path: &Path) -> bool {
    let read = || {
        let plain = std::fs::symlink_metadata(path).ok()?.is_dir();
        let text = std::fs::read(path.join("zarr.json")).ok()?;
        let document: serde_json::Value = serde_json::from_slice(&text).ok()?;
        let log = document.pointer("/attributes/log")?.as_array()?;
        let ours =
            |line: &serde_json::Value| line.as_str().is_some_and(|l| l.contains("moiregauge"));
        Some(plain && log.iter().any(ours))
    };
    read().unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    use super::*;

    /// Several files are given up where the thread is to stop; a single one, what a watch keeps, is not.
    #[test]
    fn a_single_file_is_written_by_a_thread_that_is_to_stop() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept.json");
        let before = interrupt::watch(Some(Arc::new(AtomicBool::new(true))));
        let one = OneFile::open(&path, false, &[]).unwrap();
        let written = one.write(b"kept".to_vec());
        let sink = FileSink::open(folder.path(), false, &[]).unwrap();
        let files = [(PathBuf::from("other"), Vec::new())];
        let stopped = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| sink.write(&files)));
        interrupt::watch(before);
        written.unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"kept");
        assert!(stopped.unwrap_err().is::<interrupt::Interrupted>());
        assert!(!folder.path().join("other").exists());
    }
}
