//! Files → measured scans, one file in memory per thread.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use moiregauge::campaign::about_repeat;
use moiregauge::caveat::Caveat;
use moiregauge::numbers::interrupt;
use moiregauge::scan::{MeasuredScan, Window, measure_moires};
use moiregauge::settings::Settings;
use moiregauge_report::InputFile;
use moiregauge_report::results::NamedSet;
use rayon::prelude::*;

use super::channel::{Other, others};
use super::failure::{Advice, Failure};
use super::kept::{Heard, Kept, With};
use crate::job::{Cancelled, Job};
use crate::known::Known;
use crate::memory::enough_for;
use crate::opened::{InputError, Opened, Reading, read_scan};
use crate::session::is_second_frame;
use crate::sets::set_of;
use crate::stamp::Stamp;
use crate::twice::Repeated;

/// What is to be measured, and how.
pub(super) struct Inputs<'a> {
    pub(super) files: &'a [PathBuf],
    pub(super) sets: &'a [NamedSet],
    pub(super) known: &'a Known,
    pub(super) window: Option<&'a Window>,
    pub(super) advice: Advice,
    /// Who is given each file as soon as it is measured.
    pub(super) heard: Option<&'a Heard>,
}

/// The moirés of a file and what identifies it, or why there are none.
pub(super) type OfFile = Result<(Vec<MeasuredScan>, InputFile), Failure>;

/// What was measured.
pub(super) struct Measured {
    /// In the order of the files.
    pub(super) files: Vec<OfFile>,
    /// Where the usual channel shows no lattice: the one that was measured.
    pub(super) other: Option<Other>,
}

/// Measures all files that are not among those kept; in another channel, where none shows a lattice in the usual one.
///
/// # Errors
/// [`Cancelled`]; what was measured until then is kept.
pub(super) fn measured(
    inputs: &Inputs,
    settings: &Settings,
    kept: &mut Kept,
    job: &Job,
) -> Result<Measured, Cancelled> {
    let files = inputs.measure_all(settings, kept, job)?;
    for other in others(inputs.files, &files, settings, inputs.known) {
        let files = inputs.measure_all(&other.settings, kept, job)?;
        if files.iter().any(Result::is_ok) {
            let other = Some(other);
            return Ok(Measured { files, other });
        }
    }
    Ok(Measured { files, other: None })
}

impl Inputs<'_> {
    fn measure_all(
        &self,
        settings: &Settings,
        kept: &mut Kept,
        job: &Job,
    ) -> Result<Vec<OfFile>, Cancelled> {
        let with = With::new(settings, self.known, self.window);
        let stage = job.stage("measuring", "scans", self.files.len());
        let (new, read) = (Mutex::new(Vec::new()), Mutex::new(Vec::new()));
        let known_before = &*kept;
        let all = job.run(|| {
            let all = self.files.par_iter().map(|path| {
                let (key, result) = self.one(path, settings, &with, known_before, &read);
                if let Some(key) = key {
                    let measured = result.as_ref().map(|(moires, _)| moires.clone());
                    let measured = measured.map_err(Clone::clone);
                    if let Some(heard) = self.heard {
                        heard(&key, Kept::of(&key, measured.clone()));
                    }
                    keep(&new, key, measured);
                }
                stage.step();
                result
            });
            all.collect::<Vec<_>>()
        });
        for (key, measured) in new.into_inner().unwrap_or_else(PoisonError::into_inner) {
            kept.put(key, measured);
        }
        for (path, stamp, input) in read.into_inner().unwrap_or_else(PoisonError::into_inner) {
            kept.was_read(path, stamp, input);
        }
        let mut all = all?;
        for (path, result) in self.files.iter().zip(&mut all) {
            let set = set_of(self.sets, path);
            for scan in result.iter_mut().flat_map(|(moires, _)| moires) {
                scan.set = set.map(str::to_owned);
            }
        }
        Ok(all)
    }

    /// One file: under what it is to be kept, where it was not kept already, and what it gives.
    fn one(
        &self,
        path: &Path,
        settings: &Settings,
        with: &With,
        kept: &Kept,
        read: &Read,
    ) -> (Option<String>, OfFile) {
        interrupt::check();
        let stamp = kept.stamp(self.known.place(path));
        if let Some(input) = stamp.and_then(|stamp| kept.identity(path, stamp)) {
            let key = with.key(path, &input.file, &input.sha256, self.known);
            if let Some(known) = kept.get(&key) {
                let measured = known.clone().map(|moires| (moires, input.clone()));
                return (None, measured);
            }
        }
        let failed = |error: &InputError| Err(Failure::of(error, self.advice));
        let opened = match Opened::new(path, self.known) {
            Ok(opened) => opened,
            Err(error) => return (None, failed(&error)),
        };
        // Where nothing is kept the file is measured in any case: it is hashed beside being decoded.
        let early = kept.is_empty().then(|| opened.reading(settings));
        let input = opened.identity();
        if let Some(stamp) = stamp {
            let mut read = read.lock().unwrap_or_else(PoisonError::into_inner);
            read.push((path.to_owned(), stamp, input.clone()));
        }
        let key = with.key(path, &input.file, &input.sha256, self.known);
        if let Some(known) = kept.get(&key) {
            return (None, known.clone().map(|moires| (moires, input)));
        }
        interrupt::check();
        let reading = early.unwrap_or_else(|| opened.reading(settings));
        let reading = reading.and_then(|r| enough_for(&r.scan).map(|()| r).map_err(Into::into));
        drop(opened);
        match reading.and_then(|reading| of_reading(reading, settings, self.window)) {
            Ok(found) => (Some(key), Ok(found)),
            // With more memory it may do.
            Err(error @ InputError::Memory(_)) => (None, failed(&error)),
            Err(error) => (Some(key), failed(&error)),
        }
    }
}

/// Files that were read, with what they were like before.
type Read = Mutex<Vec<(PathBuf, Stamp, InputFile)>>;
type New = Mutex<Vec<(String, Result<Vec<MeasuredScan>, Failure>)>>;

fn keep(new: &New, key: String, measured: Result<Vec<MeasuredScan>, Failure>) {
    let mut new = new.lock().unwrap_or_else(PoisonError::into_inner);
    new.push((key, measured));
}

/// One file: its moirés and what identifies it.
///
/// # Errors
/// [`InputError`] says why it has none.
pub fn measure_file(
    path: &Path,
    settings: &Settings,
    known: &Known,
) -> Result<(Vec<MeasuredScan>, InputFile), InputError> {
    of_reading(read_scan(path, settings, known)?, settings, None)
}

fn of_reading(
    reading: Reading,
    settings: &Settings,
    window: Option<&Window>,
) -> Result<(Vec<MeasuredScan>, InputFile), InputError> {
    let Reading {
        scan,
        input,
        caveats,
    } = reading;
    let mut moires = measure_moires(&input.file, &scan, settings, window)?;
    for measured in &mut moires {
        measured.caveats.extend(caveats.iter().cloned());
        // A file may hold two frames.
        let frame = if is_second_frame(Path::new(&input.file)) {
            " down"
        } else {
            ""
        };
        measured.digest = Some(format!("{}{frame}", input.sha256));
    }
    Ok((moires, input))
}

/// Caveats about files that were named more than once.
pub fn given_again(repeated: &[Repeated]) -> Vec<Caveat> {
    let words = |again: &Repeated| {
        let of = again.of.display().to_string();
        about_repeat(&again.path.display().to_string(), &of)
    };
    let mut caveats: Vec<Caveat> = repeated.iter().map(words).collect();
    caveats.dedup();
    caveats
}
