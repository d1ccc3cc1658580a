//! Damaged sessions end in an error or in something that can be true, and soon.

use super::writer::{V, data, session};
use super::{STORED, counts, read, refused};
use crate::matrix::read as read_frame;
use crate::scan::FrameDirection;

/// Another name than that of the fuzzer's seeds, which these would be too many of.
const NAME: &str = "s--2_1.Z_mtrx";

/// `SplitMix64` of Steele, Lea and Flood, 2014.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn survive(bytes: &[u8], log: &[u8], frame: FrameDirection) -> bool {
    match read_frame(bytes, &[log], NAME, Some(frame), &|_| true) {
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
        Ok(scan) => {
            for channel in &scan.channels {
                assert_eq!(channel.samples.len(), channel.rows * channel.columns);
                assert!(channel.scale.is_finite() && channel.offset.is_finite());
                // Nothing of this file makes a large image.
                assert!(channel.samples.len() < 1000);
            }
            true
        }
    }
}

#[test]
fn cut_off_anywhere() {
    let log = session().stored(STORED, NAME).0;
    let bytes = data(STORED, 7, 48, &counts(48));
    let up = FrameDirection::Up;
    for end in 0..bytes.len() {
        assert!(!survive(&bytes[..end], &log, up), "data of {end} bytes");
    }
    for end in 0..log.len() {
        assert!(!survive(&bytes, &log[..end], up), "log of {end} bytes");
    }
    assert!(survive(&bytes, &log, up));
}

#[test]
fn mutations() {
    let log = session()
        .change(5, "XYScanner", "Zoom", "--", V::Long(1))
        .mark("MTRX$SAMPLE_NAME-x")
        .stored(STORED, NAME)
        .0;
    let bytes = data(STORED, 7, 48, &counts(48));
    let mut read = 0;
    for seed in 0..20_000u64 {
        let mut dice = seed;
        let (mut bytes, mut log) = (bytes.clone(), log.clone());
        for _ in 0..=next(&mut dice) % 3 {
            let file = if next(&mut dice).is_multiple_of(3) {
                &mut bytes
            } else {
                &mut log
            };
            let at = (next(&mut dice) as usize) % file.len();
            file[at] = match next(&mut dice) % 4 {
                0 => 0,
                1 => 0xff,
                2 => file[at] ^ 1 << (next(&mut dice) % 8),
                _ => next(&mut dice) as u8,
            };
        }
        let frame = [FrameDirection::Up, FrameDirection::Down][(seed % 2) as usize];
        read += u32::from(survive(&bytes, &log, frame));
    }
    // Neither all nor none of them are read.
    assert!((1_000..19_000).contains(&read), "{read}");
}

/// A header may not make a few samples a picture that fills the memory.
#[test]
fn announced_sizes_do_not_fill_the_memory() {
    let size = |points, lines| {
        session()
            .change(5, "XYScanner", "Points", "Count", V::Long(points))
            .change(5, "XYScanner", "Lines", "Count", V::Long(lines))
            .stored(STORED, super::NAME)
    };
    let bytes = |intended| data(STORED, 7, intended, &counts(9));
    let big = read(&bytes(4 * 20_000 * 20_000), &size(20_000, 20_000), None);
    assert!(refused(big).contains("20000 lines of 20000"));
    let most = read(&bytes(4 * 50_000 * 20_000), &size(i32::MAX, i32::MAX), None);
    assert!(refused(most).contains("expected frames of 4000000000 samples"));
    let fine = read(&bytes(4 * 100 * 100), &size(100, 100), None).expect("small");
    assert_eq!(fine.channels[0].samples.len(), 10_000);
    // More samples than the file has bytes.
    let mut cut = data(STORED, 7, 48, &counts(48));
    cut.truncate(cut.len() - 4);
    let log = session().stored(STORED, super::NAME);
    assert!(refused(read(&cut, &log, None)).contains("DATA"));
}
