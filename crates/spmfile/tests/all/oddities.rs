//! Headers with oddities that real files show one at a time, in a small file made by hand.

use spmfile::{
    FrameDirection, LineDirection, ReadError, Scan, SensorProblem, position_sensors, read,
    read_selected,
};

const START: usize = 4000;

/// One image section; `data` is its position among blocks of 2 × 3 16-bit samples.
fn image(name: &str, block: usize, more: &str) -> String {
    let offset = START + 12 * block;
    format!(
        "\\*Ciao image list\r\n\\Data offset: {offset}\r\n\\Data length: 12\r\n\\Samps/line: 3\r\n\
         \\Number of lines: 2\r\n\\@2:Image Data: S [{}] \"{name}\"\r\n{more}",
        name.replace(' ', "")
    )
}

/// A file of these sections whose samples count 0, 1, 2 …
fn file(scan_list: &str, images: &[String]) -> Vec<u8> {
    let text = format!(
        "\\*File list\r\n\\Version: 0x08150000\r\n\\*Scanner list\r\n\\@Sens. Zsens: V 2 nm/V\r\n\
         \\@sens. xsensor: V 3 nm/V\r\n\\@Sens. None: V 1.000000 \r\n\\*Ciao scan list\r\n{scan_list}\
         {}\\*File list end\r\n",
        images.concat()
    );
    let mut bytes: Vec<u8> = text
        .chars()
        .map(|c| u8::try_from(u32::from(c)).expect("Latin-1"))
        .collect();
    assert!(bytes.len() < START);
    bytes.resize(START, 0);
    bytes.extend((0_i16..).take(6 * images.len()).flat_map(i16::to_le_bytes));
    bytes
}

const VOLTS: &str = "\\@2:Z scale: V [Sens. None] (1 V/LSB) 65536 V\r\n";

#[test]
fn one_odd_channel_does_not_hide_the_others() {
    let odd = "\\@2:Z scale: V [Sens. Unheard] (1 V/LSB) 65536 V\r\n";
    let bytes = file(
        "",
        &[
            image("A", 0, VOLTS),
            image("B", 1, odd),
            image("C", 2, VOLTS),
            image("D", 3, ""),
        ],
    );
    let scan = read(&bytes).expect("two channels are fine");
    let names: Vec<_> = scan.channels.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["A", "C"]);
    assert_eq!(
        scan.channels[1].values(),
        [12.0, 13.0, 14.0, 15.0, 16.0, 17.0]
    );
    let odd: Vec<_> = scan.unreadable.iter().map(|u| u.name.as_str()).collect();
    assert_eq!(odd, ["B", "D"]);
    assert!(scan.unreadable[0].error.contains("Sens. Unheard"));
}

#[test]
fn nothing_readable_is_an_error() {
    let bytes = file("", &[image("A", 0, "")]);
    assert!(matches!(
        read(&bytes),
        Err(ReadError::NoReadableChannel { .. })
    ));
    assert!(matches!(read(&file("", &[])), Err(ReadError::NoImage)));
}

#[test]
fn only_wanted_channels_are_decoded() {
    let bytes = file("", &[image("A", 0, VOLTS), image("B", 1, VOLTS)]);
    let scan = read_selected(&bytes, &|info| info.internal_name == "B").expect("readable");
    assert_eq!(scan.channels.len(), 1);
    assert_eq!(scan.channels[0].name, "B");
    assert!(
        read_selected(&bytes, &|_| false)
            .expect("readable")
            .channels
            .is_empty()
    );
    // Damage is seen in channels nobody asked for, too.
    let cut = &bytes[..bytes.len() - 1];
    let error = read_selected(cut, &|info| info.name == "A").expect_err("B is cut off");
    assert!(
        matches!(error, ReadError::Incomplete { readable, .. } if readable.channels.len() == 1)
    );
}

