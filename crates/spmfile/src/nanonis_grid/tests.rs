use super::*;
use crate::{Channel, File, FrameDirection, OpenOptions, Scan, WritableFormat};

const COLUMNS: usize = 5;
const ROWS: usize = 3;
const POINTS: usize = 5;
const WIDTH_NM: f64 = 50.0;
const HEIGHT_NM: f64 = 30.0;
const HEADER: &str = "Grid dim=\"5 x 3\"\r\nGrid settings=1.0E-7;-2.0E-8;5.0E-8;3.0E-8;3.0E+1\r\n\
    Filetype=Linear\r\nSweep Signal=\"Bias (V)\"\r\nFixed parameters=\"Sweep Start;Sweep End\"\r\n\
    Experiment parameters=\"X (m);Y (m);Z (m);Settling time (s)\"\r\n# Parameters (4 byte)=6\r\n\
    Experiment size (bytes)=40\r\nPoints=5\r\nChannels=\"Current (A);LI Demod 1 X [AVG] (V)\"\r\n\
    Experiment=\"Grid Spectroscopy\"\r\nStart time=\"24.10.2021 20:44:06\"\r\nEnd time=\"25.10.2021 13:53:46\"\r\n\
    Comment=\"two\r\nlines = one\"\r\nUser=\r\nBias>Bias (V)=100E-3\r\n:HEADER_END:\r\n";

/// How points lie: rotation of a line, counter-clockwise; side of the next line; steps in the size less than points.
struct Laid {
    degrees: f64,
    up: f64,
    less: f64,
}

const AS_TAKEN: Laid = Laid {
    degrees: -30.0,
    up: 1.0,
    less: 0.0,
};

/// Where a number lies, as a number: channel, column, line in the order of the file, point of the sweep.
fn named(channel: usize, column: usize, line: usize, point: usize) -> f32 {
    (1000 * channel + 100 * column + 10 * line + point) as f32
}

fn points(laid: &Laid) -> Vec<u8> {
    let (sin, cos) = laid.degrees.to_radians().sin_cos();
    let mut bytes = Vec::new();
    for line in 0..ROWS {
        for column in 0..COLUMNS {
            let right = WIDTH_NM / (COLUMNS as f64 - laid.less) * (column as f64 - 2.0);
            let up = laid.up * HEIGHT_NM / (ROWS as f64 - laid.less) * (line as f64 - 1.0);
            let x = 100.0 + right * cos - up * sin;
            let y = -20.0 + right * sin + up * cos;
            let z = named(0, column, line, 0);
            let mut numbers = vec![-0.5, 0.5, (x * 1e-9) as f32, (y * 1e-9) as f32, z, 0.02];
            for channel in 1..3 {
                numbers.extend((0..POINTS).map(|point| named(channel, column, line, point)));
            }
            bytes.extend(numbers.into_iter().flat_map(f32::to_be_bytes));
        }
    }
    bytes
}

fn file(changes: &[(&str, &str)], laid: &Laid) -> Vec<u8> {
    let mut header = HEADER.to_owned();
    for (from, to) in changes {
        assert!(header.contains(from), "{from}");
        header = header.replace(from, to);
    }
    [header.into_bytes(), points(laid)].concat()
}

/// What every grid says is left out of the notes.
fn read(bytes: &[u8]) -> Result<Scan, ReadError> {
    let mut scan = crate::read(bytes)?;
    assert_eq!(scan.notes.remove(0), UNTESTED);
    Ok(scan)
}

fn whole(changes: &[(&str, &str)]) -> Scan {
    read(&file(changes, &AS_TAKEN)).expect("whole")
}

fn named_channel<'s>(scan: &'s Scan, name: &str) -> &'s Channel {
    let found = scan.channels.iter().find(|c| c.name == name);
    found.unwrap_or_else(|| {
        let names: Vec<_> = scan.channels.iter().map(|c| &c.name).collect();
        panic!("{name} in {names:?}")
    })
}

/// The numbers of an image by their places, where the first line of the file is the bottom or the top one.
fn expected(channel: usize, point: usize, top_first: bool) -> Vec<f64> {
    let row = |row: usize| if top_first { ROWS - 1 - row } else { row };
    let rows = (0..ROWS).map(row);
    rows.flat_map(|row| (0..COLUMNS).map(move |c| f64::from(named(channel, c, row, point))))
        .collect()
}

