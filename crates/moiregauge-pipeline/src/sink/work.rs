//! Working folders: where files are until they are whole, with a lock that ends with its process.

use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use moiregauge::numbers::interrupt;

use super::SinkError;
use super::error::at;
use super::manifest::exists;

/// The working folder inside a folder of results; those beside single files have a number behind it.
pub const UNFINISHED: &str = "moiregauge-unfinished";
const LOCK: &str = "lock";
const NEW: &str = "new";
/// Parts of a run that outlive it.
pub(super) const PARTS: &str = "parts";
/// Folders that are being replaced.
pub(super) const OLD: &str = "old";
pub(super) const INTENT: &str = "intent.json";

/// The number of the process; a browser has one.
fn process() -> u32 {
    if cfg!(target_family = "wasm") {
        return 0;
    }
    std::process::id()
}

#[cfg_attr(
    target_family = "wasm",
    expect(dead_code, reason = "a browser has no locks")
)]
/// What came of asking for a lock.
enum Lock {
    Ours,
    /// Another process has it.
    Taken,
    /// There are no locks here.
    None,
}

#[cfg(not(target_family = "wasm"))]
fn lock(file: &File) -> Lock {
    match file.try_lock() {
        Ok(()) => Lock::Ours,
        Err(std::fs::TryLockError::WouldBlock) => Lock::Taken,
        Err(std::fs::TryLockError::Error(_)) => Lock::None,
    }
}

#[cfg(target_family = "wasm")]
fn lock(_: &File) -> Lock {
    Lock::None
}

/// A working folder whose lock is held; it goes when it is dropped, but for what the next run needs.
#[derive(Debug)]
pub(super) struct Work {
    dir: PathBuf,
    /// Held, not used.
    lock: Option<File>,
    /// Folders that were made for it, the outermost first.
    made: Vec<PathBuf>,
}

impl Work {
    /// The only one in a folder: another process that has it is an error.
    pub(super) fn exclusive(folder: &Path) -> Result<Self, SinkError> {
        let made = make_folders(folder)?;
        let dir = folder.join(UNFINISHED);
        let refused = |error| {
            unmake(&made);
            Err(error)
        };
        // Another run that is just ending may take the folder away again.
        for _ in 0..100 {
            match std::fs::create_dir(&dir) {
                Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
                    return refused(at(folder)(error));
                }
                _ => {}
            }
            let path = dir.join(LOCK);
            // Looked at twice: a run that is just ending removes its lock last.
            if has_files(&dir) && !exists(&path) && has_files(&dir) {
                return refused(SinkError::Foreign(dir));
            }
            let file = match OpenOptions::new().append(true).create(true).open(&path) {
                Ok(file) => file,
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                Err(error) => return refused(at(&path)(error)),
            };
            if matches!(lock(&file), Lock::Taken) {
                return refused(SinkError::Running(folder.to_owned()));
            }
            if is_at(&file, &path) {
                return Ok(Self {
                    dir,
                    lock: Some(file),
                    made,
                });
            }
        }
        refused(SinkError::Running(folder.to_owned()))
    }

    /// One of several in a folder; those of runs that were killed are swept up.
    pub(super) fn own(folder: &Path) -> Result<Self, SinkError> {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let made = make_folders(folder)?;
        sweep(folder);
        loop {
            let number = NEXT.fetch_add(1, Ordering::Relaxed);
            let dir = folder.join(format!("{UNFINISHED}-{}-{number}", process()));
            match std::fs::create_dir(&dir) {
                Ok(()) => {}
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => continue,
                Err(error) => {
                    unmake(&made);
                    return Err(at(folder)(error));
                }
            }
            let path = dir.join(LOCK);
            let file = match OpenOptions::new().append(true).create(true).open(&path) {
                Ok(file) => file,
                // Another run has taken the empty folder for one that was left behind.
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                Err(error) => {
                    std::fs::remove_dir(&dir).ok();
                    unmake(&made);
                    return Err(at(folder)(error));
                }
            };
            if !matches!(lock(&file), Lock::Taken) && is_at(&file, &path) {
                return Ok(Self {
                    dir,
                    lock: Some(file),
                    made,
                });
            }
        }
    }

    /// A name in the working folder.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.dir.join(name)
    }

    /// Where a new file is until it is moved.
    pub(super) fn staged(&self, name: &str) -> PathBuf {
        self.dir.join(NEW).join(name)
    }

    /// Writes a new file, synced. A large one is written piece by piece, and is not finished where the thread is to stop:
    /// nobody waits for a disk then.
    pub(super) fn stage(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, SinkError> {
        self.stage_between(name, bytes, &interrupt::check)
    }

    /// The same; `between` is called between the pieces of a large file.
    pub(super) fn stage_between(
        &self,
        name: &str,
        bytes: &[u8],
        between: &dyn Fn(),
    ) -> Result<PathBuf, SinkError> {
        let path = self.staged(name);
        write_pieces(&path, bytes, between)?;
        Ok(path)
    }

    /// Removes the new files, and an intent that was not written to its end.
    pub(super) fn clear(&self) {
        std::fs::remove_dir_all(self.dir.join(NEW)).ok();
        std::fs::remove_file(self.dir.join(format!("{INTENT}.new"))).ok();
    }

    pub(super) fn dir(&self) -> &Path {
        &self.dir
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        if self.path(INTENT).exists() {
            // Everything is needed to complete it.
            return;
        }
        self.clear();
        restore_old(&self.dir);
        // Parts that are kept are known for ours by the lock beside them.
        if !self.path(PARTS).exists() {
            remove(&self.dir);
        }
        self.lock = None;
        unmake(&self.made);
    }
}

