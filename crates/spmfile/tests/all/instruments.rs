//! Real files of JPK, Nanosurf, Park, RHK and Agilent instruments and a plain array against their
//! truth records, and what the records do not hold: frame, directions and times, from the headers.

use std::path::Path;

use serde_json::Value;
use spmfile::arrays::{self, ArrayOptions};
use spmfile::{Channel, FrameDirection, LineDirection, ReadError, Scan, nm_per, read};

use crate::common;

const TRACE: Option<LineDirection> = Some(LineDirection::Trace);
const RETRACE: Option<LineDirection> = Some(LineDirection::Retrace);

fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{what}: found {found}, expected {expected} within {tolerance:e}"
    );
}

fn truth(path: &Path) -> Value {
    let mut name = path.as_os_str().to_owned();
    name.push(".truth.json");
    serde_json::from_slice(&common::bytes(Path::new(&name))).expect("truth records are JSON")
}

/// The factor that turns a channel's values into the record's, which are in SI units.
fn factor(channel: &Channel, unit: &Value, what: &str) -> f64 {
    match unit.as_str() {
        Some("m") => nm_per(&channel.unit).expect("a length") * 1e-9,
        Some(unit) => {
            assert_eq!(channel.unit, unit, "{what}");
            1.0
        }
        None => {
            assert_eq!(channel.unit, "", "{what}");
            1.0
        }
    }
}

fn check_channel(channel: &Channel, truth: &Value, what: &str) {
    let number = |key: &str| truth[key].as_f64().expect("a number");
    let shape = [channel.rows, channel.columns].map(Value::from);
    assert_eq!(truth["shape"], Value::from(shape.to_vec()), "{what}");
    let factor = factor(channel, &truth["unit"], what);
    let values: Vec<f64> = channel.values().iter().map(|v| v * factor).collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let (min, max) = values
        .iter()
        .fold((f64::MAX, f64::MIN), |(a, b), &v| (a.min(v), b.max(v)));
    // Records of single-precision factors carry seven digits.
    let tolerance = 1e-6 * (max - min) + 1e-7 * max.abs();
    close(min, number("min"), tolerance, what);
    close(max, number("max"), tolerance, what);
    close(mean, number("mean"), tolerance, what);
    close(std, number("std"), tolerance, what);
    for pixel in truth["pixels"].as_array().expect("pixels") {
        let at = |i: usize| pixel["display"][i].as_u64().expect("index") as usize;
        let found = values[(channel.rows - 1 - at(0)) * channel.columns + at(1)];
        close(
            found,
            pixel["value"].as_f64().expect("value"),
            tolerance,
            what,
        );
    }
    let sizes = [("x_size", channel.width_nm), ("y_size", channel.height_nm)];
    for (key, found) in sizes {
        match truth[key].as_f64() {
            Some(metres) => close(
                found.expect("a size"),
                metres * 1e9,
                1e-6 * metres * 1e9,
                what,
            ),
            None => assert_eq!(found, None, "{what}"),
        }
    }
}

/// Reads a file and compares all its channels with the record.
fn check(path: &Path) -> Scan {
    let what = path.file_name().unwrap_or_default().to_string_lossy();
    let scan = read(&common::bytes(path)).unwrap_or_else(|e| panic!("{what}: {e}"));
    assert!(scan.unreadable.is_empty(), "{what}: {:?}", scan.unreadable);
    let truth = truth(path);
    let channels = truth["channels"].as_array().expect("channels");
    assert_eq!(scan.channels.len(), channels.len(), "{what}");
    for (channel, truth) in scan.channels.iter().zip(channels) {
        check_channel(channel, truth, &format!("{what}: {}", channel.name));
    }
    scan
}

fn named(scan: &Scan) -> Vec<(&str, Option<LineDirection>)> {
    let channels = scan.channels.iter();
    channels
        .map(|c| (c.name.as_str(), c.line_direction))
        .collect()
}

