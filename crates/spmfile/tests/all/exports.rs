//! What is written for Gwyddion is read back: values, units, sizes, and how the frame was scanned.

use spmfile::{
    Channel, DateTime, ExportError, FrameDirection, LineDirection, Samples, Scan, Span,
    WritableFormat, gsf, gwy, gxyzf, position_sensors, read, write, write_between,
};

fn channel(name: &str, unit: &str, line: LineDirection, samples: Vec<f64>) -> Channel {
    Channel {
        name: name.to_owned(),
        internal_name: "inner".to_owned(),
        unit: unit.to_owned(),
        line_direction: Some(line),
        scan_line: Some("Main".to_owned()),
        rows: 2,
        columns: 3,
        width_nm: Some(70.0),
        height_nm: Some(35.0),
        span: Span::PixelEdges,
        scale: 1.0,
        offset: 0.0,
        scaling: String::new(),
        plane_fit: Some("Line (realtime)".to_owned()),
        samples: Samples::F64(samples),
    }
}

fn scan() -> Scan {
    let trace = LineDirection::Trace;
    Scan {
        format: "NanoScope 9.70".to_owned(),
        instrument: Some("Icon".to_owned()),
        acquired: Some(DateTime {
            year: 2024,
            month: 2,
            day: 29,
            hour: 23,
            minute: 59,
            second: 7,
        }),
        frame_direction: Some(FrameDirection::Down),
        line_rate_hz: Some(7.81),
        line_times_s: Some([0.06, 1.0 / 15.0]),
        rounding: Some(0.05),
        rotation_rad: std::f64::consts::PI,
        offset_nm: [123.456, -7e3],
        size_nm: Some([70.0, 70.0]),
        closed_loop: Some(true),
        channels: vec![
            channel(
                "TR Phase",
                "°",
                trace,
                vec![1.5, -2.25, f64::NAN, 4.0, 5.0, 0.1],
            ),
            channel(
                "Height = Z",
                "nm",
                LineDirection::Retrace,
                vec![0.1, 0.2, 0.3, 1e3, 1e-3, 0.0],
            ),
            // The frame is turned by 180°: positions fall from the first to the last pixel.
            channel(
                "Xsensor",
                "nm",
                trace,
                vec![60.0, 30.0, 0.3, 60.1, 30.2, 0.2],
            ),
            channel(
                "Ysensor",
                "nm",
                trace,
                vec![35.0, 35.1, 35.2, 0.0, 0.1, 0.2],
            ),
        ],
        unreadable: Vec::new(),
        notes: Vec::new(),
        metadata: vec![("Bias".to_owned(), "10 µV".to_owned())],
    }
}

fn log() -> Vec<String> {
    vec!["drift taken out".to_owned(), "two\nlines".to_owned()]
}

/// Everything but the channels and the format's own name.
fn same_frame(found: &Scan, expected: &Scan) {
    assert!(
        found.format.ends_with("from NanoScope 9.70"),
        "{}",
        found.format
    );
    assert_eq!(found.instrument, expected.instrument);
    assert_eq!(found.acquired, expected.acquired);
    assert_eq!(found.frame_direction, expected.frame_direction);
    assert_eq!(found.line_rate_hz, expected.line_rate_hz);
    assert_eq!(found.line_times_s, expected.line_times_s);
    assert_eq!(found.rounding, expected.rounding);
    assert_eq!(found.rotation_rad, expected.rotation_rad);
    assert_eq!(found.offset_nm, expected.offset_nm);
    assert_eq!(found.size_nm, expected.size_nm);
    assert_eq!(found.closed_loop, expected.closed_loop);
}

/// `relative` is what the number type of the format and a change of unit may lose.
fn same_channel(found: &Channel, expected: &Channel, relative: f64) {
    assert_eq!(found.name, expected.name);
    assert_eq!(found.line_direction, expected.line_direction);
    let (unit, factor) = match expected.unit.as_str() {
        "nm" if found.unit == "m" => ("m", 1e-9),
        "°" => ("deg", 1.0),
        other => (other, 1.0),
    };
    assert_eq!(found.unit, unit);
    assert_eq!(
        (found.rows, found.columns),
        (expected.rows, expected.columns)
    );
    for (a, b) in found.values().iter().zip(expected.values()) {
        let right = (a - b * factor).abs() <= relative * (b * factor).abs();
        assert!(
            right || (a.is_nan() && b.is_nan()),
            "{}: {a} for {b}",
            expected.name
        );
    }
}

