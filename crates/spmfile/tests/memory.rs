//! Damaged files do not make the readers take memory: a small multiple of what they take whole at most.

mod common;
mod mutation;

use std::cell::Cell;

use mutation::{Dice, samples, survive};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

const MUTATIONS: u64 = 400;
/// Of the bytes of the file, or of what reading it takes when it is whole.
const MULTIPLE: usize = 4;
/// The first lines of what may be a text.
const ALWAYS: usize = 256 << 10;

/// The only test of this program, as the memory of others would be counted as well.
#[test]
fn memory_is_bounded_by_the_file() {
    let Some(data) = common::testdata("memory_is_bounded_by_the_file") else {
        return;
    };
    let mut greatest = (0.0, String::new());
    for mut sample in samples(&data) {
        let name = sample.name.clone();
        let whole = taken(&sample.bytes, 0).max(sample.bytes.len());
        for number in 0..MUTATIONS {
            let found = Cell::new(0);
            sample.damaged(&mut Dice(number), |bytes| found.set(taken(bytes, number)));
            let found = found.get();
            assert!(
                found <= MULTIPLE * whole + ALWAYS,
                "{name}: mutation {number} took {found} bytes, the whole file {whole}"
            );
            let share = found as f64 / whole.max(ALWAYS) as f64;
            if share > greatest.0 {
                greatest = (share, name.clone());
            }
        }
    }
    let (share, name) = greatest;
    println!("at most {share:.1} times what the whole file takes ({name})");
}

/// The memory that reading takes; of one in twenty all samples are decoded.
fn taken(bytes: &[u8], number: u64) -> usize {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    survive(bytes, &|_| number.is_multiple_of(20));
    MEMORY.peak_usage().saturating_sub(before)
}
