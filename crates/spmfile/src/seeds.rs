//! Keeps the files that unit tests read as seeds for the fuzzer, where `SPMFILE_SEEDS` names a
//! folder: one folder per reader in it.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;

use crate::detect::{Format, detect};

/// Longer files only slow the fuzzer down.
const LONGEST: usize = 1 << 16;

pub(crate) fn keep(bytes: &[u8]) {
    let Some(folder) = std::env::var_os("SPMFILE_SEEDS") else {
        return;
    };
    let format = detect(bytes);
    if bytes.len() > LONGEST || matches!(format, Format::Other(_)) {
        return;
    }
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    let folder = PathBuf::from(folder).join(reader(format));
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
        Format::OmicronMatrix => return "matrix".to_owned(),
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
    assert_eq!(reader(Format::NanoScopeForce), "nanoscope_force");
}