#[test]
fn units_sizes_and_spellings() {
    let scan_list = "\\scan rate: 2.5\r\n\\X offset: 0.5 ~m\r\n\\Y OFFSET: -3 nm\r\n\\Capture direction: Down\r\n";
    let height = "\\Scan size: 1.5 1 ~m\r\n\\Line direction: RETRACE\r\n\\Scan line: Interleave\r\n\
                  \\@2:Z scale: V [Sens. Zsens] (1 V/LSB) 65536 V\r\n";
    let phase = "\\@2:Z scale: V (0.005 \u{ba}/LSB) 32768 \u{ba}\r\n";
    let scan = read(&file(
        scan_list,
        &[image("A", 0, height), image("B", 1, phase)],
    ))
    .expect("readable");
    assert_eq!(scan.format, "NanoScope 8.15");
    assert_eq!(scan.line_rate_hz, Some(2.5));
    assert_eq!(scan.offset_nm, [500.0, -3.0]);
    assert_eq!(
        scan.frame_direction,
        Some(FrameDirection::Down),
        "from the scan list"
    );
    let (a, b) = (&scan.channels[0], &scan.channels[1]);
    assert_eq!((a.width_nm, a.height_nm), (Some(1500.0), Some(1000.0)));
    assert_eq!(a.line_direction, Some(LineDirection::Retrace));
    assert_eq!(a.scan_line.as_deref(), Some("Interleave"));
    assert_eq!((a.unit.as_str(), a.scale), ("nm", 2.0));
    assert_eq!((b.unit.as_str(), b.scale), ("°", 0.5));
    assert_eq!((b.width_nm, b.line_direction), (None, None));
}

#[test]
fn images_that_disagree_leave_the_direction_open() {
    let with = |direction: &str| format!("\\Frame direction: {direction}\r\n{VOLTS}");
    let read_two = |a: &str, b: &str| {
        let bytes = file(
            "\\Capture direction: Down\r\n",
            &[image("A", 0, &with(a)), image("B", 1, &with(b))],
        );
        read(&bytes).expect("readable").frame_direction
    };
    assert_eq!(read_two("Up", "Up"), Some(FrameDirection::Up));
    assert_eq!(read_two("Up", "Down"), None);
}

#[test]
fn rows_outside_the_valid_region_are_missing() {
    let valid = format!(
        "\\Valid data start X: 0\r\n\\Valid data len X: 3\r\n\\Valid data start Y: 1\r\n\\Valid data len Y: 1\r\n{VOLTS}"
    );
    let scan = read(&file("", &[image("A", 0, &valid)])).expect("readable");
    let values = scan.channels[0].values();
    assert!(values[..3].iter().all(|v| v.is_nan()));
    assert_eq!(values[3..], [3.0, 4.0, 5.0]);
    // A region that does not fit is not believed.
    let wrong = valid.replace("len Y: 1", "len Y: 7");
    let scan = read(&file("", &[image("A", 0, &wrong)])).expect("readable");
    assert_eq!(scan.channels[0].values()[0], 0.0);
}

/// 16-bit label, 32-bit storage, counts beyond anything 16 bits can hold: no divisor is right.
#[test]
fn an_ambiguous_scale_is_not_guessed() {
    let two_bytes = |count: i32| {
        let more = format!("\\Bytes/pixel: 2\r\n{VOLTS}");
        let text = image("A", 0, &more).replace("Data length: 12", "Data length: 24");
        let mut bytes = file("", &[text]);
        bytes.truncate(START);
        bytes.extend(
            [0, 1, 2, 3, 4, count]
                .into_iter()
                .flat_map(i32::to_le_bytes),
        );
        read(&bytes)
    };
    assert_eq!(
        two_bytes(-32768).expect("16 bits").channels[0].values()[5],
        -32768.0
    );
    let error = two_bytes(-400_000).expect_err("beyond 16 bits").to_string();
    assert!(
        error.contains("ambiguous") && error.contains("400000"),
        "{error}"
    );
}

#[test]
fn sensors_in_volts_are_reported() {
    let line = "\\Line Direction: Trace\r\n";
    let volts = format!("{line}{VOLTS}");
    let nm = format!("{line}\\@2:Z scale: V [Sens. Xsensor] (1 V/LSB) 65536 V\r\n");
    let of = |x: Option<&str>, y: Option<&str>| {
        let mut images = vec![image("TR Phase", 0, &volts)];
        images.extend(x.map(|more| image("X Sensor", 1, more)));
        images.extend(y.map(|more| image("y_sensor", images.len(), more)));
        read(&file("", &images)).expect("readable")
    };
    let trace = |scan: &Scan| position_sensors(scan, LineDirection::Trace).map(|s| s.x.scale);
    assert_eq!(trace(&of(Some(&nm), Some(&nm))), Ok(3.0));
    assert_eq!(trace(&of(None, None)), Err(SensorProblem::Absent));
    assert_eq!(
        trace(&of(None, Some(&nm))),
        Err(SensorProblem::OneAbsent { axis: 'X' })
    );
    let problem = trace(&of(Some(&nm), Some(&volts))).expect_err("Y is in volts");
    assert!(problem.to_string().contains("y_sensor") && problem.to_string().contains("\"V\""));
    let scan = of(Some(&nm), Some(&nm));
    assert_eq!(
        position_sensors(&scan, LineDirection::Retrace).map(|s| s.x.scale),
        Err(SensorProblem::Absent)
    );
}

