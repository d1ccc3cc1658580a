//! No line of a `NanoScope` header is lost on the way into another format and back.

use std::path::PathBuf;

use spmfile::{ReadError, Scan, WritableFormat, read, write};

use crate::common;

/// The bytes of a header as lines without line ends; no blank ones.
fn header_lines(bytes: &[u8]) -> Vec<&[u8]> {
    let end = b"\\*File list end";
    let length = bytes.windows(end.len()).position(|w| w == end).unwrap();
    let lines = bytes[..length].split(|&b| b == b'\n');
    lines
        .map(<[u8]>::trim_ascii)
        .filter(|line| !line.is_empty())
        .collect()
}

/// Lines that are no name of a section, and sections without lines.
fn expected_entries(bytes: &[u8]) -> usize {
    let lines = header_lines(bytes);
    let is_section = |line: &&[u8]| line.starts_with(b"\\*");
    let sections: Vec<usize> = (0..lines.len())
        .filter(|&i| is_section(&lines[i]))
        .collect();
    let empty = sections
        .iter()
        .filter(|&&i| lines.get(i + 1).is_none_or(is_section))
        .count();
    lines.len() - sections.len() + empty
}

fn scans(test: &str) -> Vec<(PathBuf, Vec<u8>, Scan)> {
    let Some(folder) = common::testdata(test) else {
        return Vec::new();
    };
    let entries = std::fs::read_dir(folder.join("real/nanoscope")).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).collect();
    files.sort();
    let mut scans = Vec::new();
    for path in files
        .into_iter()
        .filter(|p| p.extension().is_some_and(|e| e != "json"))
    {
        let bytes = common::bytes(&path);
        match read(&bytes) {
            Ok(scan) => scans.push((path, bytes, scan)),
            Err(ReadError::Incomplete { readable, .. }) => scans.push((path, bytes, *readable)),
            Err(_) => {}
        }
    }
    assert!(scans.len() >= 7, "{}", scans.len());
    scans
}

/// ASCII texts of an entry are those of its line.
#[test]
fn as_many_entries_as_lines() {
    for (path, bytes, scan) in scans("as_many_entries_as_lines") {
        let found = scan.metadata.len();
        assert_eq!(found, expected_entries(&bytes), "{}", path.display());
        assert!(found > 200, "{}: {found}", path.display());
        let mut names: Vec<&String> = scan.metadata.iter().map(|(name, _)| name).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), found, "{}", path.display());
        let lines = header_lines(&bytes);
        let lines = lines
            .iter()
            .filter(|line| !line.starts_with(b"\\*") && line.is_ascii());
        for line in lines {
            let line = std::str::from_utf8(line).unwrap();
            let same = |(name, value): &(String, String)| {
                let key = name.split_once(": ").map_or("", |(_, key)| key);
                let key = key.rsplit_once(" (").map_or(key, |(key, _)| key);
                line.ends_with(value.as_str()) && line.contains(key)
            };
            assert!(scan.metadata.iter().any(same), "{}: {line}", path.display());
        }
    }
}

#[test]
fn every_line_comes_back() {
    let flat = |metadata: &[(String, String)]| -> Vec<(String, String)> {
        let one_line = |text: &str| text.replace(|c: char| c.is_control(), " ");
        let pairs = metadata.iter();
        pairs
            .map(|(key, value)| (key.clone(), one_line(value)))
            .collect()
    };
    for (path, _, scan) in scans("every_line_comes_back") {
        let sensors = spmfile::position_sensors(&scan, spmfile::LineDirection::Trace).is_ok();
        for format in WritableFormat::ALL {
            if format == WritableFormat::Gxyzf && !sensors {
                continue;
            }
            let files = write(&scan, format, "scan", &[]).unwrap();
            if format == WritableFormat::Zarr {
                let (_, group) = files
                    .iter()
                    .find(|(n, _)| n == "scan.zarr/zarr.json")
                    .unwrap();
                let group: serde_json::Value = serde_json::from_slice(group).unwrap();
                for (key, value) in &scan.metadata {
                    assert_eq!(
                        group["attributes"][key],
                        *value,
                        "{}: {key}",
                        path.display()
                    );
                }
                continue;
            }
            for (name, bytes) in files {
                let back = read(&bytes).unwrap();
                assert_eq!(
                    flat(&back.metadata),
                    flat(&scan.metadata),
                    "{} as {name}",
                    path.display()
                );
            }
        }
    }
}
