use super::*;

struct Made {
    version: &'static str,
    kind: u32,
    steps: [f32; 2],
    completed: &'static str,
    columns: u32,
    pages: u32,
}

impl Default for Made {
    fn default() -> Self {
        Self {
            version: "005.004",
            kind: 0,
            steps: [-1e-9, -2e-9],
            completed: "0002",
            columns: 3,
            pages: 2,
        }
    }
}

/// Pages of 2 lines with 3 counts; the second one is of the way back.
fn made(m: &Made) -> Vec<u8> {
    let mut file = 56u16.to_le_bytes().to_vec();
    let mark = format!("STiMage {} 1", m.version);
    file.extend(mark.encode_utf16().flat_map(u16::to_le_bytes));
    file.resize(38, 0);
    let put = |file: &mut Vec<u8>, numbers: &[u32]| {
        file.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
    };
    put(&mut file, &[m.pages, 1, 12, 0, 0]);
    put(&mut file, &[PAGE_INDEX_HEADER, 70, 16]);
    put(&mut file, &[m.pages, 1, 0, 0]);
    put(&mut file, &[PAGE_INDEX, 98, 32]);
    let index = file.len();
    file.resize(index + 56 * m.pages as usize, 0);
    for page in 0..m.pages {
        let header = file.len() as u32;
        file.extend(180u16.to_le_bytes());
        file.extend(14u16.to_le_bytes());
        put(
            &mut file,
            &[1, 0, 0, 0, 0, m.columns, 2, 0, page, 0, 24, 0, 0],
        );
        let numbers = [
            m.steps[0], m.steps[1], 0.5, 0.0, 5e-9, -6e-9, 100.0, 0.25, 0.1, 1e-9, 33.0,
        ];
        file.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        put(&mut file, &[0, 0, 0, 1]);
        file.extend([0; 64]);
        let texts = file.len() as u32 + 12;
        put(&mut file, &[TEXTS, texts, 999_999]);
        let list = [
            "Topography",
            "",
            "",
            "",
            "",
            "07/02/20",
            "07:44:02",
            "m",
            "m",
            "m",
            "",
            "",
            "",
        ];
        for text in list.iter().chain(&[m.completed]) {
            file.extend((text.len() as u16).to_le_bytes());
            file.extend(text.encode_utf16().flat_map(u16::to_le_bytes));
        }
        let data = file.len() as u32;
        file.extend((0..6i32).flat_map(i32::to_le_bytes));
        let mut entry = vec![0; 16];
        put(
            &mut entry,
            &[
                m.kind,
                0,
                2,
                4,
                PAGE_HEADER,
                header,
                180,
                PAGE_DATA,
                data,
                24,
            ],
        );
        let at = index + 56 * page as usize;
        file[at..at + 56].copy_from_slice(&entry);
    }
    file
}

#[test]
fn signs_of_the_steps_tell_the_order() {
    let values = |steps: [f32; 2]| {
        let scan = crate::read(&made(&Made {
            steps,
            ..Made::default()
        }))
        .expect("whole");
        (scan.channels[0].values(), scan.frame_direction)
    };
    let (down, direction) = values([-1e-9, -2e-9]);
    assert_eq!(down, [102.5, 102.0, 101.5, 101.0, 100.5, 100.0]);
    assert_eq!(direction, Some(FrameDirection::Down));
    let (up, direction) = values([-1e-9, 2e-9]);
    assert_eq!(up, [101.0, 100.5, 100.0, 102.5, 102.0, 101.5]);
    assert_eq!(direction, Some(FrameDirection::Up));
    let (plain, _) = values([1e-9, 2e-9]);
    assert_eq!(plain, [100.0, 100.5, 101.0, 101.5, 102.0, 102.5]);
}

#[test]
fn the_frame_is_told() {
    let scan = crate::read(&made(&Made::default())).expect("whole");
    assert_eq!(scan.format, "RHK 005.004");
    let lines: Vec<_> = scan.channels.iter().map(|c| c.line_direction).collect();
    assert_eq!(
        lines,
        [Some(LineDirection::Trace), Some(LineDirection::Retrace)]
    );
    assert_eq!(scan.line_times_s, Some([0.75, 0.75]));
    assert!((scan.line_rate_hz.expect("a rate") - 1.0 / 1.5).abs() < 1e-12);
    // Steps are single precision in the file.
    let close = |[x, y]: [f64; 2], [a, b]: [f64; 2]| (x - a).abs() + (y - b).abs() < 1e-6;
    assert!(close(scan.size_nm.expect("a size"), [3.0, 4.0]));
    assert!(close(scan.offset_nm, [5.0, -6.0]));
    assert!((scan.rotation_rad - 33f64.to_radians()).abs() < 1e-12);
    assert_eq!(scan.acquired, clock::date([2020, 7, 2], [7, 44, 2]));
    let alone = crate::read(&made(&Made {
        pages: 1,
        ..Made::default()
    }))
    .expect("whole");
    assert_eq!((alone.line_times_s, alone.line_rate_hz), (None, None));
}

#[test]
fn lines_not_reached_are_missing() {
    let stopped = |steps: [f32; 2]| {
        let mut file = made(&Made {
            completed: "0001",
            steps,
            pages: 1,
            ..Made::default()
        });
        let end = file.len();
        file[end - 12..].fill(0);
        crate::read(&file).expect("whole").channels[0].values()
    };
    let down = stopped([-1e-9, -2e-9]);
    assert!(down[..3].iter().all(|v| v.is_nan()));
    assert_eq!(down[3..], [101.0, 100.5, 100.0]);
    let up = stopped([-1e-9, 2e-9]);
    assert_eq!(up[..3], [101.0, 100.5, 100.0]);
    assert!(up[3..].iter().all(|v| v.is_nan()));
}

#[test]
fn what_is_missing_is_said() {
    let error = |m: Made| crate::read(&made(&m)).expect_err("damaged").to_string();
    assert!(
        error(Made {
            version: "004.001",
            ..Made::default()
        })
        .contains("004.001")
    );
    assert!(
        error(Made {
            kind: 1,
            ..Made::default()
        })
        .contains("curves")
    );
    assert!(
        error(Made {
            columns: 0,
            ..Made::default()
        })
        .contains("0 samples")
    );
    let long = error(Made {
        columns: u32::MAX,
        ..Made::default()
    });
    assert!(long.contains("bytes long"), "{long}");
    let whole = made(&Made::default());
    assert!(matches!(
        crate::read(&whole[..whole.len() - 1]),
        Err(ReadError::Incomplete { readable, .. }) if readable.channels.len() == 1
    ));
    assert!(crate::read(&whole[..100]).is_err());
    let error = crate::read(b"STiMage 3.1").expect_err("old").to_string();
    assert!(error.contains("3.1"), "{error}");
}
