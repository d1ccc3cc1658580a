//! Made-up sessions whose every sample is known.

mod damage;
mod refusals;
pub(crate) mod writer;

use super::read as read_frame;
use crate::error::ReadError;
use crate::scan::{Channel, FrameDirection, LineDirection, Samples, Scan};
use writer::{Log, V, data, dictionary, lengths, scanner, session, transfer};

/// The name of the fuzzer's seeds.
const NAME: &str = "s--1_1.Z_mtrx";
/// Seconds since 1970: 21 September 2020, 12:53:20 UTC.
const STORED: u64 = 1_600_692_800;
const UP: Option<FrameDirection> = Some(FrameDirection::Up);
const DOWN: Option<FrameDirection> = Some(FrameDirection::Down);

/// Reads the frame of a log that names [`NAME`].
fn read(bytes: &[u8], log: &Log, frame: Option<FrameDirection>) -> Result<Scan, ReadError> {
    read_frame(bytes, &[&log.0], NAME, frame, &|_| true)
}

/// Counts that tell the order of recording.
fn counts(n: i32) -> Vec<i32> {
    (0..n).collect()
}

fn of(scan: &Scan, line: LineDirection) -> &Channel {
    let found = scan
        .channels
        .iter()
        .find(|c| c.line_direction == Some(line));
    found.expect("a channel of this direction")
}

fn refused(result: Result<Scan, ReadError>) -> String {
    result.expect_err("refused").to_string()
}

/// Four images of 3 lines of 4 points: 8 samples a line, 24 a frame.
#[test]
fn every_sample_has_its_place() {
    let bytes = data(STORED, 7, 48, &counts(48));
    let log = session().stored(STORED, NAME);
    for (frame, first) in [(None, 0), (UP, 0), (DOWN, 24)] {
        let scan = read(&bytes, &log, frame).expect("whole");
        assert_eq!(scan.frame_direction, frame.or(UP));
        assert_eq!(scan.channels.len(), 2);
        for (direction, back) in [
            (LineDirection::Trace, false),
            (LineDirection::Retrace, true),
        ] {
            let channel = of(&scan, direction);
            assert_eq!((channel.rows, channel.columns), (3, 4));
            assert_eq!((channel.name.as_str(), channel.unit.as_str()), ("Z", "m"));
            assert!(matches!(channel.samples, Samples::I32(_)));
            let values = channel.values();
            for (row, column) in (0..3).flat_map(|row| (0..4).map(move |column| (row, column))) {
                // Row 0 is the bottom one, which is the last line downwards.
                let line = if frame == DOWN { 2 - row } else { row };
                let time = first + 8 * line + if back { 4 + (3 - column) } else { column };
                let expected = (time as f64 - 10.0) / 2e9;
                let found = values[4 * row + column];
                assert!((found - expected).abs() < 1e-18, "{found} for {expected}");
            }
        }
    }
}

#[test]
fn the_log_tells_the_frame() {
    let bytes = data(STORED, 7, 48, &counts(48));
    let log = session()
        .mark("MTRX$SAMPLE_NAME-Graphene on Ru")
        .stored(STORED, "s--1_1.I_mtrx")
        .stored(STORED, NAME)
        .stored(STORED + 9, "s--1_2.Z_mtrx");
    let scan = read(&bytes, &log, DOWN).expect("whole");
    assert_eq!(scan.format, "Omicron Matrix MATRIX V3.2");
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9 * b.abs();
    let [width, height] = scan.size_nm.expect("a size");
    assert!(near(width, 80.0) && near(height, 60.0));
    assert!(near(scan.offset_nm[0], 100.0) && near(scan.offset_nm[1], -200.0));
    assert!(near(scan.rotation_rad.to_degrees(), -30.0));
    assert_eq!(scan.line_times_s, Some([0.04; 2]));
    assert!(near(scan.line_rate_hz.expect("a rate"), 12.5));
    let [a, b] = of(&scan, LineDirection::Trace).pitch_nm().expect("a pitch");
    assert!(near(a, 20.0) && near(b, 20.0));
    let time = scan.acquired.expect("a date");
    assert_eq!((time.year, time.month, time.day), (2020, 9, 21));
    assert_eq!((time.hour, time.minute, time.second), (12, 53, 20));
    assert_eq!(scan.notes.len(), 1);
    assert!(scan.notes[0].contains("untested"), "{}", scan.notes[0]);
    let told = |key: &str| {
        let found = scan.metadata.iter().find(|(k, _)| k == key);
        found.map(|(_, words)| words.as_str())
    };
    assert_eq!(told("SAMPLE_NAME"), Some("Graphene on Ru"));
    assert_eq!(told("GapVoltageControl.Voltage"), Some("-1.5 V"));
    assert_eq!(told("Frames in the file"), Some("up, down"));
    assert_eq!(told("Other files of the frame"), Some("s--1_1.I_mtrx"));
}