#[test]
fn every_point_of_the_sweep_is_an_image_in_its_place() {
    let scan = whole(&[]);
    assert_eq!(scan.notes, Vec::<String>::new());
    assert_eq!(scan.channels.len(), 1 + 2 * POINTS);
    let topography = &scan.channels[0];
    assert_eq!((&*topography.name, &*topography.unit), ("Z", "m"));
    assert_eq!(topography.values(), expected(0, 0, false));
    for (point, bias) in ["-0.5", "-0.25", "0", "0.25", "0.5"].iter().enumerate() {
        let current = named_channel(&scan, &format!("Current ({bias} V)"));
        assert_eq!(current.values(), expected(1, point, false));
        let slope = named_channel(&scan, &format!("LI Demod 1 X [AVG] ({bias} V)"));
        assert_eq!(slope.values(), expected(2, point, false));
        assert_eq!((&*current.unit, &*slope.unit), ("A", "V"));
        assert_eq!(current.line_direction, Some(LineDirection::Trace));
    }
}

#[test]
fn the_frame_is_told() {
    let scan = whole(&[]);
    assert_eq!(scan.format, WITH_POSITIONS);
    assert!(scan.size_is_defined());
    assert!(
        (scan.rotation_rad + 30f64.to_radians()).abs() < 1e-12,
        "clockwise"
    );
    let close = |found: [f64; 2], expected: [f64; 2]| {
        assert!(
            (found[0] - expected[0]).hypot(found[1] - expected[1]) < 1e-9,
            "{found:?} instead of {expected:?}"
        );
    };
    close(scan.offset_nm, [100.0, -20.0]);
    close(scan.size_nm.expect("a size"), [50.0, 30.0]);
    close(scan.channels[3].pitch_nm().expect("a pitch"), [10.0, 10.0]);
    assert_eq!(scan.frame_direction, Some(FrameDirection::Up));
    assert_eq!(
        scan.acquired,
        crate::clock::date([2021, 10, 25], [13, 53, 46])
    );
    let told = |key: &str, value: &str| {
        let entry = (key.to_owned(), value.to_owned());
        assert!(scan.metadata.contains(&entry), "{:?}", scan.metadata);
    };
    told("Comment", "two\nlines = one");
    told("Bias>Bias (V)", "100E-3");
    told("User", "");
    // A longer key is another one.
    let longer = whole(&[("Points=5", "Points of all=7\r\nPoints=5")]);
    assert_eq!(longer.channels.len(), scan.channels.len());
}

/// Where points were decides what the header leaves open.
#[test]
fn positions_decide() {
    let laid = |laid: &Laid| read(&file(&[], laid)).expect("whole");
    let other_way = laid(&Laid {
        degrees: 30.0,
        ..AS_TAKEN
    });
    assert!((other_way.rotation_rad - 30f64.to_radians()).abs() < 1e-12);
    let down = laid(&Laid {
        up: -1.0,
        ..AS_TAKEN
    });
    assert_eq!(down.frame_direction, Some(FrameDirection::Down));
    assert_eq!(down.channels[1].values(), expected(1, 0, true));
    let centres = laid(&Laid {
        less: 1.0,
        ..AS_TAKEN
    });
    assert_eq!(centres.channels[0].span, Span::PixelCentres);
    let pitch = centres.channels[0].pitch_nm().expect("a pitch");
    assert!((pitch[0] - 12.5).abs() + (pitch[1] - 15.0).abs() < 1e-9);
    for scan in [&other_way, &down, &centres] {
        assert_eq!((scan.notes.len(), &*scan.format), (0, WITH_POSITIONS));
    }
    let askew = laid(&Laid {
        degrees: 80.0,
        less: 2.0,
        ..AS_TAKEN
    });
    assert_eq!((askew.notes.len(), &*askew.format), (2, FORMAT));
    assert!((askew.rotation_rad + 30f64.to_radians()).abs() < 1e-12);
    assert!(
        askew.notes[0].contains("80.00°"),
        "what was found: {:?}",
        askew.notes
    );
    let without = whole(&[("X (m);Y (m)", "A;B")]);
    assert_eq!((without.notes.len(), &*without.format), (0, FORMAT));
    assert!(!without.size_is_defined());
    assert_eq!(without.channels[0].span, Span::PixelEdges);
    assert_eq!(without.channels[0].values(), expected(0, 0, false));
}

