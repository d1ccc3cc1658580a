use super::*;

const FRAME: &str = "DAC-Type=20bit\r\nGainZ / GainZ=3\r\nGainpreamp / GainPre 10^=9\r\n\
                     Rotation / Rotation=30.00\r\n  /  = \r\nScanYDirec / ScanYDirec=1\r\n\
                     Delay X+ / Delay X+=3\r\nDelay X- / Delay X-=1\r\nLength x[A]=60.0\r\n\
                     Length y[A]=40.0\r\nBiasvolt[mV]=50.00\r\nSec/Image:=8.0\r\nZPiezoconst=  9.21\r\n";
const STM: &str = "Channels / Channels=4\r\nChannelselectval / Channelselectval=3\r\n";

/// Lines of three samples and the numbers of the pixels, in the order of the file.
fn file(kind: &str, rows: usize, head: &str, samples: &[i16]) -> Vec<u8> {
    let mut bytes =
        format!("[{kind}]\r\nNum.X / Num.X=3\r\nNum.Y / Num.Y={rows}\r\n{head}").into_bytes();
    bytes.extend(b"\x0cICON=\n=\0DAT");
    bytes.resize(HEADER - DATA.len(), 0);
    bytes.extend(DATA);
    // The first one is no pixel.
    let stored = [77].iter().chain(samples);
    let stored: Vec<u8> = match kind {
        "Parameter" => stored.flat_map(|n| n.to_le_bytes()).collect(),
        _ => stored.flat_map(|&n| f32::from(n).to_le_bytes()).collect(),
    };
    bytes.extend(match kind {
        "Paramco32" => packed(&[&stored[..], &[0; 4 * 3 * 4]].concat()),
        _ => stored,
    });
    bytes
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut stream = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    stream.write_all(bytes).expect("memory");
    stream.finish().expect("memory")
}

const KINDS: [&str; 3] = ["Parameter", "Paramet32", "Paramco32"];

fn counts(channel: &crate::Channel) -> Vec<f64> {
    channel
        .values()
        .iter()
        .map(|v| (v / channel.scale).round())
        .collect()
}

#[test]
fn heights_and_currents_forward_and_backward() {
    let samples: Vec<i16> = (1..25).collect();
    for kind in KINDS {
        let scan = crate::read(&file(kind, 2, &[FRAME, STM].concat(), &samples)).expect(kind);
        assert_eq!(scan.notes.len(), usize::from(kind != "Paramco32"), "{kind}");
        let told: Vec<_> = scan
            .channels
            .iter()
            .map(|c| (&*c.name, &*c.unit, c.line_direction))
            .collect();
        let [trace, retrace] = [Some(LineDirection::Trace), Some(LineDirection::Retrace)];
        assert_eq!(
            told,
            [
                ("Topography", "nm", trace),
                ("Current", "A", trace),
                ("Topography", "nm", retrace),
                ("Current", "A", retrace)
            ]
        );
        assert_eq!(
            counts(&scan.channels[0]),
            [4.0, 5.0, 6.0, 1.0, 2.0, 3.0],
            "{kind}"
        );
        assert_eq!(
            counts(&scan.channels[3]),
            [22.0, 23.0, 24.0, 19.0, 20.0, 21.0],
            "{kind}"
        );
        let volts = 20.0 / 1_048_576.0;
        let [height, current] = [scan.channels[0].scale, scan.channels[1].scale];
        assert!((height / (volts * 3.0 * 0.921) - 1.0).abs() < 1e-12);
        assert!((current / (volts * 1e-9) - 1.0).abs() < 1e-12);
    }
}

#[test]
fn the_frame_is_told() {
    let scan = crate::read(&file("Paramet32", 2, &[FRAME, STM].concat(), &[1; 24])).expect("whole");
    let size = scan.size_nm.expect("a size");
    assert!((size[0] - 6.0).abs() + (size[1] - 4.0).abs() < 1e-12);
    let pitch = scan.channels[0].pitch_nm().expect("a pitch");
    assert!((pitch[0] - 2.0).abs() + (pitch[1] - 2.0).abs() < 1e-12);
    assert!((scan.rotation_rad - 30f64.to_radians()).abs() < 1e-12);
    assert_eq!(scan.line_times_s, Some([3.0, 1.0]));
    assert_eq!(scan.line_rate_hz, Some(0.25));
    assert_eq!(scan.frame_direction, Some(FrameDirection::Down));
    let bias = ("Biasvolt[mV]".to_owned(), "50.00".to_owned());
    assert!(scan.metadata.contains(&bias));
    assert!(scan.metadata.iter().all(|(key, _)| !key.contains("ICON")));
}

