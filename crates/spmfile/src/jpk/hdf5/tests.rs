//! The files were written by another program: see `film.py`.

use super::*;
use crate::Format;

const FILM: &[u8] = include_bytes!("film.h5-jpk");
const SINGLE: &[u8] = include_bytes!("single.h5-jpk");

/// The counts of a channel and of a frame, the bottom line first.
fn counts(channel: f64, frame: f64) -> Vec<f64> {
    let count =
        |line: i32, column: i32| f64::from(100 * line + column) + 1e4 * channel + 1e6 * frame;
    (0..3)
        .flat_map(|line| (0..5).map(move |column| count(line, column)))
        .collect()
}

#[test]
fn every_frame_of_every_channel() {
    for (bytes, frames) in [(FILM, 2), (SINGLE, 1)] {
        assert_eq!(crate::detect(bytes), Format::JpkHdf5);
        let scan = crate::read(bytes).expect("whole");
        assert_eq!(
            (scan.channels.len(), scan.unreadable.len()),
            (3 * frames, 0)
        );
        for (n, channel) in scan.channels.iter().enumerate() {
            let (number, frame) = (n / frames, n % frames);
            let name = ["height", "height", "phase"][number];
            let name = if frame == 0 {
                name.to_owned()
            } else {
                format!("{name} (frame 2)")
            };
            let direction = if number == 1 {
                LineDirection::Retrace
            } else {
                LineDirection::Trace
            };
            assert_eq!(
                (&channel.name, channel.line_direction),
                (&name, Some(direction))
            );
            let (factor, offset, unit) = [(1.5e-11, 2e-7, "m"), (0.01, -180.0, "deg")][number / 2];
            assert_eq!(channel.unit, unit);
            let values = counts(number as f64, frame as f64);
            let values: Vec<f64> = values.iter().map(|count| count * factor + offset).collect();
            assert_eq!(channel.values(), values, "{name}");
        }
    }
}

#[test]
fn the_frame_is_told() {
    let scan = crate::read(SINGLE).expect("whole");
    let [width, height] = scan.size_nm.expect("a size");
    assert!((width - 100.0).abs() + (height - 60.0).abs() < 1e-9);
    assert_eq!((scan.line_rate_hz, scan.rotation_rad), (Some(4.0), 0.5));
    assert_eq!(scan.notes, [UNTESTED]);
    let rate = ("timing-settings.scanRate".to_owned(), "4".to_owned());
    assert!(scan.metadata.contains(&rate));
}

#[test]
fn what_does_not_fit_is_refused() {
    let changed = |from: &[u8], to: &[u8]| {
        let mut bytes = SINGLE.to_vec();
        let place = memchr::memmem::find(&bytes, from).expect("it is there");
        bytes[place..place + to.len()].copy_from_slice(to);
        crate::read(&bytes).expect_err("changed").to_string()
    };
    // A checksum of the library's.
    assert!(changed(b"ilength", b"iLength").contains("damaged"));
    assert!(changed(b"Measurement_000", b"Measurement_0\xff\xff").contains("JPK in HDF5"));
    for cut in [8, 600, 5000] {
        let error = crate::read(&SINGLE[..cut])
            .expect_err("cut off")
            .to_string();
        assert!(error.contains("HDF5"), "{error}");
    }
}