#[test]
fn segments_of_a_sweep_share_their_ends() {
    let key = "Segment Start (V), Segment End (V), Settling (s), Integration (s), Steps (xn), Lockin, Init. Settling (s)";
    let swept = |segments: &str| {
        let told = format!("Filetype=MLS\r\n{key}={segments}");
        whole(&[("Filetype=Linear", &told)])
    };
    let scan = swept("-100E-3,0E+0,1E-3,2E-3,3,0E+0,0E+0;0E+0,1E+0,1E-3,2E-3,3,0E+0,0E+0");
    for (point, bias) in ["-0.1", "-0.05", "0", "0.5", "1"].iter().enumerate() {
        let current = named_channel(&scan, &format!("Current ({bias} V)"));
        assert_eq!(current.values(), expected(1, point, false));
    }
    assert!(scan.notes.is_empty());
    // There and back: a value that comes twice has the number of its point.
    let back = swept("0,1,0,0,3,0,0;1,0,0,0,3,0,0");
    assert_eq!(
        named_channel(&back, "Current (0 V)").values(),
        expected(1, 0, false)
    );
    assert_eq!(
        named_channel(&back, "Current (0 V, point 5)").values(),
        expected(1, 4, false)
    );
    let apart = swept("0,1,0,0,2,0,0;2,4,0,0,3,0,0");
    assert_eq!(
        named_channel(&apart, "Current (3 V)").values(),
        expected(1, 3, false)
    );
    // As many steps as points, or nothing is believed of them.
    let wrong = swept("0,1,0,0,3,0,0;1,2,0,0,9,0,0");
    assert_eq!(
        named_channel(&wrong, "Current (point 2)").values(),
        expected(1, 1, false)
    );
    assert_eq!(wrong.notes.len(), 2, "{:?}", wrong.notes);
}

#[test]
fn values_of_sweeps_are_short() {
    let labels = |start: f32, end: f32, unit: &str| -> Vec<String> {
        let mut bytes = file(&[("Bias (V)", unit)], &AS_TAKEN);
        let begin = memmem::find(&bytes, b":HEADER_END:\r\n").expect("an end") + 14;
        for point in 0..COLUMNS * ROWS {
            let at = begin + point * 64;
            bytes[at..at + 4].copy_from_slice(&start.to_be_bytes());
            bytes[at + 4..at + 8].copy_from_slice(&end.to_be_bytes());
        }
        let scan = read(&bytes).expect("whole");
        let names = scan.channels[1..=POINTS].iter().map(|c| c.name.clone());
        names
            .map(|name| name.trim_start_matches("Current ").to_owned())
            .collect()
    };
    let milli = [
        "(0.002 V)",
        "(0.001 V)",
        "(0 V)",
        "(-0.001 V)",
        "(-0.002 V)",
    ];
    assert_eq!(labels(0.002, -0.002, "Bias (V)"), milli);
    assert_eq!(labels(0.1, 0.3, "Bias (V)")[2], "(0.2 V)");
    assert_eq!(labels(0.0, -4e-10, "Z rel (m)")[3], "(-3e-10 m)");
    assert_eq!(labels(1.0, 2.0, "Time")[1], "(1.25)");
    let still = labels(0.1, 0.1, "Bias (V)");
    assert_eq!(still[..2], ["(0.1 V)", "(0.1 V, point 2)"]);
    assert_eq!(labels(f32::NAN, 0.1, "Bias (V)")[1], "(point 2)");
    assert_eq!(name_and_unit("Phase"), ("Phase", ""));
    assert_eq!(name_and_unit("A (B) (mV)"), ("A (B)", "mV"));
}

