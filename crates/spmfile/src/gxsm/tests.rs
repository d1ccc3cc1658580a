//! The files were written by another program: see `scan.py`.

use super::*;
use crate::Format;

const SCAN: &[u8] = include_bytes!("scan.nc");
const EDGES: &[u8] = include_bytes!("edges.nc");

/// The counts of an image, the bottom line first.
fn counts(image: f64) -> Vec<f64> {
    let count = |line: i32, column: i32| f64::from(100 * line + column) + 1000.0 * image;
    (0..3)
        .rev()
        .flat_map(|line| (0..5).map(move |column| count(line, column)))
        .collect()
}

#[test]
fn heights_of_one_direction() {
    assert_eq!(crate::detect(SCAN), Format::Gxsm);
    let scan = crate::read(SCAN).expect("whole");
    let [channel] = &scan.channels[..] else {
        panic!("{} channels", scan.channels.len());
    };
    let told = (&*channel.name, &*channel.unit, channel.line_direction);
    assert_eq!(told, ("Topo", "nm", Some(LineDirection::Retrace)));
    let values: Vec<f64> = counts(0.0).iter().map(|count| count * 0.25 * 0.1).collect();
    assert_eq!(channel.values(), values);
    // 20 × 30 Å between samples, whatever the size spans.
    assert_eq!(channel.span, Span::PixelCentres);
    let pitch = channel.pitch_nm().expect("a pitch");
    assert!(
        (pitch[0] - 2.0).abs() + (pitch[1] - 3.0).abs() < 1e-9,
        "{pitch:?}"
    );
    assert!((scan.rotation_rad - 30f64.to_radians()).abs() < 1e-12);
    assert!((scan.offset_nm[0] - 10.0).abs() + (scan.offset_nm[1] + 5.0).abs() < 1e-12);
    assert_eq!(scan.notes, [UNTESTED]);
    assert!(
        scan.metadata
            .contains(&("Creator".to_owned(), "gxsm4".to_owned()))
    );
    assert!(
        scan.metadata
            .iter()
            .all(|(_, value)| !value.contains("/home"))
    );
}

#[test]
fn layers_in_volts() {
    let scan = crate::read(EDGES).expect("whole");
    for (n, channel) in scan.channels.iter().enumerate() {
        let name = ["ADC1", "ADC1 (image 2)"][n];
        assert_eq!(
            (&*channel.name, &*channel.unit, channel.line_direction),
            (name, "V", None)
        );
        let values: Vec<f64> = counts(n as f64).iter().map(|count| count * 0.25).collect();
        assert_eq!(channel.values(), values);
        let pitch = channel.pitch_nm().expect("a pitch");
        assert!(
            (pitch[0] - 2.0).abs() + (pitch[1] - 3.0).abs() < 1e-9,
            "{pitch:?}"
        );
    }
    assert_eq!(scan.channels.len(), 2);
}

#[test]
fn lines_that_go_up_are_not_turned() {
    let mut up = SCAN.to_vec();
    let from = [30f32, -0.0, -30.0].map(f32::to_be_bytes).concat();
    let place = memmem::find(&up, &from).expect("dimy");
    up[place..place + 12].copy_from_slice(&[-30f32, 0.0, 30.0].map(f32::to_be_bytes).concat());
    let [down, up] =
        [SCAN, &up].map(|bytes| crate::read(bytes).expect("whole").channels[0].values());
    assert_eq!(down[..5], up[10..]);
}

#[test]
fn what_is_cut_off_is_lost() {
    for cut in [4, 20, 300] {
        let error = crate::read(&SCAN[..cut]).expect_err("cut off").to_string();
        assert!(error.contains("NetCDF"), "{error}");
    }
    let image = memmem::find(EDGES, &[0, 0, 0, 1, 0, 2]).expect("counts");
    let Err(ReadError::Incomplete { readable, .. }) = crate::read(&EDGES[..image + 40]) else {
        panic!("cut off");
    };
    assert_eq!((readable.channels.len(), readable.unreadable.len()), (1, 1));
    let other = crate::read(b"CDF\x01\0\0\0\0\0\0\0\x0a").expect_err("no scan");
    assert!(other.to_string().contains("NetCDF"));
}

/// A damaged file of 300 texts that lie on top of each other does not take 300 times its memory.
#[test]
fn texts_are_no_longer_than_the_file() {
    const TEXT: usize = 4000;
    let mut bytes = b"CDF\x01".to_vec();
    let mut put = |words: &[u32]| bytes.extend(words.iter().flat_map(|word| word.to_be_bytes()));
    let name = u32::from_be_bytes(*b"n\0\0\0");
    // No records; one dimension; no attributes; variables of kind 2 (text).
    put(&[0, 10, 1, 1, name, TEXT as u32, 0, 0, 11, 300]);
    let header = 4 * (1 + 10 + 300 * 9);
    for _ in 0..300 {
        put(&[1, name, 1, 0, 0, 0, 2, TEXT as u32, header as u32]);
    }
    assert_eq!(bytes.len(), header);
    bytes.extend([b'x'; TEXT]);
    let file = NetCdf::of(&bytes).expect("whole");
    assert_eq!(file.variables.len(), 300);
    let texts = metadata(&file);
    let long: usize = texts.iter().map(|(_, text)| text.len()).sum();
    assert!(!texts.is_empty() && long <= bytes.len(), "{long}");
}