#[test]
fn gwyddion_containers_come_back() {
    let scan = scan();
    let read = read(&gwy::write(&scan, &log()).expect("written")).expect("readable");
    same_frame(&read, &scan);
    assert_eq!(read.channels.len(), scan.channels.len());
    for (found, expected) in read.channels.iter().zip(&scan.channels) {
        same_channel(found, expected, 4.0 * f64::EPSILON);
        assert_eq!(found.internal_name, expected.internal_name);
        assert_eq!(found.scan_line, expected.scan_line);
        assert_eq!(found.plane_fit, expected.plane_fit);
        for (a, b) in [(found.width_nm, 70.0), (found.height_nm, 35.0)] {
            assert!((a.expect("a size") - b).abs() < 1e-12);
        }
    }
    let has = |key: &str, value: &str| read.metadata.contains(&(key.to_owned(), value.to_owned()));
    assert!(
        has("Bias", "10 µV") && has("log 1", "drift taken out"),
        "{:?}",
        read.metadata
    );
    // Once more: nothing piles up.
    let again = spmfile::read(&gwy::write(&read, &[]).expect("written")).expect("readable");
    assert_eq!(again.format, read.format);
    assert_eq!(
        again.channels[0].values()[3..],
        read.channels[0].values()[3..]
    );
    assert_eq!(again.metadata, read.metadata);
}

#[test]
fn simple_fields_come_back() {
    let scan = scan();
    for expected in &scan.channels {
        let read = read(&gsf::write(&scan, expected, &log()).expect("written")).expect("readable");
        same_frame(&read, &scan);
        same_channel(&read.channels[0], expected, f64::from(f32::EPSILON));
        assert_eq!(read.channels[0].internal_name, "inner");
        assert_eq!(read.channels[0].plane_fit, expected.plane_fit);
        assert!(
            read.metadata
                .contains(&("log 2".to_owned(), "two lines".to_owned()))
        );
    }
}

#[test]
fn point_clouds_come_back_as_sensors() {
    let scan = scan();
    let [phase, _, x, y] = &scan.channels[..] else {
        panic!("four channels");
    };
    let bytes = gxyzf::write(&scan, [x, y], &[phase], &log()).expect("written");
    let read = read(&bytes).expect("readable");
    same_frame(&read, &scan);
    let sensors = position_sensors(&read, LineDirection::Trace).expect("sensors");
    for (found, expected) in [(sensors.x, x), (sensors.y, y)] {
        for (a, b) in found.values().iter().zip(expected.values()) {
            assert!((a - b).abs() <= 4.0 * f64::EPSILON * b.abs(), "{a} for {b}");
        }
    }
    same_channel(&read.channels[2], phase, 0.0);
}

#[test]
fn no_size_is_written_as_none() {
    let mut scan = scan();
    scan.size_nm = None;
    for channel in &mut scan.channels {
        (channel.width_nm, channel.height_nm) = (None, None);
    }
    let files = [
        gwy::write(&scan, &[]).expect("written"),
        gsf::write(&scan, &scan.channels[0], &[]).expect("written"),
    ];
    for bytes in files {
        let read = read(&bytes).expect("readable");
        assert_eq!((read.size_nm, read.channels[0].width_nm), (None, None));
    }
}

#[test]
fn what_cannot_be_written_is_said() {
    let mut scan = scan();
    assert_eq!(
        gwy::write(&Scan::default(), &[]),
        Err(ExportError::NoChannel)
    );
    let phase = &scan.channels[0];
    assert!(matches!(
        gxyzf::write(&scan, [phase, phase], &[phase], &[]),
        Err(ExportError::NotALength { .. })
    ));
    let x = &scan.channels[2];
    assert_eq!(
        gxyzf::write(&scan, [x, x], &[], &[]),
        Err(ExportError::NoChannel)
    );
    let mut narrow = x.clone();
    (narrow.rows, narrow.columns) = (3, 2);
    assert!(matches!(
        gxyzf::write(&scan, [x, &narrow], &[phase], &[]),
        Err(ExportError::Unlike { .. })
    ));
    scan.channels[1].rows = 5;
    assert!(matches!(
        gwy::write(&scan, &[]),
        Err(ExportError::Shape { found: 6, .. })
    ));
    assert!(matches!(
        gsf::write(&scan, &scan.channels[1], &[]),
        Err(ExportError::Shape { found: 6, .. })
    ));
}

/// Whoever writes large images can stop it: between the lines of each format, or between its chunks, somebody is asked.
#[test]
fn writing_asks_between_lines() {
    let scan = scan();
    for format in WritableFormat::ALL {
        let asked = std::cell::Cell::new(0);
        let between = || asked.set(asked.get() + 1);
        let files = write_between(&scan, format, "scan", &log(), &between).expect("written");
        assert_eq!(
            files,
            write(&scan, format, "scan", &log()).expect("written")
        );
        // Points come line by line for all channels of a line direction; a small channel is one chunk.
        let least = match format {
            WritableFormat::Gxyzf => scan.channels[0].rows,
            WritableFormat::Zarr => scan.channels.len(),
            _ => scan.channels.iter().map(|c| c.rows).sum(),
        };
        assert!(asked.get() >= least, "{format:?}: {}", asked.get());
    }
}