/// 400 lines of 8 × 0.01 s × 400 points take 3200 s: the frame upwards ended so much earlier.
#[test]
fn the_frame_upwards_ended_before_the_file() {
    let size = |log: Log| {
        log.change(5, "XYScanner", "Points", "Count", V::Long(400))
            .change(5, "XYScanner", "Lines", "Count", V::Long(400))
    };
    let log = size(scanner([true, true])).stored(STORED, NAME);
    let bytes = data(STORED, 7, 640_000, &counts(640_000));
    let [up, down] = [UP, DOWN].map(|frame| read(&bytes, &log, frame).expect("whole"));
    let minutes = |scan: &Scan| scan.acquired.map(|t| (t.hour, t.minute, t.second));
    assert_eq!(minutes(&down), Some((12, 53, 20)));
    // 3200 s are 53 min 20 s.
    assert_eq!(minutes(&up), Some((12, 0, 0)));
}

#[test]
fn only_the_ways_that_were_recorded() {
    for (ways, samples) in [
        ([false, false], 12),
        ([true, false], 24),
        ([false, true], 24),
    ] {
        let bytes = data(STORED, 7, samples, &counts(samples as i32));
        let log = scanner(ways).stored(STORED, NAME);
        let scan = read(&bytes, &log, None).expect("whole");
        assert_eq!(scan.channels.len(), 1 + usize::from(ways[0]));
        // How long the way back takes is told by its samples only.
        assert_eq!(scan.line_times_s.is_some(), ways[0]);
        let down = read(&bytes, &log, DOWN);
        if ways[1] {
            let values = of(&down.expect("there"), LineDirection::Trace).values();
            assert_eq!(values[..4], [20.0, 21.0, 22.0, 23.0]);
            // When the frame upwards ended is not known without the time of the way back.
            assert_eq!(scan.acquired, None);
        } else {
            assert!(refused(down).contains("upwards only"));
            assert!(scan.acquired.is_some());
        }
    }
}

/// Stopped in the second line of the frame upwards, or in that of the frame downwards.
#[test]
fn unfinished_frames_have_gaps() {
    let log = session().stored(STORED, NAME);
    let missing = |scan: &Scan, line| -> Vec<usize> {
        let values = of(scan, line).values();
        (0..12).filter(|&i| values[i].is_nan()).collect()
    };
    let bytes = data(STORED, 7, 48, &counts(8 + 5));
    let scan = read(&bytes, &log, None).expect("a part");
    assert_eq!(missing(&scan, LineDirection::Trace), [8, 9, 10, 11]);
    // One sample of the second retrace: its right one.
    assert_eq!(
        missing(&scan, LineDirection::Retrace),
        [4, 5, 6, 8, 9, 10, 11]
    );
    assert_eq!(scan.size_nm.map(|[_, height]| height.round()), Some(60.0));
    assert!(refused(read(&bytes, &log, DOWN)).contains("upwards only"));

    let bytes = data(STORED, 7, 48, &counts(24 + 8 + 2));
    assert_eq!(
        missing(
            &read(&bytes, &log, UP).expect("whole"),
            LineDirection::Trace
        ),
        [0; 0]
    );
    let scan = read(&bytes, &log, DOWN).expect("a part");
    assert_eq!(missing(&scan, LineDirection::Trace), [0, 1, 2, 3, 6, 7]);
    assert_eq!(
        missing(&scan, LineDirection::Retrace),
        [0, 1, 2, 3, 4, 5, 6, 7]
    );

    let bytes = data(STORED, 7, 48, &counts(3));
    let scan = read(&bytes, &log, None).expect("three samples");
    assert_eq!((scan.channels.len(), scan.unreadable.len()), (1, 1));
    let none = data(STORED, 7, 48, &[]);
    assert!(refused(read(&none, &log, None)).contains("no sample"));
}

#[test]
fn transfer_functions() {
    let bytes = data(STORED, 7, 48, &counts(48));
    let value = |kind: &str, unit: &str, numbers: &[(&str, f64)]| {
        let log = scanner([true, true])
            .channels(&[
                dictionary([true, true], &[(7, "Z", "m", 1)]),
                transfer(7, kind, unit, numbers),
            ])
            .stored(STORED, NAME);
        let scan = read(&bytes, &log, None).expect("whole");
        let channel = of(&scan, LineDirection::Trace);
        (channel.values()[5], channel.unit.clone(), scan.notes.len())
    };
    // Sample 9 is the second of the second line.
    let (found, unit, notes) = value("TFF_Linear1D", "m", &[("Factor", 4.0), ("Offset", 1.0)]);
    assert_eq!((found, unit.as_str(), notes), (2.0, "m", 1));
    let numbers = [
        ("NeutralFactor", 5.0),
        ("Offset", -1.0),
        ("PreFactor", 2.0),
        ("PreOffset", -3.0),
        ("Raw_1", 1.0),
    ];
    // (1 + 3)·(9 + 1)/(5·2)
    let (found, unit, _) = value("TFF_MultiLinear1D", "Meter", &numbers);
    assert_eq!((found, unit.as_str()), (4.0, "m"));
    assert_eq!(value("TFF_Identity", "", &[]).0, 9.0);
    // What is not known, not finite or contradictory leaves counts or no unit, and says so.
    assert_eq!(value("TFF_Cubic", "m", &[]), (9.0, String::new(), 2));
    let zero = [("Factor", 0.0), ("Offset", 0.0)];
    assert_eq!(value("TFF_Linear1D", "m", &zero), (9.0, String::new(), 2));
    let one = [("Factor", 1.0), ("Offset", 0.0)];
    assert_eq!(value("TFF_Linear1D", "A", &one), (9.0, String::new(), 2));
}

