//! Stopped at random moments: every long call ends soon, loses nothing that was measured, and the next call makes the
//! same bytes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use moiregauge_pipeline::campaign::AnalyseError;
use moiregauge_pipeline::convert::{ConvertRequest, convert};
use moiregauge_pipeline::maps::{MapRequest, NotMapped};
use moiregauge_pipeline::samples::{Samples, SamplesError, analyse_samples, samples_in};
use moiregauge_pipeline::sink::{FileSink, Forget, Keep, MemorySink, Part, SinkError};
use moiregauge_pipeline::validate::{ValidateError, ValidateRequest};
use moiregauge_pipeline::{Cancel, Cancelled, Job, Known, Quiet, map, validate};
use moiregauge_report::Choice;
use moiregauge_report::results::UserSpecified;
use spmfile::WritableFormat;

use crate::small;
use crate::small::{campaign, document, scans, settings};

/// Ten times what is promised: the processors may be busy.
const SOON: Duration = Duration::from_secs(3);
/// Moments at which each call is stopped.
const MOMENTS: u32 = 6;

/// Random numbers from 0 to 1, others in every run; a failure says with which it comes again.
struct Random(u64);

impl Random {
    fn new() -> Self {
        let clock = std::time::SystemTime::UNIX_EPOCH.elapsed();
        let seed = clock.map_or(1, |time| u64::from(time.subsec_nanos()));
        println!("seed {seed}");
        Self(seed)
    }

    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 33) as f64 / f64::from(u32::MAX >> 1)
    }
}

/// Does work again and again, each time stopped at another random moment, then once to its end. `work` gives `None`
/// where it was stopped, and may keep what it has done.
fn at_random_moments<T: PartialEq + Send + std::fmt::Debug>(
    alone: &mut (dyn FnMut(&Job) -> Option<T> + Send),
    work: &mut (dyn FnMut(&Job) -> Option<T> + Send),
) {
    let job = Job::quiet(Some(2)).unwrap();
    let started = Instant::now();
    let whole = alone(&job).expect("nobody stops it");
    let length = started.elapsed();
    let mut random = Random::new();
    let mut stopped = 0;
    for _ in 0..MOMENTS {
        let cancel = Cancel::new();
        let job = Job::new(Some(2), cancel.clone(), &Quiet).unwrap();
        let moment = length.mul_f64(random.next());
        let (found, late) = std::thread::scope(|scope| {
            let running = scope.spawn(|| (work(&job), Instant::now()));
            std::thread::sleep(moment);
            cancel.cancel();
            let asked = Instant::now();
            let (found, ended) = running.join().unwrap();
            (found, ended.saturating_duration_since(asked))
        });
        assert!(late < SOON, "{late:?} after {moment:?} of {length:?}");
        match found {
            Some(found) => assert_eq!(found, whole),
            None => stopped += 1,
        }
    }
    assert_eq!(work(&job).expect("nobody stops it"), whole);
    println!("{stopped} of {MOMENTS} stopped in {length:?}");
}

#[test]
fn analyses_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let scans = scans(folder.path(), 6);
    let mut kept = 0;
    let mut growing = campaign(&scans);
    at_random_moments(
        &mut |job| Some(document(&campaign(&scans).analyse(job).unwrap())),
        &mut |job| {
            let found = growing.analyse(job);
            assert!(growing.kept().len() >= kept);
            kept = growing.kept().len();
            match found {
                Ok(found) => Some(document(&found)),
                Err(AnalyseError::Cancelled(_)) => None,
                Err(error) => panic!("{error}"),
            }
        },
    );
}

/// The document of a map.
fn mapped(
    request: &MapRequest,
    scans: &[std::path::PathBuf],
    keep: &dyn Keep,
    job: &Job,
) -> Option<Vec<u8>> {
    let found = match map(&mut campaign(scans), request, keep, job) {
        Ok(found) => found,
        Err(NotMapped::Cancelled(_)) => return None,
        Err(error) => panic!("{error}"),
    };
    let sink = MemorySink::new();
    let choice = Choice {
        figures: false,
        png: false,
        html: false,
        ..Choice::default()
    };
    found.write(request, choice, &sink).unwrap();
    Some(sink.commit("map").unwrap().remove("map.json").unwrap())
}

