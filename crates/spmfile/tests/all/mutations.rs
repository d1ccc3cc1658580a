//! Damaged copies of every real file: no reader panics or hangs, and what is read can be true.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use spmfile::{File, OpenOptions};

use crate::common;
use crate::mutation::{Dice, Sample, samples, survive};

/// Copies that are opened; one in ten of them is read in both ways.
const OPENED: u64 = 400;
/// One copy in this number is decoded; in the others only the headers matter.
const DECODED: u64 = 250;
/// Reading a damaged file takes milliseconds; a loaded machine makes that more.
const LONGEST: Duration = Duration::from_secs(5);

/// Damaged copies of each file, or as many as `MOIREGAUGE_MUTATIONS` says: `docs/draws.sh` asks for ten thousand.
fn mutations() -> u64 {
    let asked = std::env::var("MOIREGAUGE_MUTATIONS").ok();
    asked.map_or(1000, |n| {
        n.parse().expect("MOIREGAUGE_MUTATIONS is a number")
    })
}

fn check(sample: &mut Sample, mutations: u64) {
    for number in 0..mutations {
        let start = Instant::now();
        let mut dice = Dice(number);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            sample.damaged(&mut dice, |bytes| {
                survive(bytes, &|_| number % DECODED == 0);
            });
        }));
        let name = &sample.name;
        assert!(outcome.is_ok(), "{name}: mutation {number}");
        let time = start.elapsed();
        assert!(time < LONGEST, "{name}: mutation {number} took {time:?}");
    }
}

#[test]
fn no_reader_stumbles() {
    let Some(data) = common::testdata("no_reader_stumbles") else {
        return;
    };
    let (samples, mutations) = (samples(&data), mutations());
    let count = samples.len();
    assert!(count > 0);
    let queue: Vec<_> = samples.into_iter().map(std::sync::Mutex::new).collect();
    let next = AtomicUsize::new(0);
    let workers = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some(sample) = queue.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let mut sample = sample.lock().expect("no other worker has it");
                    let start = Instant::now();
                    check(&mut sample, mutations);
                    println!("{:>6.2} s {}", start.elapsed().as_secs_f64(), sample.name);
                }
            });
        }
    });
    println!("{mutations} damaged copies of each of {count} files");
}

/// Channel by channel and row by row, damaged files are as plausible as at once.
#[test]
fn damaged_files_are_opened_or_refused() {
    let Some(data) = common::testdata("damaged_files_are_opened_or_refused") else {
        return;
    };
    let mut options = OpenOptions::default();
    options.damaged = true;
    let bits = |values: &[f64]| -> Vec<u64> { values.iter().map(|v| v.to_bits()).collect() };
    for mut sample in samples(&data) {
        let name = sample.name.clone();
        for number in 0..OPENED {
            sample.damaged(&mut Dice(number), |bytes| {
                let file = match File::open_with(bytes, &options) {
                    Ok(file) => file,
                    Err(error) => return assert!(!error.to_string().is_empty(), "{name}"),
                };
                if number % 10 != 0 {
                    return;
                }
                for frame in file.frames() {
                    for (channel, header) in frame.channels().enumerate() {
                        let last = header.rows - 1..header.rows;
                        let whole = frame.read(channel);
                        match (frame.rows(channel, last.clone()), whole) {
                            (Ok(row), Ok(whole)) => {
                                assert_eq!(bits(&row), bits(&whole.lines(last)), "{name}");
                            }
                            (Err(error), Err(_)) => assert!(!error.to_string().is_empty()),
                            (row, whole) => panic!("{name}: {row:?} {whole:?}"),
                        }
                    }
                }
            });
        }
    }
}
