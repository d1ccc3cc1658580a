use super::*;

fn file(change: &[(&str, &str)], blocks: usize) -> Vec<u8> {
    let section = |name: &str, frame: &str| {
        format!(
            "[{name}]\r\nPoints=3\r\nLines=2\r\nFrame={frame}\r\nCurLine=1\r\nDim0Unit=m\r\n\
             Dim0Range=3e-008\r\nDim1Unit=m\r\nDim1Range=2e-008\r\nDim2Name=Z-Axis\r\n\
             Dim2Unit=m\r\nDim2Range=65536\r\nDim2Min=-32768\r\nSaveMode=Binary\r\nSaveBits=16\r\n\
             SaveSign=Signed\r\nSaveOrder=Intel\r\n\r\n"
        )
    };
    let mut text = format!(
        "[DataSet]\r\nGroupCount=2\r\nGr0-Count=21\r\nGr1-Ch1=DataSet-1:1\r\n\
         Gr0-Ch1=DataSet-0:1\r\n\r\n[DataSet-Info]\r\n-- Scan --=---\r\nScan direction=Down\r\n\
         Time/Line=500ms\r\nRotation=33 \u{b0}\r\nX-Pos=1.5\u{b5}m\r\nY-Pos=-2e-7m\r\n\
         Date=01-03-2016\r\nTime=18:36:58\r\n\r\n{}{}",
        section("DataSet-0:1", "Scan forward"),
        section("DataSet-1:1", "Scan backward")
    );
    for (from, to) in change {
        text = text.replace(from, to);
    }
    let mut bytes: Vec<u8> = text.chars().map(|c| c as u8).collect();
    bytes.extend(DATA_MARK);
    bytes.extend((0..6 * blocks as i16).flat_map(i16::to_le_bytes));
    bytes
}

#[test]
fn groups_come_in_order_and_lines_as_they_are() {
    let scan = crate::read(&file(&[], 2)).expect("whole");
    assert_eq!(scan.channels[0].line_direction, Some(LineDirection::Trace));
    assert_eq!(scan.channels[0].values(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(
        scan.channels[1].line_direction,
        Some(LineDirection::Retrace)
    );
    assert_eq!(scan.channels[1].values(), [6.0, 7.0, 8.0, 9.0, 10.0, 11.0]);
    let width = scan.channels[0].width_nm.expect("a width");
    assert!((width - 30.0).abs() < 1e-9);
    let unsigned = crate::read(&file(&[("SaveSign=Signed", "SaveSign=Unsigned")], 2));
    assert_eq!(unsigned.expect("whole").channels[0].values()[1], -32767.0);
}

#[test]
fn the_frame_is_told() {
    let scan = crate::read(&file(&[], 2)).expect("whole");
    assert_eq!(scan.frame_direction, Some(FrameDirection::Down));
    assert_eq!(scan.line_times_s, Some([0.5, 0.5]));
    assert_eq!(scan.line_rate_hz, Some(1.0));
    assert!((scan.rotation_rad - 33f64.to_radians()).abs() < 1e-12);
    assert!((scan.offset_nm[0] - 1500.0).abs() < 1e-9);
    assert!((scan.offset_nm[1] + 200.0).abs() < 1e-9);
    assert_eq!(scan.acquired, clock::date([2016, 3, 1], [18, 36, 58]));
}

#[test]
fn an_unfinished_frame_misses_its_end() {
    let values = |direction: &str, samples: [i16; 4]| {
        let turn = format!("Scan direction={direction}");
        let change = [
            ("CurLine=1", "CurLine=0"),
            ("Points=3", "Points=2"),
            ("Scan direction=Down", &*turn),
        ];
        let mut bytes = file(&change, 0);
        bytes.extend(
            [samples, samples]
                .as_flattened()
                .iter()
                .flat_map(|n| n.to_le_bytes()),
        );
        crate::read(&bytes).expect("whole").channels[0].values()
    };
    let up = values("Up", [7, 8, 0, 0]);
    assert_eq!(up[..2], [7.0, 8.0]);
    assert!(up[2].is_nan() && up[3].is_nan());
    let down = values("Down", [0, 0, 7, 8]);
    assert!(down[0].is_nan() && down[1].is_nan());
    assert_eq!(down[2..], [7.0, 8.0]);
    // Measured after all.
    assert_eq!(values("Up", [7, 8, 0, 1]), [7.0, 8.0, 0.0, 1.0]);
    let constant = values("Up", [7, 7, 7, 7]);
    assert_eq!(constant[..2], [7.0, 7.0]);
}

#[test]
fn what_is_missing_is_said() {
    let error = |change: &[(&str, &str)]| {
        crate::read(&file(change, 2))
            .expect_err("damaged")
            .to_string()
    };
    assert!(error(&[("SaveBits=16", "SaveBits=12")]).contains("12"));
    assert!(error(&[("[DataSet-0:1]", "[DataSet-0:7]")]).contains("DataSet-0:1"));
    assert!(error(&[("Points=3", "Points=99999999999999999999")]).contains("Points"));
    assert!(error(&[("Points=3", "Points=9999999999999999")]).contains("bytes long"));
    assert!(error(&[("Dim1Unit=m", "Dim1Unit=V")]).contains("curves"));
    assert!(error(&[("Dim2Range=65536", "Dim2Range=x")]).contains("Dim2Range"));
    let whole = file(&[], 2);
    assert!(matches!(
        crate::read(&whole[..whole.len() - 1]),
        Err(ReadError::Incomplete { readable, .. }) if readable.channels.len() == 1
    ));
    assert!(matches!(
        crate::read(&file(&[], 0)),
        Err(ReadError::HeaderOnly { announced: 2, .. })
    ));
    assert!(
        crate::read(&whole[..99])
            .expect_err("cut")
            .to_string()
            .contains("header")
    );
}

#[test]
fn quantities() {
    assert_eq!(quantity("1 s"), Some((1.0, "s".to_owned())));
    assert_eq!(quantity("2e-7m"), Some((200.0, "nm".to_owned())));
    assert_eq!(quantity("-0.5 \u{b0}"), Some((-0.5, "°".to_owned())));
    assert_eq!(quantity("Free"), None);
}
