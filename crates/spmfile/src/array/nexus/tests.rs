//! The files were written by another program: see `scan.py`.

use crate::{Format, Scan, WritableFormat, read};

const SCAN: &[u8] = include_bytes!("scan.nxs");
const ARRAY: &[u8] = include_bytes!("array.h5");
const TWO: &[u8] = include_bytes!("two.h5");

/// The samples of an image, the bottom line first.
fn samples(image: usize) -> Vec<f64> {
    let sample = |line: usize, column: usize| (100 * line + column + 10_000 * image) as f64;
    (0..3)
        .flat_map(|line| (0..5).map(move |column| sample(line, column)))
        .collect()
}

fn scan() -> Scan {
    assert_eq!(crate::detect(SCAN), Format::Hdf5);
    read(SCAN).expect("images")
}

/// From the top down, with x as the first dimension, and behind each other: all become the same image.
#[test]
fn positions_tell_where_samples_are() {
    let scan = scan();
    let expected = [
        ("topography", "m", 0),
        ("current", "A", 0),
        ("didv (bias -0.5 V)", "S", 0),
        ("didv (bias 0.1 V)", "S", 1),
    ];
    let mut found: Vec<_> = scan.channels.iter().collect();
    found.sort_by_key(|channel| expected.iter().position(|(name, ..)| *name == channel.name));
    assert_eq!(found.len(), 4);
    for (channel, (name, unit, image)) in found.iter().zip(expected) {
        assert_eq!((&*channel.name, &*channel.unit), (name, unit));
        assert_eq!(channel.values(), samples(image), "{name}");
        let [across, up] = channel.pitch_nm().expect("a pitch");
        assert!((across - 2.0).abs() + (up - 3.0).abs() < 1e-9, "{name}");
    }
    assert_eq!(scan.notes, [super::UNTESTED]);
    let files = crate::write(&scan, WritableFormat::Gwy, "scan", &[]).expect("a container");
    let again = read(&files[0].1).expect("whole");
    assert_eq!(again.channels.len(), scan.channels.len());
    for (read, written) in again.channels.iter().zip(&scan.channels) {
        assert_eq!((&read.name, &read.unit), (&written.name, &written.unit));
        // Containers hold values in metres and the like.
        let pairs = read.values().into_iter().zip(written.values());
        assert!(
            pairs
                .into_iter()
                .all(|(a, b)| (a - b).abs() <= 1e-9 * b.abs())
        );
    }
    let [curve] = &scan.unreadable[..] else {
        panic!("{:?}", scan.unreadable);
    };
    assert!(curve.error.contains("bias [4] in \"V\""), "{}", curve.error);
}

/// One array is an image without a size, two are a choice that nobody made.
#[test]
fn a_single_array_is_an_image() {
    assert_eq!(crate::detect(ARRAY), Format::Hdf5);
    let scan = read(ARRAY).expect("an image");
    let [channel] = &scan.channels[..] else {
        panic!("{} channels", scan.channels.len());
    };
    assert_eq!((&*channel.name, channel.width_nm), ("results/height", None));
    assert_eq!(channel.values(), samples(0));
    assert_eq!(scan.notes, [super::BARE]);
    let error = read(TWO).expect_err("two images").to_string();
    assert!(error.contains("height [3, 5], phase [3, 5]"), "{error}");
    for cut in [8, 600, 1500] {
        let error = read(&ARRAY[..cut]).expect_err("cut off").to_string();
        assert!(error.contains("HDF5"), "{error}");
    }
}

/// What contradicts itself is refused: uneven steps, and positions that are too few.
#[test]
fn positions_that_do_not_fit_are_told() {
    let mut bytes = SCAN.to_vec();
    let place =
        memchr::memmem::find(&bytes, &60f64.to_le_bytes()).expect("positions from the top down");
    bytes[place..place + 8].copy_from_slice(&90f64.to_le_bytes());
    let scan = read(&bytes).expect("other images");
    let told: Vec<&str> = scan.unreadable.iter().map(|one| &*one.error).collect();
    assert!(
        told.iter().any(|error| error.contains("even steps")),
        "{told:?}"
    );
}