#[test]
fn what_is_no_scan_is_named() {
    let error = |bytes: &[u8]| read(bytes).expect_err("no scan").to_string();
    assert!(matches!(read(b""), Err(ReadError::Empty)));
    assert!(error(b"\xff\xd8\xff\xe0\x00\x10JFIF").contains("JPEG"));
    assert!(error(b"\x89PNG\r\n\x1a\n....").contains("PNG"));
    assert!(error(b"Lab book, 3 March\nsample 4").contains("Lab book, 3 March"));
    assert!(error(&[1, 2, 3]).contains("01, 02, 03"));
    assert!(matches!(
        read(b"\\*File list\r\n\\Version: 1"),
        Err(ReadError::HeaderCutOff { found: 24 })
    ));
}

/// A lost section line runs two channels together, or leaves one in a foreign section.
#[test]
fn lost_section_lines_are_damage() {
    let images = [
        image("A", 0, VOLTS),
        image("B", 1, VOLTS),
        image("C", 2, VOLTS),
    ];
    let line = "\\*Ciao image list\r\n";
    for lost in [0, 1, 2] {
        let mut some = images.clone();
        some[lost] = some[lost].replace(line, "");
        // The first one's keys fall into the scan list: a region tells them from its own.
        some[0] = some[0].replace("\\@2:Z", "\\Valid data len X: 3\r\n\\@2:Z");
        let ReadError::Incomplete { readable, reason } =
            read(&file("", &some)).expect_err("damaged")
        else {
            panic!("another error");
        };
        assert!(
            reason.contains(["\"A\"", "\"B\"", "\"C\""][lost]),
            "{reason}"
        );
        assert_eq!(readable.unreadable.len(), 1);
    }
}

#[test]
fn narrow_scans_have_their_valid_lines() {
    let narrow = |valid: &str| {
        let lines = format!("{valid}\\Scan size: 90 90 nm\r\n{VOLTS}");
        let wrong = image("A", 0, &lines).replace("Number of lines: 2", "Number of lines: 3");
        read(&file("\\Aspect ratio: 3:2\r\n\\Lines: 2\r\n", &[wrong]))
    };
    let scan = narrow("\\Valid data start Y: 0\r\n\\Valid data len Y: 2\r\n").expect("two lines");
    let channel = &scan.channels[0];
    assert_eq!((channel.rows, channel.columns), (2, 3));
    assert_eq!(channel.values(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(
        (channel.width_nm, channel.height_nm),
        (Some(90.0), Some(60.0))
    );
    for contradiction in [
        "",
        "\\Valid data len Y: 1\r\n",
        "\\Valid data start Y: 1\r\n\\Valid data len Y: 2\r\n",
    ] {
        assert!(narrow(contradiction).is_err(), "{contradiction}");
    }
}

#[test]
fn what_cannot_be_read_is_said_with_its_text() {
    let header =
        "\\Scan size: 90 nm\r\n\\Rotate Ang.: 0,5\r\n\\X Offset: ten nm\r\n\\Scan rate: 1\r\n";
    let scan = read(&file(header, &[image("A", 0, VOLTS)])).expect("an image");
    assert_eq!((scan.rotation_rad, scan.offset_nm), (0.0, [0.0, 0.0]));
    let notes = scan.notes.join("; ");
    assert_eq!(scan.notes.len(), 2, "{notes}");
    assert!(
        notes.contains("Rotate Ang.") && notes.contains("0,5"),
        "{notes}"
    );
    assert!(
        notes.contains("X Offset") && notes.contains("ten nm"),
        "{notes}"
    );
}