/// The third of four lines was stopped in its second sample.
#[test]
fn lines_that_were_not_recorded_are_missing() {
    let forward = [1, 2, 3, 4, 0, 6, 7, 8, 0, 0, 0, 0];
    let backward = [1, 2, 3, 4, 5, 6, 0, 0, 0, 0, 0, 0];
    let head = format!("{FRAME}Channels=2\r\nChannelselectval=1\r\n");
    for kind in KINDS {
        let scan = crate::read(&file(kind, 4, &head, &[forward, backward].concat())).expect(kind);
        let [a, b] = [0, 1].map(|n| counts(&scan.channels[n]));
        assert!(a[..3].iter().chain(&b[..6]).all(|n| n.is_nan()), "{kind}");
        assert!(a[3] == 7.0 && a[4] == 8.0 && a[5].is_nan(), "{kind}: {a:?}");
        assert_eq!(a[6..], [4.0, 0.0, 6.0, 1.0, 2.0, 3.0], "{kind}");
        let none = crate::read(&file(kind, 4, &head, &[0; 24]));
        assert!(
            matches!(none, Err(ReadError::AllMissing { channels: 2 })),
            "{kind}"
        );
    }
}

#[test]
fn what_is_not_known_keeps_its_counts() {
    let read = |head: &str| {
        crate::read(&file("Paramet32", 2, head, &[5; 24]))
            .expect("whole")
            .channels
    };
    let unknown = read("Channels=4\r\nChannelselectval=7\r\n");
    assert_eq!(
        (&*unknown[1].name, unknown[1].line_direction),
        ("Channel 2", None)
    );
    assert_eq!((&*unknown[0].unit, unknown[0].values()[0]), ("", 5.0));
    let more = read(&format!("{FRAME}Channels=4\r\nChan(1,2,4)=4\r\n"));
    assert_eq!((&*more[3].name, &*more[3].unit), ("Signal 4", ""));
    assert_eq!(more[3].line_direction, Some(LineDirection::Trace));
    // 60 Å are 3 steps of 256 counts at 10 × 40 Å/V.
    let step = "Delta X=256\r\nGainX=10\r\nXpiezoconst=40\r\n";
    let by_step = read(&format!(
        "{STM}{}{step}",
        FRAME.replace("DAC-Type=20bit", "")
    ));
    let volts = 60.0 / (3.0 * 256.0 * 10.0 * 40.0);
    assert!((by_step[1].scale / (volts * 1e-9) - 1.0).abs() < 1e-12);
}

#[test]
fn channels_that_are_cut_off_are_lost() {
    let samples: Vec<i16> = (0..2400).map(|n| n * 13 % 997 + 1).collect();
    for kind in KINDS {
        let whole = file(kind, 200, &[FRAME, STM].concat(), &samples);
        let cut = HEADER + (whole.len() - HEADER) * 2 / 3;
        let Err(ReadError::Incomplete { readable, reason }) = crate::read(&whole[..cut]) else {
            panic!("{kind}: cut off");
        };
        let found = [readable.channels.len(), readable.unreadable.len()];
        assert!(
            found == [2, 2] || kind == "Paramco32" && found.iter().sum::<usize>() == 4,
            "{kind}: {found:?}"
        );
        let top = counts(&readable.channels[0]);
        assert_eq!(top[top.len() - 3..], [1.0, 14.0, 27.0], "{kind}");
        assert!(reason.contains("Current"), "{reason}");
        assert!(crate::read(&whole[..HEADER - 1]).is_err());
        assert!(crate::read(&whole[..HEADER]).is_err());
    }
}

#[test]
fn streams_that_lie_are_found_out() {
    let read = |bytes: &[u8]| crate::read(bytes).expect_err("damaged").to_string();
    let whole = file("Paramco32", 2, &[FRAME, STM].concat(), &[3; 24]);
    let mut wrong = whole.clone();
    *wrong.last_mut().expect("a sum") ^= 1;
    assert!(read(&wrong).contains("zlib"));
    // A small file does not become gigabytes.
    assert!(read(&file("Paramco32", 400_000_000, STM, &[3; 24])).contains("400000000 lines"));
    assert!(read(&file("Paramco32", 400_000, STM, &[3; 24])).contains("12 of its 400000 lines"));
}

/// Programs that take names out leave the header shorter.
#[test]
fn shortened_headers() {
    let mut bytes = file("Paramet32", 2, &[FRAME, STM].concat(), &[9; 24]);
    bytes.drain(5000..5116);
    bytes[HEADER - 116 - DATA.len() - 1] = b'\n';
    assert_eq!(
        counts(&crate::read(&bytes).expect("whole").channels[0]),
        [9.0; 6]
    );
}

#[test]
fn spectra_and_other_files_are_told() {
    let spectrum = crate::read(b"[ParVERT30]\r\nNum.X / Num.X=3\r\n").expect_err("no image");
    assert!(
        spectrum
            .to_string()
            .contains("a spectrum of a Createc controller: no image")
    );
    assert_eq!(
        crate::detect(b"[Parameter]\r\nspeed=3\r\n"),
        crate::Format::Text
    );
    assert_eq!(
        crate::detect(b"[Parameter]\r\nNum.X=3\r\n"),
        crate::Format::Createc
    );
}
