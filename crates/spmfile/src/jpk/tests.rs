use super::*;
use crate::archive::tests::zip;
use crate::cursor::Endian;
use crate::tiff_tags::tests::{Value, file, plain};

/// A thumbnail and one channel of 2 lines with 3 counts, in two slots.
fn image(change: impl Fn(&mut Vec<(u16, Value)>, &mut Vec<(u16, Value)>)) -> Vec<u8> {
    let mut frame = vec![
        (PHOTOMETRIC, Value::Short(3)),
        (CHANNEL, Value::Text("thumbnail")),
        (END_DATE, Value::Text("2020-02-29 10:20:30.5 GMT")),
        (X0, Value::Double(1e-6)),
        (Y0, Value::Double(2e-6)),
        (U_LENGTH, Value::Double(4e-7)),
        (V_LENGTH, Value::Double(2e-7)),
        (THETA, Value::Double(std::f64::consts::FRAC_PI_2)),
        (RATE, Value::Double(2.0)),
        (DUTY_CYCLE, Value::Double(0.8)),
        (MOTION, Value::Text("topDown")),
    ];
    let slot = |n: u16| n * SLOT_STRIDE;
    let mut channel = plain(2, 3, 16);
    channel.extend([
        (PHOTOMETRIC, Value::Short(1)),
        (CHANNEL, Value::Text("height")),
        (FANCY_NAME, Value::Text("Height")),
        (RETRACE, Value::Short(1)),
        (SLOTS, Value::Short(2)),
        (DEFAULT_SLOT, Value::Text("calibrated")),
        (SLOT_NAME, Value::Text("raw")),
        (SLOT_SCALING, Value::Text("NullScaling")),
        (SLOT_NAME + slot(1), Value::Text("calibrated")),
        (SLOT_SCALING + slot(1), Value::Text("LinearScaling")),
        (SLOT_UNIT + slot(1), Value::Text("m")),
        (SLOT_FACTOR + slot(1), Value::Double(0.5)),
        (SLOT_OFFSET + slot(1), Value::Double(10.0)),
    ]);
    change(&mut frame, &mut channel);
    let counts: Vec<u8> = (0..6i16).flat_map(i16::to_be_bytes).collect();
    let strips = counts.chunks(6).map(<[u8]>::to_vec).collect();
    file(Endian::Big, &[(frame, vec![]), (channel, strips)])
}

#[test]
fn the_default_slot_scales() {
    let scan = crate::read(&image(|_, _| {})).expect("whole");
    assert_eq!(scan.channels.len(), 1);
    let channel = &scan.channels[0];
    assert_eq!(
        (channel.name.as_str(), channel.unit.as_str()),
        ("Height", "m")
    );
    assert_eq!(channel.line_direction, Some(LineDirection::Retrace));
    assert_eq!(channel.values(), [10.0, 10.5, 11.0, 11.5, 12.0, 12.5]);
    let raw = crate::read(&image(|_, channel| {
        for (tag, value) in channel {
            if *tag == DEFAULT_SLOT {
                *value = Value::Text("raw");
            }
        }
    }));
    assert_eq!(raw.expect("whole").channels[0].values()[5], 5.0);
}

#[test]
fn the_frame_is_told() {
    let scan = crate::read(&image(|_, _| {})).expect("whole");
    assert_eq!(scan.frame_direction, Some(FrameDirection::Down));
    assert_eq!(scan.line_rate_hz, Some(2.0));
    assert_eq!(scan.line_times_s, Some([0.2, 0.2]));
    assert_eq!(scan.acquired, clock::date([2020, 2, 29], [10, 20, 30]));
    let close = |[x, y]: [f64; 2], [a, b]: [f64; 2]| (x - a).abs() + (y - b).abs() < 1e-9;
    assert!(close(scan.size_nm.expect("a size"), [400.0, 200.0]));
    // Turned by 90°: u runs along y, v along −x.
    assert!(close(scan.offset_nm, [1000.0 - 100.0, 2000.0 + 200.0]));
}

#[test]
fn a_reflected_grid_begins_at_the_top() {
    let reflected = image(|frame, _| frame.push((REFLECT, Value::Short(1))));
    let scan = crate::read(&reflected).expect("whole");
    assert_eq!(
        scan.channels[0].values(),
        [11.5, 12.0, 12.5, 10.0, 10.5, 11.0]
    );
    assert_eq!(scan.frame_direction, None);
}

#[test]
fn what_is_missing_is_said() {
    let unknown = image(|_, channel| {
        channel.retain(|(tag, _)| *tag != SLOT_SCALING + SLOT_STRIDE);
    });
    let error = crate::read(&unknown)
        .expect_err("nothing to read")
        .to_string();
    assert!(error.contains("linear scaling"), "{error}");
    let taller = image(|_, channel| {
        for (tag, value) in channel {
            if *tag == 257 {
                *value = Value::Short(9);
            }
        }
    });
    let error = crate::read(&taller).expect_err("damaged").to_string();
    assert!(
        error.contains("12 bytes") && error.contains("54"),
        "{error}"
    );
}

/// As in images of maps, whose channels a program has computed.
#[test]
fn parameters_name_a_channel() {
    let computed = image(|_, channel| {
        channel.retain(|(tag, _)| ![CHANNEL, FANCY_NAME, RETRACE].contains(tag));
        channel.push((
            PARAMETERS,
            Value::Text(
                "algorithm.object-name.base-object-name.fancy-name : Height (measured)\nretrace : true\n",
            ),
        ));
    });
    let channel = &crate::read(&computed).expect("whole").channels[0];
    assert_eq!(channel.name, "Height (measured)");
    assert_eq!(channel.line_direction, Some(LineDirection::Retrace));
    let plain = image(|_, channel| {
        channel.retain(|(tag, _)| ![CHANNEL, FANCY_NAME, RETRACE].contains(tag));
        let words = "channel.name : capacitiveSensorHeight\nretrace : false\n";
        channel.push((PARAMETERS, Value::Text(words)));
    });
    let channel = &crate::read(&plain).expect("whole").channels[0];
    assert_eq!(channel.name, "capacitiveSensorHeight");
    assert_eq!(channel.line_direction, Some(LineDirection::Trace));
}

/// A map tells no line rate: its pixels are curves.
#[test]
fn a_frame_without_times_has_none() {
    let map = image(|frame, _| frame.retain(|(tag, _)| ![RATE, DUTY_CYCLE].contains(tag)));
    let scan = crate::read(&map).expect("whole");
    assert_eq!((scan.line_rate_hz, scan.line_times_s), (None, None));
}

#[test]
fn maps_hold_their_image_in_an_archive() {
    let header = ("header.properties", &b"#"[..]);
    let map = zip(&[header, ("data-image.jpk-qi-image", &image(|_, _| {}))]);
    let scan = crate::read(&map).expect("whole");
    assert_eq!(scan.channels[0].values()[0], 10.0);
    assert!(crate::read(&map[..map.len() / 2]).is_err());
    assert!(matches!(
        crate::read(&zip(&[header, ("segments/0/data", b"curve")])),
        Err(ReadError::ForceCurve)
    ));
}
