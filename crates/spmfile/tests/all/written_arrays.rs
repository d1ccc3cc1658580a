//! What is written as arrays is read back; blocks cut out of a scan keep place, value and time.

use spmfile::arrays::{self, ArrayOptions};
use spmfile::{
    Block, Channel, CropError, DateTime, FrameDirection, LineDirection, Samples, Scan, Span,
    WritableFormat, crop, read, write,
};

fn channel(name: &str, unit: &str, line: LineDirection, first: f64) -> Channel {
    let mut samples: Vec<f64> = (0..12).map(|n| first + 0.1 * f64::from(n)).collect();
    samples[1] = f64::NAN;
    Channel {
        name: name.to_owned(),
        internal_name: "inner".to_owned(),
        unit: unit.to_owned(),
        line_direction: Some(line),
        scan_line: Some("Main".to_owned()),
        rows: 3,
        columns: 4,
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
    Scan {
        format: "Nanonis 2".to_owned(),
        acquired: Some(DateTime {
            year: 2024,
            month: 3,
            day: 1,
            hour: 0,
            minute: 0,
            second: 1,
        }),
        frame_direction: Some(FrameDirection::Up),
        line_rate_hz: Some(0.5),
        line_times_s: Some([0.9, 0.6]),
        rotation_rad: 1.0,
        offset_nm: [5.0, -3.0],
        size_nm: Some([70.0, 35.0]),
        channels: vec![
            channel("Phase = φ", "°", LineDirection::Trace, 1.0),
            channel("Phase = φ", "°", LineDirection::Retrace, 1e-9),
            channel("Height", "nm", LineDirection::Trace, -5.0),
        ],
        metadata: vec![("Bias".to_owned(), "10 µV \\ 2".to_owned())],
        ..Scan::default()
    }
}

/// `digits` is what the numbers of the format may lose.
fn same(found: &Channel, expected: &Channel, relative: f64) {
    let head = |c: &Channel| {
        (
            c.name.clone(),
            c.internal_name.clone(),
            c.unit.clone(),
            c.line_direction,
            c.scan_line.clone(),
            (c.rows, c.columns, c.width_nm, c.height_nm),
            (c.span, c.plane_fit.clone()),
        )
    };
    assert_eq!(head(found), head(expected));
    for (a, b) in found.values().iter().zip(expected.values()) {
        let right = (a - b).abs() <= relative * b.abs();
        assert!(right || (a.is_nan() && b.is_nan()), "{a} for {b}");
    }
}

#[test]
fn arrays_come_back() {
    let scan = scan();
    let log = ["drift removed".to_owned()];
    for (format, relative) in [
        (WritableFormat::Npz, 0.0),
        (WritableFormat::Tiff, f64::from(f32::EPSILON)),
        (WritableFormat::Csv, 0.0),
    ] {
        let files = write(&scan, format, "a", &log).expect("written");
        let mut channels = Vec::new();
        for (name, bytes) in &files {
            assert!(name.starts_with('a'), "{name}");
            let found = read(bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert!(found.format.ends_with("from Nanonis 2"), "{}", found.format);
            assert_eq!(found.acquired, scan.acquired);
            assert_eq!(found.frame_direction, scan.frame_direction);
            assert_eq!(found.line_times_s, scan.line_times_s);
            assert_eq!(found.line_rate_hz, scan.line_rate_hz);
            assert_eq!(found.rotation_rad, scan.rotation_rad);
            assert_eq!(found.offset_nm, scan.offset_nm);
            assert_eq!(found.size_nm, scan.size_nm);
            assert_eq!(found.metadata[0], scan.metadata[0]);
            assert_eq!(found.metadata[1].1, log[0]);
            assert_eq!(found.metadata.len(), 2, "{:?}", found.metadata);
            assert!(found.unreadable.is_empty(), "{:?}", found.unreadable);
            channels.extend(found.channels);
        }
        assert_eq!(channels.len(), 3, "{format:?}");
        for (found, expected) in channels.iter().zip(&scan.channels) {
            same(found, expected, relative);
        }
    }
}

/// Whoever crops a picture or an array keeps its description: sizes and times in it are wrong then.
#[test]
fn descriptions_of_other_shapes_are_not_believed() {
    let mut scan = scan();
    scan.channels.truncate(1);
    let text = arrays::csv(&scan, &scan.channels[0], &[]).expect("written");
    let text = String::from_utf8(text).expect("text");
    let cut: String = text
        .lines()
        .take(text.lines().count() - 1)
        .collect::<Vec<_>>()
        .join("\n");
    let found = read(cut.as_bytes()).expect("a matrix");
    assert_eq!(found.channels[0].rows, 2);
    assert_eq!((found.size_nm, found.line_rate_hz), (None, None));
}

/// What the user says comes before what the file carries.
#[test]
fn options_come_first() {
    let bytes = arrays::npz(&scan(), &[]).expect("written");
    let options = ArrayOptions {
        size_nm: Some([10.0, 5.0]),
        rotation_rad: Some(0.0),
        line_rate_hz: Some(3.0),
        unit: Some("rad".to_owned()),
        ..ArrayOptions::default()
    };
    let found = arrays::read(&bytes, &options, &|info| info.name == "Height").expect("a scan");
    assert_eq!(found.channels.len(), 1);
    let height = &found.channels[0];
    assert_eq!((height.width_nm, height.unit.as_str()), (Some(10.0), "rad"));
    assert_eq!((found.rotation_rad, found.line_rate_hz), (0.0, Some(3.0)));
    assert_eq!(found.frame_direction, Some(FrameDirection::Up));
}

/// Pitches survive the formats that count from edge to edge.
#[test]
fn gwyddion_keeps_the_pitch() {
    let mut scan = scan();
    for channel in &mut scan.channels {
        channel.span = Span::PixelCentres;
    }
    let expected = scan.channels[0].pitch_nm().expect("a pitch");
    assert_eq!(expected[0], 70.0 / 3.0);
    for format in WritableFormat::ALL {
        if matches!(format, WritableFormat::Zarr | WritableFormat::Gxyzf) {
            continue;
        }
        let files = write(&scan, format, "a", &[]).expect("written");
        let found = read(&files[0].1).expect("read").channels[0].pitch_nm();
        for (a, b) in found.expect("a pitch").iter().zip(expected) {
            assert!((a - b).abs() < 1e-12 * b, "{format:?}: {a} for {b}");
        }
    }
}

#[test]
fn points_need_sensors() {
    let error = write(&scan(), WritableFormat::Gxyzf, "a", &[]).expect_err("no sensors");
    assert!(error.to_string().contains("no X and Y sensor"), "{error}");
}

/// The position of a pixel and the time at which it was recorded, from the frame's own numbers.
fn place_and_time(scan: &Scan, column: f64, row: f64) -> ([f64; 2], f64) {
    let channel = &scan.channels[0];
    let [fast, slow] = channel.pitch_nm().expect("a pitch");
    let x = fast * (column - 0.5 * (channel.columns as f64 - 1.0));
    let y = slow * (row - 0.5 * (channel.rows as f64 - 1.0));
    let (s, c) = scan.rotation_rad.sin_cos();
    let place = [
        scan.offset_nm[0] + c * x - s * y,
        scan.offset_nm[1] + s * x + c * y,
    ];
    let period = 1.0 / scan.line_rate_hz.expect("a rate");
    let end = scan.acquired.expect("a date");
    let end = f64::from(end.second) + 60.0 * f64::from(end.minute) + 3600.0 * f64::from(end.hour);
    // Midnight lies between the end of the frame and that of the block.
    let end = if end > 43_200.0 { end - 86_400.0 } else { end };
    let lines = match scan.frame_direction {
        Some(FrameDirection::Up) => channel.rows as f64 - row,
        _ => row + 1.0,
    };
    (place, end - lines * period)
}

#[test]
fn blocks_keep_place_value_and_time() {
    for direction in [FrameDirection::Up, FrameDirection::Down] {
        for times in [Some([0.9, 0.6]), None] {
            let mut whole = scan();
            whole.frame_direction = Some(direction);
            whole.line_times_s = times;
            let per_sample = |s: &Scan, columns: usize| {
                let half = 0.5 / s.line_rate_hz.expect("a rate");
                s.line_times_s.map_or(half, |t| t[0]) / (columns - 1) as f64
            };
            let before = per_sample(&whole, 4);
            let mut part = whole.clone();
            let block = Block {
                column: 1,
                row: 1,
                columns: 3,
                rows: 1,
            };
            crop(&mut part, block).expect("within");
            assert_eq!(
                part.channels[0].values(),
                whole.channels[0].values()[5..8],
                "{direction:?}"
            );
            let (place, time) = place_and_time(&part, 0.0, 0.0);
            let (expected, when) = place_and_time(&whole, 1.0, 1.0);
            assert!((place[0] - expected[0]).abs() < 1e-9 && (place[1] - expected[1]).abs() < 1e-9);
            assert!((time - when).abs() < 1e-9, "{time} for {when}");
            assert!((per_sample(&part, 3) - before).abs() < 1e-12);
            assert_eq!(part.line_rate_hz, whole.line_rate_hz);
        }
    }
}

#[test]
fn blocks_beyond_the_frame_are_refused() {
    let block = |column, row, columns, rows| Block {
        column,
        row,
        columns,
        rows,
    };
    for wrong in [
        block(0, 0, 5, 1),
        block(2, 0, 3, 1),
        block(0, 0, 0, 1),
        block(0, 3, 1, 1),
        block(usize::MAX, 0, 2, 1),
    ] {
        let error = crop(&mut scan(), wrong);
        assert!(matches!(error, Err(CropError::Outside { .. })), "{error:?}");
    }
    let mut odd = scan();
    odd.channels[2].rows = 2;
    let error = crop(&mut odd, block(0, 0, 1, 1));
    assert!(matches!(error, Err(CropError::Unlike { .. })), "{error:?}");
}

/// Every file of a group by the specification: shapes, names of dimensions, whole chunks.
#[test]
fn zarr_groups_are_whole() {
    let mut scan = scan();
    scan.channels[2].rows = 1;
    scan.channels[2].samples = Samples::F64(vec![1.0, 2.0, 3.0, 4.0]);
    let files = write(&scan, WritableFormat::Zarr, "a", &[]).expect("written");
    let find = |name: &str| {
        let found = files.iter().find(|(n, _)| n == name);
        &found.unwrap_or_else(|| panic!("no {name}")).1
    };
    let about = |name: &str| -> serde_json::Value {
        serde_json::from_slice(find(&format!("a.zarr/{name}/zarr.json"))).expect("JSON")
    };
    assert_eq!(about("Phase_φ_trace")["dimension_names"][0], "y");
    assert_eq!(about("Phase_φ_retrace")["attributes"]["units"], "°");
    assert_eq!(about("Height")["dimension_names"][1], "x_2");
    assert_eq!(about("y")["shape"][0], 3);
    let height: Vec<f64> = find("a.zarr/Height/c/0/0")
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")))
        .collect();
    assert_eq!(height, [1.0, 2.0, 3.0, 4.0]);
    let x: Vec<f64> = find("a.zarr/x/c/0")
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")))
        .collect();
    // 70 nm from edge to edge about 5 nm, four pixels.
    assert_eq!(x, [-21.25, -3.75, 13.75, 31.25]);
}
