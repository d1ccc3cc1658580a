//! The files of a folder, from step to step: what is there, what is whole, what is gone.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use moiregauge_report::FailedInput;
use spmfile::Format;

use crate::find::{self, Look};
use crate::names::in_words;
use crate::session::{one_per_frame, second_frame};
use crate::stamp::Stamp;

/// Steps without a file after which it is gone: one listing of a network share may leave it out.
const MISSING: usize = 2;

/// Whether a file can be read as its header promises; otherwise why not.
pub(super) type Whole<'a> = &'a (dyn Fn(&Path) -> Result<(), String> + Sync);

/// What is known of the folder.
#[derive(Clone, Debug)]
pub(super) struct Files {
    folder: PathBuf,
    patience: usize,
    listed: BTreeMap<PathBuf, File>,
    /// Why the folder could not be listed, if it could not.
    lost: Option<String>,
}

#[derive(Clone, Debug)]
struct File {
    stamp: Stamp,
    /// Steps since it last changed.
    unchanged: usize,
    /// Steps since it was last seen.
    missing: usize,
    state: State,
    /// Its second frame, if it holds one.
    second: Option<PathBuf>,
}

#[derive(Clone, Debug)]
enum State {
    /// It has just come.
    New,
    /// It should be a scan and may still be written.
    Waiting(String),
    /// No scan.
    Other,
    /// It can be read.
    Whole(Format),
    /// It cannot be read, and nothing happens to it any more. With its format, if it has the first bytes of a scan.
    GivenUp(Option<Format>, String),
}

/// What a step has found.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    /// What an analysis of the folder would read, by name.
    pub(super) scans: Vec<PathBuf>,
    /// What should be scans and never will be.
    pub(super) left_out: Vec<FailedInput>,
    /// What is not whole yet, and why.
    pub(super) waiting: Vec<FailedInput>,
    /// What became whole in this step: new ones, and those that were written anew.
    pub(super) fresh: Vec<PathBuf>,
    /// What was given up in this step.
    pub(super) given_up: Vec<FailedInput>,
    /// What is no longer there since this step, or no scan any more.
    pub(super) gone: Vec<PathBuf>,
    /// Why the folder cannot be listed, or that it can be again, where that is new.
    pub(super) folder: Option<String>,
}

impl Files {
    pub(super) fn new(folder: &Path, patience: usize) -> Self {
        Self {
            folder: folder.to_owned(),
            patience: patience.max(1),
            listed: BTreeMap::new(),
            lost: None,
        }
    }

    /// One step.
    pub(super) fn look(&mut self, whole: Whole) -> Seen {
        let mut seen = Seen::default();
        match listed(&self.folder) {
            Ok(listed) => {
                if self.lost.take().is_some() {
                    seen.folder = Some("the folder can be read again".to_owned());
                }
                self.forget(&listed, &mut seen);
                for (path, stamp) in listed {
                    self.one(path, stamp, whole, &mut seen);
                }
            }
            // What was there is taken to be there still.
            Err(error) if self.lost.as_ref() != Some(&error) => {
                seen.folder = Some(format!("the folder cannot be read: {error}"));
                self.lost = Some(error);
            }
            Err(_) => {}
        }
        self.collect(&mut seen);
        seen
    }

    /// Files that are listed no more.
    fn forget(&mut self, listed: &BTreeMap<PathBuf, Stamp>, seen: &mut Seen) {
        self.listed.retain(|path, file| {
            file.missing = if listed.contains_key(path) {
                0
            } else {
                file.missing + 1
            };
            let stays = file.missing < MISSING;
            if !stays && !matches!(file.state, State::Other | State::New) {
                seen.gone.push(path.clone());
            }
            stays
        });
    }

    /// A file that is listed.
    fn one(&mut self, path: PathBuf, stamp: Stamp, whole: Whole, seen: &mut Seen) {
        let Some(file) = self.listed.get_mut(&path).filter(|f| f.stamp == stamp) else {
            let again = self.listed.get(&path);
            let was_scan = again.is_some_and(|f| !matches!(f.state, State::Other | State::New));
            let new = File {
                second: None,
                stamp,
                unchanged: 0,
                missing: 0,
                state: if was_scan {
                    State::Waiting("it is being written again".to_owned())
                } else {
                    State::New
                },
            };
            self.listed.insert(path, new);
            return;
        };
        file.unchanged += 1;
        let give_up = file.unchanged >= self.patience;
        let try_now = match file.state {
            State::New | State::Waiting(_) => true,
            // A lock may have gone, or a log may have come, without a change of the file.
            State::GivenUp(..) => file.unchanged.is_multiple_of(self.patience),
            State::Other | State::Whole(_) => false,
        };
        if !try_now {
            return;
        }
        let was_given_up = matches!(file.state, State::GivenUp(..));
        let was_new = matches!(file.state, State::New);
        file.state = match judged(&path, whole) {
            Judged::Other => {
                if !was_new {
                    seen.gone.push(path);
                }
                State::Other
            }
            Judged::Whole(format) => {
                file.second = second_frame(&path);
                seen.fresh.push(path);
                State::Whole(format)
            }
            Judged::Not(format, reason) if give_up => {
                if !was_given_up {
                    seen.given_up.push(failed(&path, reason.clone()));
                }
                State::GivenUp(format, reason)
            }
            Judged::Not(_, reason) => State::Waiting(reason),
        };
    }

