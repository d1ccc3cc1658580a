//! Damaged files do not make the readers take memory: a small multiple of the file at most.

mod common;
mod mutation;

use std::cell::Cell;

use mutation::{Dice, samples, survive};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

const MUTATIONS: u64 = 400;
/// Texts become numbers of eight bytes, headers lists of words.
const MULTIPLE: usize = 16;
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
        for number in 0..MUTATIONS {
            let taken = Cell::new(0);
            let length = Cell::new(0);
            sample.damaged(&mut Dice(number), |bytes| {
                let before = MEMORY.current_usage();
                MEMORY.reset_peak_usage();
                survive(bytes, &|_| number % 20 == 0);
                taken.set(MEMORY.peak_usage().saturating_sub(before));
                length.set(bytes.len());
            });
            let (taken, length) = (taken.get(), length.get());
            assert!(
                taken <= MULTIPLE * length + ALWAYS,
                "{name}: mutation {number} of {length} bytes took {taken}"
            );
            let share = taken as f64 / length.max(4096) as f64;
            if share > greatest.0 {
                greatest = (share, name.clone());
            }
        }
    }
    let (share, name) = greatest;
    println!("at most {share:.1} times the length of a file ({name})");
}