/// Of a sweep of 2000 points and two channels every fourth is an image.
#[test]
fn long_sweeps_are_thinned() {
    let header = HEADER
        .replace("Points=5", "Points=2000")
        .replace("=40", "=16000");
    let mut bytes = header.into_bytes();
    for point in 0..COLUMNS * ROWS {
        let parameters = [0.0, 1.999, 0.0, 0.0, point as f32, 0.0];
        let sweep = (0..4000).map(|n| n as f32);
        bytes.extend(
            parameters
                .into_iter()
                .chain(sweep)
                .flat_map(f32::to_be_bytes),
        );
    }
    let scan = read(&bytes).expect("whole");
    assert_eq!(scan.channels.len(), 1 + 2 * 500);
    assert_eq!(
        named_channel(&scan, "Current (0.004 V)").values(),
        [4.0; 15]
    );
    let last = named_channel(&scan, "LI Demod 1 X [AVG] (1.996 V)");
    assert_eq!(last.values(), [3996.0; 15]);
    assert!(scan.notes[0].contains("every 4th"), "{:?}", scan.notes);
}

#[test]
fn stopped_grids_keep_what_is_there() {
    let bytes = file(&[], &AS_TAKEN);
    let begin = bytes.len() - COLUMNS * ROWS * 64;
    let missing = |scan: &Scan| -> Vec<usize> {
        let values = scan.channels[2].values();
        let whole = expected(1, 1, false);
        let there = |n: &usize| values[*n] == whole[*n];
        assert!((0..15).all(|n| there(&n) || values[n].is_nan()));
        (0..15).filter(|n| !there(n)).collect()
    };
    let two_lines = read(&bytes[..begin + 10 * 64]).expect("two lines");
    assert_eq!(missing(&two_lines), [10, 11, 12, 13, 14]);
    assert_eq!(two_lines.format, WITH_POSITIONS);
    assert_eq!(
        two_lines.notes,
        ["the grid has 10 of its 15 points; the others are missing"]
    );
    let inside = read(&bytes[..begin + 12 * 64 + 9]).expect("two lines and more");
    assert_eq!(missing(&inside), [12, 13, 14]);
    assert!(inside.notes[0].contains("12 of its 15 points and ends inside"));
    let error = crate::read(&bytes[..begin + 10 * 64 - 1]).expect_err("one line");
    assert!(
        error.to_string().contains("before two of its 3 lines"),
        "{error}"
    );
    // Lines that would take far more memory than the file has are left out.
    let tall = [("5 x 3", "5 x 30000"), (";3.0E-8;", ";3.0E-4;")];
    let tall = read(&file(&tall, &AS_TAKEN)).expect("three lines");
    let first = &tall.channels[1];
    assert_eq!((first.rows, first.values()), (3, expected(1, 0, false)));
    let pitch = first.pitch_nm().expect("a pitch");
    assert!((pitch[0] - 10.0).abs() + (pitch[1] - 10.0).abs() < 1e-9);
    assert!(
        tall.notes[0].contains("15 of its 150000 points"),
        "{:?}",
        tall.notes
    );
}

#[test]
fn what_is_no_image_is_said() {
    let error = |changes: &[(&str, &str)]| {
        let error = crate::read(&file(changes, &AS_TAKEN)).expect_err("no image");
        error.to_string()
    };
    let line = error(&[("5 x 3", "15 x 1")]);
    assert!(line.contains("a line of spectra: no image"), "{line}");
    let spectrum = error(&[("5 x 3", "1 x 1")]);
    assert!(
        spectrum.contains("a single spectrum: no image"),
        "{spectrum}"
    );
    assert!(error(&[("5 x 3", "5 x 0")]).contains("\"5 x 0\""));
    assert!(error(&[("Points=5", "Points=0")]).contains("Points above 0"));
    assert!(error(&[("Channels=", "Kanäle=")]).contains("Channels"));
    let giant = [("5 x 3", "99999999999 x 99999999999")];
    assert!(error(&giant).contains("99999999999"));
    let longer = error(&[("5 x 3", "5 x 2")]);
    assert!(longer.contains("320 bytes more"), "{longer}");
    let cut = crate::read(&HEADER.as_bytes()[..200]).expect_err("cut off");
    assert!(cut.to_string().contains("inside the header"), "{cut}");
    assert!(crate::named_like_scan("grid.3DS"));
}