#[test]
fn jpk() {
    let Some(data) = common::testdata("jpk") else {
        return;
    };
    let folder = data.join("real/jpk");
    let scan = check(&folder.join("jpk_image_10ch.jpk"));
    let names = [
        "Height",
        "Height (measured)",
        "Lock-In Amplitude",
        "Lock-In Phase",
        "Error Signal",
    ];
    let expected: Vec<_> = [RETRACE, TRACE]
        .into_iter()
        .flat_map(|line| names.map(|name| (name, line)))
        .collect();
    assert_eq!(named(&scan), expected);
    assert_eq!(scan.frame_direction, Some(FrameDirection::Up));
    assert_eq!(scan.line_rate_hz, Some(4.0));
    let [trace, retrace] = scan.line_times_s.expect("times");
    close(trace, 0.881_020_8 / 8.0, 1e-12, "trace");
    assert_eq!(trace, retrace);
    close(
        scan.rotation_rad,
        std::f64::consts::FRAC_PI_2,
        1e-12,
        "rotation",
    );
    // From its corner (2584.46, 1622.91) nm half a frame of 326.92 nm along y and along −x.
    close(scan.offset_nm[0], 2584.465 - 163.458, 1e-3, "offset");
    close(scan.offset_nm[1], 1622.909 + 163.458, 1e-3, "offset");
    let a = scan.acquired.expect("a date");
    assert_eq!(
        (a.year, a.month, a.day, a.hour, a.minute, a.second),
        (2017, 1, 16, 16, 1, 36)
    );

    let curve = read(&common::bytes(&folder.join("jpk_force_curve.jpk-force")));
    assert!(matches!(curve, Err(ReadError::ForceCurve)));
}

#[test]
fn nanosurf() {
    let Some(data) = common::testdata("nanosurf") else {
        return;
    };
    let scan = check(&data.join("real/nid/nanosurf_10um.nid"));
    let expected = [
        ("Z-Axis", TRACE),
        ("Amplitude", TRACE),
        ("Z-Axis", RETRACE),
        ("Amplitude", RETRACE),
    ];
    assert_eq!(named(&scan), expected);
    assert_eq!(scan.frame_direction, Some(FrameDirection::Up));
    assert_eq!(scan.line_times_s, Some([1.0, 1.0]));
    assert_eq!((scan.rotation_rad, scan.offset_nm), (0.0, [0.0, 0.0]));
}

#[test]
fn park() {
    let Some(data) = common::testdata("park") else {
        return;
    };
    let folder = data.join("real/park");
    let scan = check(&folder.join("park_topography_2500nm.tiff"));
    assert_eq!(named(&scan), [("Topography", TRACE)]);
    assert_eq!(scan.frame_direction, Some(FrameDirection::Down));
    close(scan.line_rate_hz.expect("a rate"), 1.246_83, 1e-5, "rate");
    assert_eq!(scan.size_nm, Some([2500.0, 2500.0]));
    assert_eq!(scan.offset_nm, [3750.0, -1750.0]);
    check(&folder.join("park_force_reference_image.tiff"));
}

#[test]
fn rhk() {
    let Some(data) = common::testdata("rhk") else {
        return;
    };
    let scan = check(&data.join("real/rhk/rhk_atomic_1nm.sm4"));
    let expected: Vec<_> = ["LIA Current", "Current", "Topography"]
        .into_iter()
        .flat_map(|name| [(name, RETRACE), (name, TRACE)])
        .collect();
    assert_eq!(named(&scan), expected);
    assert_eq!(scan.frame_direction, Some(FrameDirection::Down));
    close(scan.rotation_rad, 10f64.to_radians(), 1e-9, "rotation");
    // 256 samples of 1/512 s.
    assert_eq!(scan.line_times_s, Some([0.5, 0.5]));
    assert_eq!(scan.line_rate_hz, Some(1.0));
    close(scan.offset_nm[0], -12.814, 1e-3, "offset");
}

#[test]
fn agilent() {
    let Some(data) = common::testdata("agilent") else {
        return;
    };
    let scan = check(&data.join("real/mi/agilent_20um.mi"));
    let expected = [
        ("Topography", TRACE),
        ("Deflection", TRACE),
        ("Friction", TRACE),
        ("Friction", RETRACE),
    ];
    assert_eq!(named(&scan), expected);
    assert_eq!(scan.frame_direction, Some(FrameDirection::Up));
    close(scan.line_rate_hz.expect("a rate"), 2.012_88, 1e-5, "rate");
}

#[test]
fn array() {
    let Some(data) = common::testdata("array") else {
        return;
    };
    let path = data.join("real/array/simulated_twisted_graphene_128.npy");
    check(&path);
    let options = ArrayOptions {
        size_nm: Some([12.0, 12.0]),
        ..ArrayOptions::default()
    };
    let scan = arrays::read(&common::bytes(&path), &options, &|_| true).expect("an array");
    assert_eq!(scan.channels[0].width_nm, Some(12.0));
}
