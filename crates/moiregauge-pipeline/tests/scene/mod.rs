//! A folder that fills, and its watch.

#![allow(dead_code, reason = "each user takes what it needs")]

use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use moiregauge_pipeline::watch::{Line, Watch, WatchRequest};
use moiregauge_pipeline::{Job, find};
use tempfile::TempDir;

use super::small::{campaign, document, scans, settings};

/// A folder that is watched, and another one with the frames that come into it.
pub(crate) struct Scene {
    pub(crate) source: TempDir,
    pub(crate) folder: TempDir,
    pub(crate) watch: Watch,
    pub(crate) job: Job<'static>,
    pub(crate) frames: Vec<PathBuf>,
    /// Dates of files: clocks of file systems may be slower than tests.
    pub(crate) clock: SystemTime,
}

impl Scene {
    pub(crate) fn new(count: usize) -> Self {
        Self::with(count, |request| request)
    }

    pub(crate) fn with(count: usize, change: impl FnOnce(WatchRequest) -> WatchRequest) -> Self {
        let (source, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let request = change(WatchRequest {
            folder: folder.path().to_owned(),
            settings: settings(),
            patience: 3,
            ..WatchRequest::default()
        });
        Self {
            frames: scans(source.path(), count),
            watch: Watch::new(request).unwrap(),
            job: Job::quiet(Some(2)).unwrap(),
            clock: SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000),
            source,
            folder,
        }
    }

    pub(crate) fn bytes(&self, frame: usize) -> Vec<u8> {
        std::fs::read(&self.frames[frame]).unwrap()
    }

    pub(crate) fn write(&mut self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        self.clock += Duration::from_secs(2);
        let file = File::options().append(true).open(&path).unwrap();
        file.set_modified(self.clock).unwrap();
        path
    }

    pub(crate) fn arrive(&mut self, frame: usize) {
        let name = self.frames[frame].file_name().unwrap().to_owned();
        let bytes = self.bytes(frame);
        self.write(name.to_str().unwrap(), &bytes);
    }

    pub(crate) fn look(&mut self) -> Vec<Line> {
        self.watch.look(&self.job).unwrap()
    }

    /// The lines of as many steps as it takes to see that nothing changes.
    pub(crate) fn settle(&mut self) -> Vec<Line> {
        (0..3).flat_map(|_| self.look()).collect()
    }

    /// The numbers are those of an analysis of the folder as it is, to the last bit.
    pub(crate) fn is_as_analysed(&mut self) {
        let (inputs, left_out) = find(&[self.folder.path().to_owned()]).frames();
        let mut fresh = campaign(&inputs).with_left_out(left_out);
        let fresh = document(&fresh.analyse(&self.job).unwrap());
        assert_eq!(document(&self.watch.outcomes(&self.job).unwrap()), fresh);
    }
}

pub(crate) fn names(line: &Line) -> Vec<&str> {
    let name = |file: &String| {
        Path::new(file.as_str())
            .file_name()
            .unwrap()
            .to_str()
            .unwrap()
            .to_owned()
    };
    line.files
        .iter()
        .map(|f| &f[f.len() - name(f).len()..])
        .collect()
}

pub(crate) fn codes(line: &Line) -> Vec<&str> {
    line.warnings.iter().map(|w| w.code.as_str()).collect()
}