#[test]
fn what_is_not_told_is_noted() {
    for (from, to, words) in [
        (";3.0E+1", ";3,0E+1", "Grid settings (angle)"),
        (
            "# Parameters (4 byte)=6",
            "# Parameters (4 byte)=six",
            "# Parameters (4 byte)",
        ),
        (
            "Settling time (s)\"",
            "Settling;Integration\"",
            "names of 6 parameters, found 7",
        ),
        ("=40", "=44", "Experiment size of 40 bytes"),
        ("Z (m)", "Q (m)", "no topography"),
        ("Sweep Start", "Begin", "not told"),
        ("25.10.2021 13", "25.10.2021 one", "End time"),
    ] {
        let scan = whole(&[(from, to)]);
        let told = scan.notes.iter().any(|note| note.contains(words));
        assert!(told, "{words}: {:?}", scan.notes);
        let last = scan.channels.last().expect("channels");
        assert_eq!(last.values(), expected(2, 4, false), "{words}");
    }
    let unquoted = whole(&[("\"5 x 3\"", "5 x 3"), ("Points=5", "Points=\"5\"")]);
    assert!(unquoted.notes.is_empty());
}

#[test]
fn images_are_decoded_one_by_one() {
    let bytes = file(&[], &AS_TAKEN);
    let opened = File::open(&bytes).expect("whole");
    let frame = &opened.frames()[0];
    let names = frame.channels().map(|c| c.info.name.clone());
    let place = names
        .collect::<Vec<_>>()
        .iter()
        .position(|n| n == "Current (0.25 V)");
    let place = place.expect("the image");
    assert_eq!(
        frame.read(place).expect("whole").values(),
        expected(1, 3, false)
    );
    assert_eq!(
        frame.rows(place, 1..2).expect("a line"),
        expected(1, 3, false)[5..10]
    );
}

#[cfg(feature = "write")]
#[test]
fn gwyddion_holds_the_same() {
    let scan = whole(&[]);
    let files = crate::write(&scan, WritableFormat::Gwy, "grid", &[]).expect("a container");
    let again = crate::read(&files[0].1).expect("whole");
    assert_eq!(again.channels.len(), scan.channels.len());
    for (read, written) in again.channels.iter().zip(&scan.channels) {
        assert_eq!((&read.name, &read.unit), (&written.name, &written.unit));
        assert_eq!(read.values(), written.values(), "{}", read.name);
        let [[a, b], [c, d]] = [read, written].map(|c| c.pitch_nm().expect("a pitch"));
        assert!((a - c).abs() + (b - d).abs() < 1e-9);
    }
    assert!((again.rotation_rad - scan.rotation_rad).abs() < 1e-9);
}

/// Ten thousand damaged files: no panic, full images, and no more samples than a small multiple of the file.
#[test]
fn damaged_files_are_read_or_refused() {
    let good = file(&[], &AS_TAKEN);
    let header = HEADER.len();
    let mut state = 1u64;
    let mut dice = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let options = OpenOptions {
        damaged: true,
        ..OpenOptions::default()
    };
    let mut found = 0;
    for number in 0..10_000 {
        let mut bytes = good.clone();
        for _ in 0..=dice(4) {
            // Digits and separators of the header are what tells something.
            let at = if number % 2 == 0 {
                dice(header)
            } else {
                dice(420)
            };
            bytes[at] = b"0123456789;\"=x-E\r\n\xff\0"[dice(20)];
        }
        if number % 5 == 0 {
            bytes.truncate(dice(good.len()));
        }
        let scan = match crate::read(&bytes) {
            Ok(scan) => scan,
            Err(ReadError::Incomplete { readable, .. }) => *readable,
            Err(error) => {
                assert!(!error.to_string().is_empty());
                continue;
            }
        };
        found += 1;
        let samples: usize = scan.channels.iter().map(|c| c.samples.len()).sum();
        assert!(4 * samples <= (8 * bytes.len()).max(128 << 10), "{number}");
        for channel in &scan.channels {
            assert_eq!(channel.samples.len(), channel.rows * channel.columns);
            let length = |n: f64| n > 0.0 && n.is_finite();
            assert!(channel.width_nm.is_none_or(length) && channel.height_nm.is_none_or(length));
        }
        assert!(scan.rotation_rad.is_finite());
    }
    assert!(found > 1000, "{found}");
    for length in 0..good.len() {
        let _ = File::open_with(&good[..length], &options).map(|file| {
            let frame = &file.frames()[0];
            (0..frame.channels().len()).for_each(|n| drop(frame.read(n)));
        });
    }
}