    /// What is there after the step.
    fn collect(&self, seen: &mut Seen) {
        let mut scans = Vec::new();
        for (path, file) in &self.listed {
            match &file.state {
                State::Whole(format) | State::GivenUp(Some(format), _) => {
                    scans.push((path.clone(), *format));
                }
                State::GivenUp(None, reason) => seen.left_out.push(failed(path, reason.clone())),
                State::Waiting(reason) => seen.waiting.push(failed(path, reason.clone())),
                State::New | State::Other => {}
            }
        }
        for path in one_per_frame(scans) {
            let second = self.listed[&path].second.clone();
            seen.scans.push(path);
            seen.scans.extend(second);
        }
    }
}

fn failed(path: &Path, error: String) -> FailedInput {
    FailedInput {
        file: in_words(path),
        error,
    }
}

enum Judged {
    Other,
    Whole(Format),
    Not(Option<Format>, String),
}

/// What a file is that was unchanged for a step.
fn judged(path: &Path, whole: Whole) -> Judged {
    match find::look(path) {
        Look::Other | Look::Folder => Judged::Other,
        Look::Failed(reason) => Judged::Not(None, reason),
        Look::Scan(format) => match whole(path) {
            Ok(()) => Judged::Whole(format),
            Err(reason) => Judged::Not(Some(format), reason),
        },
    }
}

/// The files of a folder. What goes while it is listed is not there.
fn listed(folder: &Path) -> Result<BTreeMap<PathBuf, Stamp>, String> {
    let words = |error: std::io::Error| error.to_string();
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(words)? {
        let path = entry.map_err(words)?.path();
        let Ok(found) = std::fs::metadata(&path) else {
            continue;
        };
        if !found.is_dir() {
            files.insert(path, Stamp::from(&found));
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &[u8] = b":NANONIS_VERSION:\n2\n";

    /// A file is whole when it ends so.
    fn whole(path: &Path) -> Result<(), String> {
        let text = std::fs::read(path).map_err(|e| e.to_string())?;
        text.ends_with(b"END")
            .then_some(())
            .ok_or("cut off".to_owned())
    }

    fn names(paths: &[PathBuf]) -> Vec<String> {
        let name = |p: &PathBuf| p.file_name().unwrap().to_string_lossy().into_owned();
        paths.iter().map(name).collect()
    }

    /// Writes a file with another date than before: clocks of file systems may be slow.
    fn write(path: &Path, bytes: &[u8]) {
        let before = std::fs::metadata(path).ok().and_then(|m| m.modified().ok());
        std::fs::write(path, bytes).unwrap();
        if let Some(before) = before {
            let file = std::fs::File::options().append(true).open(path).unwrap();
            file.set_modified(before + std::time::Duration::from_secs(1))
                .unwrap();
        }
    }

    #[test]
    fn files_are_taken_when_they_are_whole_and_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        let scan = folder.path().join("a.sxm");
        let mut files = Files::new(folder.path(), 3);
        let mut look = || files.look(&whole);
        write(&scan, HEAD);
        std::fs::write(folder.path().join("notes.txt"), b"x").unwrap();
        assert!(look().waiting.is_empty());
        let seen = look();
        assert!(seen.fresh.is_empty() && seen.waiting[0].error == "cut off");
        write(&scan, &[HEAD, b"END"].concat());
        assert!(look().fresh.is_empty());
        let seen = look();
        assert_eq!(names(&seen.fresh), ["a.sxm"]);
        assert_eq!(names(&seen.scans), ["a.sxm"]);
        assert!(look().fresh.is_empty());
        // Written anew: at once it is no scan of the folder any more.
        write(&scan, b"");
        let seen = look();
        assert!(seen.scans.is_empty() && seen.gone.is_empty());
        assert_eq!(seen.waiting[0].error, "it is being written again");
        write(&scan, &[HEAD, b"more END"].concat());
        look();
        assert_eq!(names(&look().fresh), ["a.sxm"]);
        // Gone when it is missing twice.
        std::fs::remove_file(&scan).unwrap();
        assert_eq!(look().scans.len(), 1);
        let seen = look();
        assert_eq!(
            (names(&seen.gone), seen.scans.len()),
            (vec!["a.sxm".to_owned()], 0)
        );
    }

    #[test]
    fn what_cannot_be_read_is_told_once_and_tried_again() {
        let folder = tempfile::tempdir().unwrap();
        let (cut, empty) = (folder.path().join("a.sxm"), folder.path().join("b.spm"));
        write(&cut, HEAD);
        write(&empty, b"");
        let mut files = Files::new(folder.path(), 3);
        let mut look = || files.look(&whole);
        let told: Vec<usize> = (0..9).map(|_| look().given_up.len()).collect();
        assert_eq!(told, [0, 0, 0, 2, 0, 0, 0, 0, 0]);
        let seen = look();
        // As in an analysis: what begins as a scan is tried, what does not is left out.
        assert_eq!(
            (names(&seen.scans), seen.left_out.len()),
            (vec!["a.sxm".to_owned()], 1)
        );
        write(&empty, &[HEAD, b"END"].concat());
        look();
        assert_eq!(names(&look().fresh), ["b.spm"]);
    }

    #[test]
    fn a_folder_that_is_away_loses_nothing() {
        let above = tempfile::tempdir().unwrap();
        let (folder, away) = (above.path().join("scans"), above.path().join("away"));
        std::fs::create_dir(&folder).unwrap();
        write(&folder.join("a.sxm"), &[HEAD, b"END"].concat());
        let mut files = Files::new(&folder, 3);
        let mut look = || files.look(&whole);
        look();
        assert_eq!(look().fresh.len(), 1);
        std::fs::rename(&folder, &away).unwrap();
        assert!(look().folder.is_some());
        for _ in 0..5 {
            let seen = look();
            assert!(seen.folder.is_none() && seen.gone.is_empty() && seen.scans.len() == 1);
        }
        std::fs::rename(&away, &folder).unwrap();
        assert!(look().folder.unwrap().contains("again"));
    }
}