/// Two quantities of one name: the key of the channel tells whose function it is.
#[test]
fn keys_come_before_names() {
    let recorded = [(7, "Z", "m", 1), (8, "Z", "m", 1)];
    let function = |channel, factor| {
        let numbers = [("Factor", factor), ("Offset", 0.0)];
        transfer(channel, "TFF_Linear1D", "m", &numbers)
    };
    let log = scanner([true, true])
        .channels(&[
            dictionary([true, true], &recorded),
            lengths(8, 6),
            function(7, 1.0),
            function(8, 0.5),
        ])
        .stored(STORED, NAME);
    let scale = |channel| {
        let scan = read(&data(STORED, channel, 48, &counts(48)), &log, None).expect("whole");
        (scan.channels[0].scale, scan.channels[0].unit.clone())
    };
    assert_eq!(scale(7), (1.0, "m".to_owned()));
    assert_eq!(scale(8), (2.0, "m".to_owned()));
    // A channel without an entry and a name that is two: counts.
    assert_eq!(scale(9), (1.0, String::new()));
}

/// The state is that of the moment the file was stored.
#[test]
fn parameters_change_between_frames() {
    let second = "s--1_2.Z_mtrx";
    let later = STORED + 100_000;
    let log = session()
        .stored(STORED, NAME)
        .change(STORED + 10, "XYScanner", "Width", "Meter", V::Double(4e-8))
        .change(STORED + 10, "XYScanner", "Points", "Count", V::Long(2))
        .channels(&[
            lengths(4, 6),
            transfer(7, "TFF_Linear1D", "m", &[("Factor", 1e9), ("Offset", 0.0)]),
        ])
        .stored(later, second)
        .change(later + 1, "XYScanner", "Width", "Meter", V::Double(1.0));
    let first = read(&data(STORED, 7, 48, &counts(48)), &log, None).expect("whole");
    let bytes = data(later, 7, 24, &counts(24));
    let second = read_frame(&bytes, &[&log.0], second, None, &|_| true).expect("whole");
    let shape = |scan: &Scan| {
        let channel = &scan.channels[0];
        (
            channel.columns,
            scan.size_nm.map(|[width, _]| width.round()),
            channel.scale,
        )
    };
    assert_eq!(shape(&first), (4, Some(80.0), 0.5e-9));
    assert_eq!(shape(&second), (2, Some(40.0), 1e-9));
    assert_eq!(second.notes.len(), 1);
}

/// Which size holds for a frame during which it was changed is not told.
#[test]
fn changes_during_a_frame_are_doubts() {
    let bytes = data(STORED, 7, 48, &counts(48));
    let changed = |name: &str, v: V, before: u64| {
        let unit = if name == "Raster_Time" {
            "Second"
        } else {
            "Meter"
        };
        let log = session().change(STORED - before, "XYScanner", name, unit, v);
        read(&bytes, &log.stored(STORED, NAME), None).expect("whole")
    };
    // 48 samples of 0.01 s take half a second.
    let width = changed("Width", V::Double(9e-8), 1);
    assert_eq!((width.size_nm, width.notes.len()), (None, 2));
    assert!(width.line_rate_hz.is_some());
    let before = changed("Width", V::Double(9e-8), 2);
    assert_eq!((before.size_nm.is_some(), before.notes.len()), (true, 1));
    let same = changed("Width", V::Double(8e-8), 0);
    assert_eq!((same.size_nm.is_some(), same.notes.len()), (true, 1));
    let time = changed("Raster_Time", V::Double(0.02), 1);
    assert_eq!((time.line_rate_hz, time.acquired), (None, None));
    assert!(time.size_nm.is_some() && time.notes[1].contains("Raster_Time"));
}

#[test]
fn what_descriptions_disagree_on_is_left_out() {
    let bytes = data(STORED, 7, 48, &counts(48));
    let zoomed = |zoom| {
        let log = session().change(5, "XYScanner", "Zoom", "--", V::Long(zoom));
        read(&bytes, &log.stored(STORED, NAME), None)
            .expect("whole")
            .size_nm
    };
    assert!(zoomed(1).is_some());
    assert_eq!(zoomed(2), None);
    let log = session().change(5, "XYScanner", "Width", "Furlong", V::Double(1.0));
    let scan = read(&bytes, &log.stored(STORED, NAME), None).expect("whole");
    assert_eq!(scan.size_nm, None);
    let log = session().change(5, "XYScanner", "Angle", "Gon", V::Double(1.0));
    let scan = read(&bytes, &log.stored(STORED, NAME), None).expect("whole");
    assert_eq!(scan.rotation_rad, 0.0);
    assert!(scan.notes[1].contains("Angle 1"), "{:?}", scan.notes);
}