#[test]
fn maps_are_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small::scans_of(folder.path(), 3, 128);
    let request = MapRequest::default();
    let work = |job: &Job| mapped(&request, &scans, &Forget, job);
    at_random_moments(&mut { work }, &mut { work });
}

/// Bands in memory.
#[derive(Default)]
struct Bands(Mutex<BTreeMap<String, Vec<u8>>>);

impl Keep for Bands {
    fn keep(&self, name: &str, bytes: &[u8]) -> Result<(), SinkError> {
        self.0
            .lock()
            .unwrap()
            .insert(name.to_owned(), bytes.to_vec());
        Ok(())
    }

    fn kept(&self, name: &str) -> Part {
        match self.0.lock().unwrap().get(name) {
            Some(bytes) => Part::Whole(bytes.clone()),
            None => Part::Absent,
        }
    }
}

#[test]
fn surveys_keep_their_bands() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small::scans_of(folder.path(), 1, 384);
    let request = MapRequest {
        in_bands: true,
        ..MapRequest::default()
    };
    let bands = Bands::default();
    at_random_moments(
        &mut |job| mapped(&request, &scans, &Forget, job),
        &mut |job| {
            let before = bands.0.lock().unwrap().len();
            let found = mapped(&request, &scans, &bands, job);
            assert!(bands.0.lock().unwrap().len() >= before);
            found
        },
    );
    assert!(!bands.0.lock().unwrap().is_empty());
}

#[test]
fn validations_are_stopped() {
    let mut request = ValidateRequest {
        sets: 4,
        ..ValidateRequest::default()
    };
    request.conditions.raster.pixels = [64; 2];
    request.conditions.raster.scans = 2;
    let work = |job: &Job| match validate(&request, job) {
        Ok(found) => Some(serde_json::to_string(&found).unwrap()),
        Err(ValidateError::Cancelled(_)) => None,
        Err(error) => panic!("{error}"),
    };
    at_random_moments(&mut { work }, &mut { work });
}

/// All files of a campaign, by their names.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            let inner = files(&path).into_iter();
            all.extend(inner.map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            all.insert(name, std::fs::read(&path).unwrap());
        }
    }
    all
}

#[test]
fn campaigns_keep_their_samples() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("samples");
    for sample in ["a", "b", "c"] {
        let place = root.join(sample);
        std::fs::create_dir_all(&place).unwrap();
        scans(&place, 2);
    }
    let work = |out: &Path, job: &Job| {
        let all = samples_in(&root, out).unwrap();
        let asked = Samples::new(&root, all, settings(), UserSpecified::default()).unwrap();
        match analyse_samples(&asked, out, job) {
            Ok(_) => Some(files(out)),
            Err(SamplesError::Cancelled(_)) => None,
            Err(error) => panic!("{error}"),
        }
    };
    let (alone, out) = (folder.path().join("alone"), folder.path().join("out"));
    at_random_moments(&mut |job| work(&alone, job), &mut |job| work(&out, job));
}

/// Writing is stopped, too: what comes after the reading of a scan takes seconds where images are large.
#[test]
fn conversions_are_stopped_while_they_write() {
    let folder = tempfile::tempdir().unwrap();
    let scan = &scans(folder.path(), 1)[0];
    let out = folder.path().join("out");
    for format in WritableFormat::ALL {
        let request = ConvertRequest::new(format);
        let stopped = |work: &(dyn Fn() + Sync)| {
            let cancel = Cancel::new();
            let job = Job::new(Some(1), cancel.clone(), &Quiet).unwrap();
            job.run(|| {
                cancel.cancel();
                work();
            })
        };
        let known = Known::default();
        let made = convert(scan, &known, &request, "scan").unwrap();
        let convert = || drop(convert(scan, &known, &request, "scan"));
        assert_eq!(stopped(&convert), Err(Cancelled), "{format:?}");
        let sink = FileSink::open(&out, false, &[]).unwrap();
        let named = made.into_iter().map(|(name, bytes)| (name.into(), bytes));
        let named: Vec<(PathBuf, Vec<u8>)> = named.collect();
        let write = || drop(sink.write(&named));
        assert_eq!(stopped(&write), Err(Cancelled), "{format:?}");
        drop(sink);
        assert!(!out.exists(), "{format:?}");
    }
}
