use super::*;

/// Two lines of three pixels; `lines` overrides lines of the header.
fn file(lines: &[(usize, &str)], body: &str) -> Vec<u8> {
    let mut header = vec![String::new(); LINES];
    header[0] = "ISO/TC 201 SPM data transfer format".to_owned();
    let usual = [
        (8, "MAP_SC"),
        (9, "2024"),
        (10, "2"),
        (11, "29"),
        (12, "10"),
        (13, "20"),
        (14, "30"),
        (17, "REGULAR MAPPING"),
        (18, "open-loop scanner"),
        (20, "X"),
        (21, "left to right"),
        (22, "Y"),
        (23, "bottom to top"),
        (24, "3"),
        (25, "2"),
        (26, "nm"),
        (27, "nm"),
        (28, "60"),
        (29, "40"),
        (30, "um"),
        (31, "um"),
        (32, "1"),
        (33, "-2"),
        (34, "33"),
        (37, "Hz"),
        (38, "1.5"),
        (69, "Phase"),
        (70, "d"),
    ];
    for &(number, words) in FIXED.iter().chain(&usual).chain(lines) {
        words.clone_into(&mut header[number - 1]);
    }
    format!("{}\n{body}", header.join("\n")).into_bytes()
}

const BODY: &str = "0\n1\n2\n3\n4e0\nNaN\nend of experiment\n";

#[test]
fn pixels_follow_the_scan() {
    let values = |lines: &[(usize, &str)]| {
        let scan = crate::read(&file(lines, BODY)).expect("an image");
        scan.channels[0]
            .values()
            .iter()
            .map(|v| if v.is_nan() { 5.0 } else { *v })
            .collect::<Vec<_>>()
    };
    assert_eq!(values(&[]), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(
        values(&[(23, "top to bottom")]),
        [3.0, 4.0, 5.0, 0.0, 1.0, 2.0]
    );
    assert_eq!(
        values(&[(21, "right to left")]),
        [2.0, 1.0, 0.0, 5.0, 4.0, 3.0]
    );
}

#[test]
fn the_frame_is_told_unless_bogus() {
    let scan = crate::read(&file(&[], BODY)).expect("an image");
    assert_eq!(scan.size_nm, Some([60.0, 40.0]));
    assert_eq!(scan.offset_nm, [1000.0, -2000.0]);
    assert_eq!(scan.rotation_rad, 33f64.to_radians());
    assert_eq!(scan.line_rate_hz, Some(1.5));
    assert_eq!(scan.frame_direction, Some(FrameDirection::Up));
    assert_eq!(scan.closed_loop, Some(false));
    assert_eq!(scan.acquired, clock::date([2024, 2, 29], [10, 20, 30]));
    assert_eq!(scan.channels[0].line_direction, Some(LineDirection::Trace));
    let bogus = [(7, "Bogus acquisition parameters."), (9, "-1")];
    let scan = crate::read(&file(&bogus, BODY)).expect("an image");
    assert_eq!((scan.line_rate_hz, scan.frame_direction), (None, None));
    assert_eq!((scan.closed_loop, scan.acquired), (None, None));
    assert_eq!(scan.channels[0].line_direction, None);
}

#[test]
fn several_channels_and_choice() {
    let lines = [
        (8, "MAP_MC"),
        (94, "2"),
        (95, "Z"),
        (96, "nm"),
        (98, "I (Backward)"),
        (99, "pA"),
    ];
    let body = "0 10\n1 11\n2 12\n3 13\n4 14\n5 15\nend of experiment\n";
    let scan = crate::read(&file(&lines, body)).expect("two images");
    assert_eq!(
        scan.channels[1].values(),
        [10.0, 11.0, 12.0, 13.0, 14.0, 15.0]
    );
    assert_eq!(
        (
            scan.channels[0].unit.as_str(),
            scan.channels[1].unit.as_str()
        ),
        ("nm", "pA")
    );
    assert_eq!(
        scan.channels[1].line_direction,
        Some(LineDirection::Retrace)
    );
    let only = crate::read_selected(&file(&lines, body), &|info| info.name.starts_with('I'));
    let only = only.expect("one image");
    assert_eq!(only.channels.len(), 1);
    assert_eq!(only.channels[0].values()[0], 10.0);
}

#[test]
fn damage_is_named() {
    let error = |lines: &[(usize, &str)], body: &str| {
        crate::read(&file(lines, body))
            .expect_err("damaged")
            .to_string()
    };
    let Err(ReadError::Incomplete { readable, reason }) = crate::read(&file(&[], "0\n1\n2\n3\n"))
    else {
        panic!("two pixels are missing");
    };
    assert!(reason.contains("4 of 6"), "{reason}");
    assert!(readable.channels[0].values()[4].is_nan());
    assert!(error(&[], "0\n1\nx\n3\n4\n5\n").contains("pixel 2"));
    assert!(error(&[], "0\n1\n2\n3\n4\n5\n6\n").contains("\"6\""));
    assert!(error(&[(24, "99999999999")], BODY).contains("99999999999"));
    assert!(error(&[(128, "")], BODY).contains("line 128"));
    assert!(error(&[(8, "SPEC_SC")], BODY).contains("SPEC_SC"));
    assert!(error(&[(23, "inwards")], BODY).contains("inwards"));
    assert!(crate::read(b"ISO/TC 201 SPM data transfer format\n").is_err());
}
