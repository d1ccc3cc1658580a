//! Damaged files end in an error or in the part that is whole: never in a panic, and never in more
//! memory than the file's bytes call for.

use std::sync::LazyLock;

use proptest::prelude::*;
use spmfile::nanoscope::write;
use spmfile::{Channel, LineDirection, ReadError, Samples, Scan, read};

use crate::common;

/// A small file of our own: three channels of 12 × 16.
static WRITTEN: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let channel = |name: &str, unit: &str| Channel {
        name: name.to_owned(),
        internal_name: name.replace(' ', ""),
        unit: unit.to_owned(),
        line_direction: Some(LineDirection::Trace),
        scan_line: None,
        rows: 12,
        columns: 16,
        width_nm: Some(100.0),
        height_nm: Some(75.0),
        span: spmfile::Span::Frame,
        scale: 1.0,
        offset: 0.0,
        scaling: String::new(),
        plane_fit: None,
        samples: Samples::F64((0..192).map(f64::from).collect()),
    };
    let scan = Scan {
        format: String::new(),
        instrument: None,
        acquired: None,
        frame_direction: None,
        line_rate_hz: Some(1.0),
        rounding: None,
        rotation_rad: 0.0,
        offset_nm: [0.0; 2],
        size_nm: Some([100.0, 75.0]),
        closed_loop: None,
        line_times_s: None,
        notes: Vec::new(),
        metadata: Vec::new(),
        channels: vec![
            channel("TR Phase", "°"),
            channel("Xsensor", "nm"),
            channel("Ysensor", "nm"),
        ],
        unreadable: Vec::new(),
    };
    write(&scan).expect("finite values")
});

/// A real file, where there is one.
static REAL: LazyLock<Option<Vec<u8>>> = LazyLock::new(|| {
    let data = common::testdata("damaged real files")?;
    Some(common::bytes(
        &data.join("real/nanoscope/icon_v91_tapping_4ch.spm"),
    ))
});

fn sources() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        3 => Just(WRITTEN.clone()),
        1 => Just(REAL.clone().unwrap_or_else(|| WRITTEN.clone())),
    ]
}

/// The header's length: its end marker included.
fn header_length(bytes: &[u8]) -> usize {
    let end = b"\\*File list end";
    let at = bytes.windows(end.len()).position(|w| w == end);
    at.expect("an end") + end.len()
}

/// Reads, and checks that what came out fits what went in.
fn survive(bytes: &[u8]) {
    let scan = match read(bytes) {
        Ok(scan) => scan,
        Err(ReadError::Incomplete { readable, .. }) => *readable,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    let mut held = 0;
    for channel in &scan.channels {
        assert_eq!(channel.samples.len(), channel.rows * channel.columns);
        assert!(channel.scale.is_finite());
        assert!(channel.width_nm.is_none_or(|w| w > 0.0 && w.is_finite()));
        held += match &channel.samples {
            Samples::I16(v) => 2 * v.capacity(),
            Samples::I32(v) => 4 * v.capacity(),
            Samples::F32(v) => 4 * v.capacity(),
            Samples::F64(v) => 8 * v.capacity(),
        };
    }
    // Channels do not share bytes; 16-bit counts with a missing region become 64 bits.
    assert!(held <= 4 * bytes.len(), "{held} bytes from {}", bytes.len());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn flipped_bits(
        mut bytes in sources(),
        flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8), 1..40),
    ) {
        let length = header_length(&bytes);
        for (at, bit) in flips {
            bytes[at.index(length)] ^= 1_u8 << bit;
        }
        survive(&bytes);
    }

    #[test]
    fn cut_off(bytes in sources(), at in any::<prop::sample::Index>()) {
        let cut = at.index(bytes.len());
        // A file shorter than its header promises is never read as if it were whole.
        prop_assert!(read(&bytes[..cut]).is_err());
        survive(&bytes[..cut]);
    }

    #[test]
    fn other_numbers(
        bytes in sources(),
        which in prop::collection::vec(any::<prop::sample::Index>(), 1..4),
        number in prop::sample::select(vec![
            "0", "-1", "1", "2", "65536", "4294967296", "18446744073709551615", "9223372036854775807",
            "1e308", "-1e308", "1e-320", "NaN", "inf", "99999999999999999999999999", "", "3.5", "é",
        ]),
    ) {
        let length = header_length(&bytes);
        let mut header = bytes[..length].to_vec();
        for index in which {
            let numbers: Vec<_> = number_spans(&header);
            let (from, to) = numbers[index.index(numbers.len())];
            header.splice(from..to, number.bytes());
        }
        // Keep the data where the offsets expect them.
        header.resize(length.max(header.len()), 0);
        let mut changed = header;
        changed.extend_from_slice(&bytes[length..]);
        survive(&changed);
    }

    #[test]
    fn lines_lost_or_doubled(
        bytes in sources(),
        lost in prop::collection::vec(any::<prop::sample::Index>(), 0..6),
        doubled in prop::collection::vec(any::<prop::sample::Index>(), 0..6),
    ) {
        let length = header_length(&bytes);
        let mut lines: Vec<&[u8]> = bytes[..length].split_inclusive(|&b| b == b'\n').collect();
        for index in doubled {
            let at = index.index(lines.len());
            lines.insert(at, lines[at]);
        }
        for index in lost {
            lines.remove(index.index(lines.len()));
        }
        let mut changed = lines.concat();
        changed.resize(length.max(changed.len()), 0);
        changed.extend_from_slice(&bytes[length..]);
        survive(&changed);
    }

    #[test]
    fn noise(bytes in prop::collection::vec(any::<u8>(), 0..300), scan_like in any::<bool>()) {
        let mut file = if scan_like { b"\\*File list\r\n".to_vec() } else { Vec::new() };
        file.extend(bytes);
        survive(&file);
    }
}

/// Where runs of digits begin and end.
fn number_spans(text: &[u8]) -> Vec<(usize, usize)> {
    let mut spans = Vec::new();
    let mut start = None;
    for (i, byte) in text.iter().enumerate() {
        match (byte.is_ascii_digit(), start) {
            (true, None) => start = Some(i),
            (false, Some(from)) => {
                spans.push((from, i));
                start = None;
            }
            _ => {}
        }
    }
    spans
}

/// Hundreds of images that all claim the same bytes must not multiply the file.
#[test]
fn channels_that_share_bytes() {
    let mut header = String::from("\\*File list\r\n\\*Scanner list\r\n");
    for _ in 0..200 {
        header.push_str(
            "\\*Ciao image list\r\n\\Data offset: 60000\r\n\\Data length: 200000\r\n\\Bytes/pixel: 2\r\n\
             \\Samps/line: 250\r\n\\Number of lines: 400\r\n\\@2:Image Data: S [A] \"A\"\r\n\
             \\@2:Z scale: V (1 V/LSB) 65536 V\r\n",
        );
    }
    header.push_str("\\*File list end\r\n");
    let mut bytes = header.into_bytes();
    bytes.resize(260_000, 7);
    let scan = read(&bytes).expect("the first one is whole");
    assert_eq!((scan.channels.len(), scan.unreadable.len()), (1, 199));
    assert!(scan.unreadable[0].error.contains("overlap"));
}