/// Writes a file as a whole, with the folders it needs, and has it on the disk.
pub(super) fn write_synced(path: &Path, bytes: &[u8]) -> Result<(), SinkError> {
    write_pieces(path, bytes, &|| ())
}

/// Bytes that are written and synced at a time: a slow disk takes a fifth of a second for them.
const PIECE: usize = 16 << 20;

/// The same; `between` is called between the pieces of a large file.
fn write_pieces(path: &Path, bytes: &[u8], between: &dyn Fn()) -> Result<(), SinkError> {
    let write = || {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let mut file = File::create(path)?;
        for (number, piece) in bytes.chunks(PIECE).enumerate() {
            if number > 0 {
                file.sync_data()?;
                between();
            }
            file.write_all(piece)?;
        }
        file.sync_all()
    };
    write().map_err(at(path))
}

/// Writes a file that is there as a whole or not at all.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), SinkError> {
    let mut name = path.as_os_str().to_owned();
    name.push(".new");
    let unfinished = PathBuf::from(name);
    write_synced(&unfinished, bytes)?;
    std::fs::rename(&unfinished, path).map_err(at(path))
}

/// Makes a folder and returns those that were not there, the outermost first.
pub(super) fn make_folders(folder: &Path) -> Result<Vec<PathBuf>, SinkError> {
    let missing = |path: &&Path| *path != Path::new("") && !exists(path);
    let mut made: Vec<PathBuf> = folder
        .ancestors()
        .take_while(missing)
        .map(Path::to_owned)
        .collect();
    made.reverse();
    std::fs::create_dir_all(folder).map_err(|error| {
        unmake(&made);
        at(folder)(error)
    })?;
    Ok(made)
}

/// Removes folders that were made and are empty.
pub(super) fn unmake(made: &[PathBuf]) {
    for folder in made.iter().rev() {
        std::fs::remove_dir(folder).ok();
    }
}

fn has_files(dir: &Path) -> bool {
    std::fs::read_dir(dir).is_ok_and(|mut entries| entries.next().is_some())
}

/// The working folder and its lock, which goes last.
fn remove(dir: &Path) {
    for folder in [NEW, OLD] {
        std::fs::remove_dir_all(dir.join(folder)).ok();
    }
    std::fs::remove_file(dir.join(LOCK)).ok();
    std::fs::remove_dir(dir).ok();
}

/// Removes working folders of runs that were killed; what they were replacing comes back.
fn sweep(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let numbers = name.to_str().and_then(|n| n.strip_prefix(UNFINISHED));
        if numbers.is_none_or(|n| !n.starts_with('-')) || !entry.path().is_dir() {
            continue;
        }
        let dir = entry.path();
        let Ok(file) = OpenOptions::new().append(true).open(dir.join(LOCK)) else {
            // Killed before it had a lock; one with anything in it is not ours, and stays.
            std::fs::remove_dir(&dir).ok();
            continue;
        };
        if matches!(lock(&file), Lock::Ours) {
            restore_old(&dir);
            remove(&dir);
        }
    }
}

/// Puts folders back that were set aside and not replaced, into the folder where the working folder is.
fn restore_old(dir: &Path) {
    let (Some(folder), Ok(entries)) = (dir.parent(), std::fs::read_dir(dir.join(OLD))) else {
        return;
    };
    for entry in entries.flatten() {
        let place = folder.join(entry.file_name());
        if !exists(&place) {
            std::fs::rename(entry.path(), place).ok();
        }
    }
}

/// Whether an open file is the one of this name: another process may have removed it before it was locked.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let (Ok(open), Ok(named)) = (file.metadata(), std::fs::metadata(path)) else {
        return false;
    };
    (open.dev(), open.ino()) == (named.dev(), named.ino())
}

/// Whether the file of this name is there still; that it is the open one is not known.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_files_are_written_piece_by_piece() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/large");
        let bytes: Vec<u8> = (0..=2 * PIECE).map(|i| (i % 251) as u8).collect();
        let asked = std::cell::Cell::new(0);
        write_pieces(&path, &bytes, &|| asked.set(asked.get() + 1)).unwrap();
        assert_eq!(asked.get(), 2);
        assert!(std::fs::read(&path).unwrap() == bytes);
        write_pieces(&path, &bytes[..PIECE], &|| panic!("a small file")).unwrap();
    }
}
