use super::*;

/// A version 5 wave of single-precision samples counted up in the order of the file.
struct Made {
    endian: Endian,
    size: [u32; 4],
    kind: u16,
    step: [f64; 2],
    note: &'static str,
    line_labels: &'static [&'static str],
    labels: &'static [&'static str],
}

const IMAGE: Made = Made {
    endian: Endian::Little,
    size: [3, 2, 2, 0],
    kind: 2,
    step: [1e-9, 1e-9],
    note: "ScanSize: 2e-09\rFastScanSize: 2e-09\rSlowScanSize: 1e-09\rScanPoints: 3\rScanLines: 2\r\
           ScanRate: 2\rScanAngle: 135\rScanDown: 1\rXOffset: 1e-06\rYOffset: -2e-06\r\
           ScanMode:Closed Loop\rDate:2021-10-11\rTime:3:52:01 PM\rPlanefit 1: Flatten 1\r\
           ScanRate: 2@Line: 1\r",
    line_labels: &[],
    labels: &["", "HeightTrace", "PhaseRetrace"],
};

fn file(made: &Made) -> Vec<u8> {
    let big = made.endian == Endian::Big;
    let mut bytes: Vec<u8> = Vec::new();
    macro_rules! put {
        ($($value:expr),*) => {$(
            bytes.extend(if big { $value.to_be_bytes() } else { $value.to_le_bytes() });
        )*};
    }
    let label_size = |labels: &[&str]| (labels.len() * LABEL) as u32;
    put!(5u16, 0u16, 0u32, 0u32, made.note.len() as u32, 0u32);
    for _ in 0..4 {
        put!(0u32);
    }
    put!(
        0u32,
        label_size(made.line_labels),
        label_size(made.labels),
        0u32
    );
    bytes.resize(64 + 16, 0);
    put!(made.kind);
    bytes.resize(64 + 28, 0);
    bytes.extend(b"wave0");
    bytes.resize(64 + 68, 0);
    for items in made.size {
        put!(items);
    }
    put!(made.step[0], made.step[1], 1f64, 1f64);
    bytes.resize(64 + 148, 0);
    bytes.extend(b"V\0\0\0m\0\0\0m\0\0\0");
    bytes.resize(HEADERS, 0);
    let sizes = made.size.iter().filter(|&&n| n > 0);
    let samples = sizes.fold(1u32, |all, &n| all.saturating_mul(n)).min(1000);
    for n in 0..samples {
        put!(n as f32);
    }
    bytes.extend(made.note.bytes());
    for label in made.line_labels.iter().chain(made.labels) {
        bytes.extend(label.bytes());
        bytes.resize(bytes.len() + LABEL - label.len(), 0);
    }
    summed(bytes, HEADERS, big, 2)
}

/// Sets the word at `place` so that all of the header add up to zero.
fn summed(mut bytes: Vec<u8>, length: usize, big: bool, place: usize) -> Vec<u8> {
    let sum = bytes[..length].chunks_exact(2).fold(0u16, |sum, b| {
        let word = if big {
            u16::from_be_bytes([b[0], b[1]])
        } else {
            u16::from_le_bytes([b[0], b[1]])
        };
        sum.wrapping_add(word)
    });
    let check = 0u16.wrapping_sub(sum);
    let check = if big {
        check.to_be_bytes()
    } else {
        check.to_le_bytes()
    };
    bytes[place..place + 2].copy_from_slice(&check);
    bytes
}

