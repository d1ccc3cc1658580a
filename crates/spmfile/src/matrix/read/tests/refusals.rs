//! What is refused, and by which name; shapes that contradict each other.

use super::writer::{Log, V, data, dictionary, lengths, scanner, session};
use super::{NAME, STORED, counts, read, refused};
use crate::matrix::{frame_and_channel, is_curve, log_file, read as read_frame};
use crate::scan::LineDirection;

/// Parameters and axes may differ; the number of samples decides, or nothing does.
#[test]
fn shapes_are_checked() {
    let axes = |x, y, mirrored| {
        scanner([true, true])
            .channels(&[dictionary(mirrored, &[(7, "Z", "m", 1)]), lengths(x, y)])
            .stored(STORED, NAME)
    };
    let shape = |samples: u32, log: &Log| {
        let bytes = data(STORED, 7, samples, &counts(samples as i32));
        read(&bytes, log, None).map(|scan| {
            let channel = &scan.channels[0];
            (channel.rows, channel.columns, scan.channels.len())
        })
    };
    assert_eq!(
        shape(48, &axes(8, 6, [true, true])).expect("agree"),
        (3, 4, 2)
    );
    assert_eq!(
        shape(15, &axes(5, 3, [false, false])).expect("the axes"),
        (3, 5, 1)
    );
    assert_eq!(
        shape(48, &axes(5, 3, [false, false])).expect("the parameters"),
        (3, 4, 2)
    );
    for (samples, log) in [
        (48, axes(12, 4, [true, true])),
        (17, axes(8, 6, [true, true])),
    ] {
        let bytes = data(STORED, 7, samples, &counts(samples as i32));
        assert!(refused(read(&bytes, &log, None)).contains("3 lines of 4 points"));
    }
}

#[test]
fn what_is_no_image_is_refused_by_name() {
    let bytes = data(STORED, 7, 48, &counts(48));
    let log = session().stored(STORED, NAME);
    let named =
        |name: &str, bytes: &[u8]| refused(read_frame(bytes, &[&log.0], name, None, &|_| true));
    assert!(named("s--1_1.I(V)_mtrx", &bytes).contains("spectroscopy"));
    assert!(named("s--1_2.Z_mtrx", &bytes).contains("such as s--1_1.Z_mtrx"));
    assert!(named("renamed.mtrx", &bytes).contains("expected a name like"));
    assert!(named(NAME, &log.0).contains("log of a session"));
    assert!(refused(crate::read(&log.0)).contains("give the images"));
    assert!(refused(crate::read(&bytes)).contains("_0001.mtrx"));
    assert!(refused(crate::read(b"ONTMATRX0101")).contains("TLKB"));
    let other = read_frame(&bytes, &[&bytes], NAME, None, &|_| true);
    assert!(refused(other).contains("s_0001.mtrx"));
    let none = read_frame(&bytes, &[], NAME, None, &|_| true);
    assert!(refused(none).contains("s_0001.mtrx"));
    let bound = session().change(5, "XYScanner", "Scan_Constraint", "--", V::Long(2));
    assert!(refused(read(&bytes, &bound.stored(STORED, NAME), None)).contains("bound to a line"));
    let along_v = scanner([true, true])
        .channels(&[dictionary([true, true], &[(7, "Z", "m", 3)])])
        .stored(STORED, NAME);
    assert!(refused(read(&bytes, &along_v, None)).contains("Spectroscopy::V"));
}

#[test]
fn logs_in_parts() {
    let bytes = data(STORED, 7, 48, &counts(48));
    let first = session().stored(STORED, "s--1_9.Z_mtrx");
    let second = Log(b"ONTMATRX0101".to_vec()).stored(STORED, NAME);
    let scan = read_frame(&bytes, &[&first.0, &second.0], NAME, None, &|_| true);
    assert_eq!(scan.expect("whole").channels.len(), 2);
    // A log that is still being written ends anywhere.
    let log = session()
        .stored(STORED, NAME)
        .change(STORED, "A", "B", "", V::Bool(true));
    assert!(read(&bytes, &Log(log.0[..log.0.len() - 7].to_vec()), None).is_ok());
}

#[test]
fn names_tell_the_log() {
    let log = |name| log_file(name, 1);
    let name = "Grüße--2_STM-STM_Spectroscopy--12_3.Aux1_mtrx";
    assert_eq!(
        log(name).as_deref(),
        Some("Grüße--2_STM-STM_Spectroscopy_0001.mtrx")
    );
    assert_eq!(
        log_file(name, 2).as_deref(),
        Some("Grüße--2_STM-STM_Spectroscopy_0002.mtrx")
    );
    assert_eq!(log("a--1_1_Z.mtrx").as_deref(), Some("a_0001.mtrx"));
    for none in [
        "a_0001.mtrx",
        "a--1.Z_mtrx",
        "a--1_1.Z",
        "a--1_1._mtrx",
        "--ü",
        "",
        "a--x_1.Z_mtrx",
    ] {
        assert_eq!(log(none), None, "{none}");
    }
    let parts = frame_and_channel("a--1_1.I(V)_mtrx").expect("a name");
    assert_eq!(parts, ("a--1_1".to_owned(), "I(V)".to_owned()));
    assert!(is_curve(&parts.1) && !is_curve("Z"));
}

/// Only what is wanted is decoded.
#[test]
fn wanted_channels() {
    let log = session().stored(STORED, NAME);
    let bytes = data(STORED, 7, 48, &counts(48));
    let back = |info: &crate::ChannelInfo| info.line_direction == Some(LineDirection::Retrace);
    let scan = read_frame(&bytes, &[&log.0], NAME, None, &back).expect("whole");
    assert_eq!(scan.channels.len(), 1);
    let none = read_frame(&bytes, &[&log.0], NAME, None, &|_| false).expect("whole");
    assert!(none.channels.is_empty());
}
