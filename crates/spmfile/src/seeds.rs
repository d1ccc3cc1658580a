//! Keeps the files that unit tests read as seeds for the fuzzer, where `SPMFILE_SEEDS` names a
//! folder: one folder per reader in it.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;

use crate::detect::detect;
use crate::format::Format;

/// Longer files only slow the fuzzer down.
const LONGEST: usize = 1 << 16;

pub(crate) fn keep(bytes: &[u8]) {
    let format = detect(bytes);
    let paired = matches!(format, Format::OmicronMatrix | Format::OmicronMatrixLog);
    if !paired && !matches!(format, Format::Other(_)) {
        write(&reader(format), bytes);
    }
}

/// A file of a channel and its log in one: a byte, the length of the first, both, as the fuzz target
/// `matrix` takes them apart.
pub(crate) fn keep_session(bytes: &[u8], log: &[&[u8]], file_name: &str) {
    if file_name == "s--1_1.Z_mtrx" {
        let length = (bytes.len() as u32).to_le_bytes();
        let both = [&[0], &length[..], bytes, &log.concat()].concat();
        write("matrix", &both);
    }
}

fn write(reader: &str, bytes: &[u8]) {
    let Some(folder) = std::env::var_os("SPMFILE_SEEDS") else {
        return;
    };
    if bytes.len() > LONGEST {
        return;
    }
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    let folder = PathBuf::from(folder).join(reader);
    std::fs::create_dir_all(&folder).expect("a folder for seeds");
    let name = format!("{:016x}", hasher.finish());
    std::fs::write(folder.join(name), bytes).expect("a seed");
}

/// The name of the fuzz target: `JpkZip` is `jpk_zip`.
fn reader(format: Format) -> String {
    match format {
        Format::NanoScope => return "nanoscope".to_owned(),
        Format::NanoScopeForce => return "nanoscope_force".to_owned(),
        Format::ParkTiff => return "park".to_owned(),
        Format::AgilentMi => return "agilent".to_owned(),
        _ => {}
    }
    let mut name = String::new();
    for c in format!("{format:?}").chars() {
        if c.is_uppercase() && !name.is_empty() {
            name.push('_');
        }
        name.push(c.to_ascii_lowercase());
    }
    name
}

#[test]
fn names_of_targets() {
    assert_eq!(reader(Format::JpkZip), "jpk_zip");
    assert_eq!(reader(Format::Iso28632), "iso28632");
    assert_eq!(reader(Format::NanonisGrid), "nanonis_grid");
    assert_eq!(reader(Format::NanoScopeForce), "nanoscope_force");
}

/// A small frame of the one format that unit tests do not write otherwise.
#[test]
fn a_small_frame_is_a_seed() {
    use crate::{Channel, FrameDirection, LineDirection, Samples, Scan};
    let channel = |name: &str, line| Channel {
        name: name.to_owned(),
        internal_name: name.to_owned(),
        unit: "nm".to_owned(),
        line_direction: Some(line),
        scan_line: None,
        rows: 4,
        columns: 3,
        width_nm: Some(30.0),
        height_nm: Some(40.0),
        span: crate::scan::Span::Frame,
        scale: 0.5,
        offset: 0.0,
        scaling: String::new(),
        plane_fit: None,
        samples: Samples::I16((0..12).collect()),
    };
    let scan = Scan {
        frame_direction: Some(FrameDirection::Down),
        line_rate_hz: Some(1.0),
        size_nm: Some([30.0, 40.0]),
        channels: vec![
            channel("Height", LineDirection::Trace),
            channel("Xsensor", LineDirection::Retrace),
        ],
        ..Scan::default()
    };
    let bytes = crate::nanoscope::write(&scan).expect("finite values");
    let read = crate::read(&bytes).expect("whole");
    assert_eq!(read.channels.len(), 2);
    assert_eq!(read.frame_direction, scan.frame_direction);
}