#[test]
fn both_byte_orders_hold_the_same_image() {
    for endian in [Endian::Little, Endian::Big] {
        let scan = crate::read(&file(&Made { endian, ..IMAGE })).expect("an image");
        let found: Vec<_> = scan
            .channels
            .iter()
            .map(|c| (c.name.as_str(), c.unit.as_str(), c.line_direction))
            .collect();
        assert_eq!(
            found,
            [
                ("HeightTrace", "m", Some(LineDirection::Trace)),
                ("PhaseRetrace", "deg", Some(LineDirection::Retrace)),
            ]
        );
        // y = 0 is the bottom line, retrace is in order of position: as stored.
        assert_eq!(scan.channels[0].values(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(scan.channels[1].values(), [6.0, 7.0, 8.0, 9.0, 10.0, 11.0]);
        assert_eq!(scan.channels[1].plane_fit.as_deref(), Some("Flatten 1"));
    }
}

#[test]
fn the_note_tells_the_frame() {
    let scan = crate::read(&file(&IMAGE)).expect("an image");
    let size = scan.size_nm.expect("a size");
    assert!((size[0] - 2.0).abs() + (size[1] - 1.0).abs() < 1e-12);
    assert_eq!(scan.line_rate_hz, Some(2.0));
    assert_eq!(scan.rounding, Some(0.25));
    assert_eq!(scan.frame_direction, Some(FrameDirection::Down));
    assert!((scan.rotation_rad + 135f64.to_radians()).abs() < 1e-12);
    assert!((scan.offset_nm[0] - 1000.0).abs() + (scan.offset_nm[1] + 2000.0).abs() < 1e-9);
    assert_eq!(scan.closed_loop, Some(true));
    assert_eq!(scan.acquired, clock::date([2021, 10, 11], [15, 52, 1]));
}

#[test]
fn a_rate_changed_during_the_scan_is_no_rate() {
    let note = "ScanRate: 2\rScanRate: 3@Line: 1\r";
    let scan = crate::read(&file(&Made { note, ..IMAGE })).expect("an image");
    assert_eq!((scan.line_rate_hz, scan.rounding), (None, None));
}

/// Without a note the steps tell; negative ones turn the image.
#[test]
fn plain_waves() {
    let plain = Made {
        note: "",
        labels: &["Generated 1"],
        size: [3, 2, 1, 0],
        step: [-1e-9, -2e-9],
        ..IMAGE
    };
    let scan = crate::read(&file(&plain)).expect("an image");
    let channel = &scan.channels[0];
    assert_eq!(
        (channel.name.as_str(), channel.internal_name.as_str()),
        ("", "wave0")
    );
    assert_eq!(channel.values(), [5.0, 4.0, 3.0, 2.0, 1.0, 0.0]);
    assert_eq!(channel.unit, "V");
    assert!((channel.width_nm.expect("width") - 2.0).abs() < 1e-12);
    assert!((channel.height_nm.expect("height") - 2.0).abs() < 1e-12);
    assert_eq!((scan.frame_direction, scan.line_rate_hz), (None, None));
}

#[test]
fn what_is_no_image_is_named() {
    let error = |made: Made| crate::read(&file(&made)).expect_err("no image").to_string();
    assert!(
        error(Made {
            size: [5, 0, 0, 0],
            ..IMAGE
        })
        .contains("one-dimensional wave of 5")
    );
    assert!(
        error(Made {
            size: [3, 2, 2, 2],
            ..IMAGE
        })
        .contains("four dimensions")
    );
    let curves = Made {
        line_labels: &["", "Raw", "Defl"],
        ..IMAGE
    };
    assert!(error(curves).contains("Raw, Defl"));
    assert!(error(Made { kind: 3, ..IMAGE }).contains("complex"));
    let giant = error(Made {
        size: [u32::MAX; 4],
        ..IMAGE
    });
    assert!(giant.contains("dimensions"), "{giant}");
    let long = error(Made {
        size: [u32::MAX, u32::MAX, 2, 0],
        ..IMAGE
    });
    assert!(
        long.contains("promises") || long.contains("lines"),
        "{long}"
    );
    let mut elder = vec![0u8; 142];
    elder[1] = 2;
    elder[17] = 2;
    elder[61] = 5;
    let elder = summed(elder, 142, true, 14);
    let found = crate::read(&elder).expect_err("one dimension").to_string();
    assert!(
        found.contains("5 points") && found.contains("version 2"),
        "{found}"
    );
}

#[test]
fn damage_is_seen() {
    let whole = file(&IMAGE);
    let mut flipped = whole.clone();
    flipped[140] ^= 1;
    let error = crate::read(&flipped).expect_err("flipped").to_string();
    assert!(error.contains("instead of 0"), "{error}");
    let Err(ReadError::Incomplete { readable, .. }) = crate::read(&whole[..HEADERS + 40]) else {
        panic!("the second layer is cut off");
    };
    assert_eq!(readable.channels.len(), 1);
    assert!(crate::read(&whole[..100]).is_err());
}
