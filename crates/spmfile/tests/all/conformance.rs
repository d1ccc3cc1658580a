//! Every real file against its truth record, which independent readers made.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use serde_json::Value;
use spmfile::{
    Channel, FrameDirection, LineDirection, ReadError, Samples, Scan, position_sensors, read,
};

use crate::common;

const TRACE: Option<LineDirection> = Some(LineDirection::Trace);
const RETRACE: Option<LineDirection> = Some(LineDirection::Retrace);

fn truth_of(path: &Path) -> Value {
    let mut name = path.as_os_str().to_owned();
    name.push(".truth.json");
    serde_json::from_slice(&common::bytes(Path::new(&name))).expect("truth records are JSON")
}

/// The unit a channel must have and the factor that turns its values into the record's.
///
/// `scale_rule.unit_before_SI` is the unit of the header (`nm/V` stands for `nm`). Lengths were
/// recorded in m; all else in the header's unit, also the millivolts that `unit` calls `V`: the
/// record's `value_per_count` is `hard_value / divisor` with the hard value in mV.
fn unit_and_factor(truth: &Value) -> (String, f64) {
    let header = truth["scale_rule"]["unit_before_SI"]
        .as_str()
        .expect("a unit");
    let unit = header.split('/').next().unwrap_or(header).replace('º', "°");
    let factor = if truth["unit"] == "m" {
        assert_eq!(unit, "nm");
        1e-9
    } else {
        1.0
    };
    (unit, factor)
}

fn direction(text: &Value) -> Option<LineDirection> {
    match text.as_str() {
        Some("Trace") => TRACE,
        Some("Retrace") => RETRACE,
        _ => None,
    }
}

fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{what}: found {found}, expected {expected} within {tolerance:e}"
    );
}

/// Values, statistics, shape and names; `factor` turns our values into the truth's.
fn check_channel(channel: &Channel, truth: &Value, factor: f64, what: &str) {
    let number = |key: &str| {
        truth[key]
            .as_f64()
            .unwrap_or_else(|| panic!("{what}: no {key}"))
    };
    assert_eq!(channel.name, truth["name"], "{what}");
    assert_eq!(channel.internal_name, truth["internal_name"], "{what}");
    assert_eq!(
        channel.line_direction,
        direction(&truth["line_direction"]),
        "{what}"
    );
    if let Some(line) = truth["scan_line"].as_str() {
        assert_eq!(channel.scan_line.as_deref(), Some(line), "{what}");
    }
    let shape = [channel.rows, channel.columns].map(Value::from);
    assert_eq!(truth["shape"], Value::from(shape.to_vec()), "{what}");

    let values = channel.values();
    assert_eq!(values.len(), channel.rows * channel.columns, "{what}");
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let (min, max) = values
        .iter()
        .fold((f64::MAX, f64::MIN), |(a, b), &v| (a.min(v), b.max(v)));
    let tolerance = 1e-6 * (number("max") - number("min"));
    close(min * factor, number("min"), tolerance, what);
    close(max * factor, number("max"), tolerance, what);
    close(mean * factor, number("mean"), tolerance, what);
    close(std * factor, number("std"), tolerance, what);
    let pixels = truth["pixels"].as_array().expect("pixels");
    assert!(!pixels.is_empty());
    for pixel in pixels {
        let at = |i: usize| pixel["display"][i].as_u64().expect("index") as usize;
        let (row, column) = (channel.rows - 1 - at(0), at(1));
        let found = values[row * channel.columns + column] * factor;
        close(
            found,
            pixel["value"].as_f64().expect("value"),
            tolerance,
            what,
        );
    }
    for (key, found) in [
        ("realtime_planefit", "realtime"),
        ("offline_planefit", "offline"),
    ] {
        if let Some(fit) = truth[key].as_str() {
            let told = channel.plane_fit.as_deref().unwrap_or("");
            assert_eq!(
                told.contains(&format!("{fit} ({found})")),
                fit != "None",
                "{what}"
            );
        }
    }
}

fn check_scan(scan: &Scan, truth: &Value, what: &str) {
    let t = &truth["scan"];
    let number = |key: &str| t[key].as_str().and_then(|s| s.parse::<f64>().ok());
    // 0x09700105 is version 9.70.
    let version = t["version"].as_str().expect("version");
    let major: u32 = version[2..4].parse().expect("digits");
    assert_eq!(
        scan.format,
        format!("NanoScope {major}.{}", &version[4..6]),
        "{what}"
    );
    assert!(scan.instrument.is_some(), "{what}");
    assert_eq!(scan.line_rate_hz, number("scan_rate_hz"), "{what}");
    assert_eq!(scan.rounding, number("x_round"), "{what}");
    assert_eq!(Some(scan.rotation_rad), number("rotate_ang"), "{what}");
    assert_eq!(
        scan.closed_loop,
        Some(t["xy_closed_loop"] == "On"),
        "{what}"
    );
    let up_or_down = match truth["channels"][0]["frame_direction"].as_str() {
        Some("Up") => Some(FrameDirection::Up),
        Some("Down") => Some(FrameDirection::Down),
        _ => None,
    };
    assert_eq!(scan.frame_direction, up_or_down, "{what}");
    let size: f64 = t["scan_size"]
        .as_str()
        .and_then(|s| s.strip_suffix(" nm")?.parse().ok())
        .expect("size in nm");
    assert_eq!(scan.size_nm, Some([size, size]), "{what}");

    let date = t["date"].as_str().expect("date");
    let a = scan.acquired.expect("a date");
    let hour = (a.hour + 11) % 12 + 1;
    let half = if a.hour < 12 { "AM" } else { "PM" };
    let clock = format!("{hour:02}:{:02}:{:02} {half}", a.minute, a.second);
    assert!(date.starts_with(&clock), "{what}: {clock} is not in {date}");
    assert!(
        date.ends_with(&format!("{:02} {}", a.day, a.year)),
        "{what}: {date}"
    );
    let months = "JanFebMarAprMayJunJulAugSepOctNovDec";
    let month = &months[3 * usize::from(a.month) - 3..3 * usize::from(a.month)];
    assert!(date.contains(month), "{what}: {date}");
}

/// Reads an `image` file and compares everything; returns the number of channels.
fn check_image(path: &Path, truth: &Value) -> usize {
    let what = path.file_name().unwrap_or_default().to_string_lossy();
    let scan = read(&common::bytes(path)).unwrap_or_else(|e| panic!("{what}: {e}"));
    assert!(scan.unreadable.is_empty(), "{what}: {:?}", scan.unreadable);
    check_scan(&scan, truth, &what);
    let channels = truth["channels"].as_array().expect("channels");
    assert_eq!(scan.channels.len(), channels.len(), "{what}");
    for (channel, t) in scan.channels.iter().zip(channels) {
        let what = format!("{what}: {}", channel.name);
        let number = |key: &str| {
            t[key]
                .as_f64()
                .unwrap_or_else(|| panic!("{what}: no {key}"))
        };
        let (unit, factor) = unit_and_factor(t);
        assert_eq!(channel.unit, unit, "{what}");
        check_channel(channel, t, factor, &what);
        let per_count = number("value_per_count");
        close(
            channel.scale * factor,
            per_count,
            1e-9 * per_count.abs(),
            &what,
        );
        let nm = |key: &str| number(key) * 1e9;
        close(
            channel.width_nm.expect("width"),
            nm("x_size_m"),
            1e-6,
            &what,
        );
        close(
            channel.height_nm.expect("height"),
            nm("y_size_m"),
            1e-6,
            &what,
        );
        let raw = |key: &str| t[key].as_i64().expect("raw count");
        let counts: Vec<i64> = match &channel.samples {
            Samples::I16(v) => v.iter().map(|&c| i64::from(c)).collect(),
            Samples::I32(v) => v.iter().map(|&c| i64::from(c)).collect(),
            other => panic!("{what}: {other:?}"),
        };
        assert_eq!(counts.iter().min(), Some(&raw("raw_min")), "{what}");
        assert_eq!(counts.iter().max(), Some(&raw("raw_max")), "{what}");
    }
    channels.len()
}

/// Files that must be refused, with the reason each of them must give.
fn check_refused(path: &Path, truth: &Value) {
    let what = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let error = read(&common::bytes(path)).expect_err(&what);
    let announced = truth["channels"].as_array().map_or(0, Vec::len);
    let right = match what.as_str() {
        "mm8_v92_force_volume_16x16.spm" => matches!(error, ReadError::ForceVolume),
        "mm8_v92_force_curve.spm" => matches!(error, ReadError::ForceCurve),
        "header_only_v970_lf.spm" | "header_only_v940_lf.spm" => {
            matches!(error, ReadError::HeaderOnly { announced: n, .. } if n == announced)
        }
        "icon_v91_truncated.spm" => check_truncated(&error, truth),
        _ => false,
    };
    assert!(right, "{what}: unexpected reason: {error}");
}

/// The whole channels of the truncated file come with the error, the others by name.
fn check_truncated(error: &ReadError, truth: &Value) -> bool {
    let ReadError::Incomplete { reason, readable } = error else {
        return false;
    };
    assert!(
        reason.contains("Height Sensor") && reason.contains("55170"),
        "{reason}"
    );
    // Its data begin at byte 39969 instead of 40960 (the uncut file's at 40960): the record's values
    // for the other channels are read at the promised place, and the error says what they are worth.
    assert!(reason.contains("991 bytes"), "{reason}");
    let lost: Vec<&str> = readable
        .unreadable
        .iter()
        .map(|u| u.name.as_str())
        .collect();
    assert_eq!(lost, ["Height Sensor", "Height"]);
    let whole: Vec<&Value> = truth["channels"]
        .as_array()
        .expect("channels")
        .iter()
        .filter(|c| c["readable"] == true)
        .collect();
    assert_eq!(whole.len(), readable.channels.len());
    for (channel, t) in readable.channels.iter().zip(whole) {
        // This record is in the unit of the sensitivity line, not in SI.
        check_channel(channel, t, 1.0, &channel.name);
    }
    true
}

#[test]
fn real_files_agree_with_their_truth() {
    let Some(data) = common::testdata("real_files_agree_with_their_truth") else {
        return;
    };
    let (mut images, mut channels, mut refused) = (0, 0, 0);
    let mut paths: Vec<_> = std::fs::read_dir(data.join("real/nanoscope"))
        .expect("a folder")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_none_or(|e| e != "json"))
        .collect();
    paths.sort();
    for path in &paths {
        let truth = truth_of(path);
        let expect = truth["expect"].as_str().expect("expect");
        if expect == "image" {
            channels += check_image(path, &truth);
            images += 1;
        } else {
            assert!(expect.starts_with("refuse"), "{expect}");
            check_refused(path, &truth);
            refused += 1;
        }
    }
    println!("{images} files with {channels} channels agree, {refused} files refused as they must");
    assert_eq!((images, channels, refused), (6, 16, 5));
}

/// The headers without data, filled up with zeros: an unfinished frame, LF line ends, 16-bit labels
/// on 32-bit samples. The heights are those of the folder's description (300 × 209.8 nm).
#[test]
fn unfinished_frames_keep_their_pitch() {
    let Some(data) = common::testdata("unfinished_frames_keep_their_pitch") else {
        return;
    };
    let path = data.join("real/nanoscope/header_only_v970_lf.spm");
    let mut bytes = common::bytes(&path);
    bytes.resize(5_948_480, 0);
    let scan = read(&bytes).expect("whole now");
    assert_eq!(scan.channels.len(), 8);
    let (first, last) = (&scan.channels[0], &scan.channels[7]);
    assert_eq!((first.rows, first.columns, last.rows), (358, 512, 359));
    assert_eq!(scan.size_nm, Some([300.0, 300.0]));
    close(
        first.height_nm.expect("height"),
        300.0 * 358.0 / 512.0,
        1e-9,
        "first",
    );
    close(
        last.height_nm.expect("height"),
        300.0 * 359.0 / 512.0,
        1e-9,
        "last",
    );
    assert_eq!(first.width_nm, Some(300.0));
    assert_eq!(scan.offset_nm, [264.649, 280.272]);
    // Label 2 on 4 stored bytes: the divisor is 2^16.
    assert_eq!(last.scale, 102.3032 / 65536.0 * 5.959_871);
    assert_eq!(last.unit, "nm");
    assert_eq!(scan.channels[4].unit, "V", "Arb × V/Arb");
    assert_eq!(scan.channels[3].unit, "log(Arb)");
    assert_eq!(last.plane_fit.as_deref(), Some("Bow (realtime)"));

    // One byte short, and with LF line ends: bytes are missing everywhere.
    bytes.pop();
    assert!(matches!(
        read(&bytes),
        Err(ReadError::LineEndsChanged { .. })
    ));
}

#[test]
fn simulated_sets_are_read() {
    let Some(data) = common::testdata("simulated_sets_are_read") else {
        return;
    };
    let mut files = 0;
    // The rotation and the sense of the first frame; senses alternate.
    for (set, rotation, first) in [("slow_y", 0.0, 0), ("slow_x", FRAC_PI_2, 1)] {
        let folder = data.join("sets").join(set);
        let truth: Value =
            serde_json::from_slice(&common::bytes(&folder.join("tbg.truth.json"))).expect("JSON");
        for (index, name) in truth["files"].as_array().expect("files").iter().enumerate() {
            let path = folder.join(name.as_str().expect("a name"));
            let scan = read(&common::bytes(&path)).expect("readable");
            let found: Vec<_> = scan
                .channels
                .iter()
                .map(|c| (c.name.as_str(), c.unit.as_str(), c.line_direction))
                .collect();
            let names = [
                ("TR Phase", "°"),
                ("TR Amplitude", "mV"),
                ("Xsensor", "nm"),
                ("Ysensor", "nm"),
            ];
            let expected: Vec<_> = [TRACE, RETRACE]
                .into_iter()
                .flat_map(|line| names.map(|(name, unit)| (name, unit, line)))
                .collect();
            assert_eq!(found, expected);
            assert_eq!(scan.format, "NanoScope 9.70");
            // The header says 1.5708.
            close(scan.rotation_rad, rotation, 5e-6, set);
            assert_eq!(scan.size_nm, Some([70.0, 70.0]));
            assert_eq!(scan.line_rate_hz, truth["rate"].as_f64());
            let direction = [FrameDirection::Up, FrameDirection::Down][(index + first) % 2];
            assert_eq!(scan.frame_direction, Some(direction), "{}", path.display());
            check_extent(&scan, &truth, set);
            files += 1;
        }
    }
    println!("{files} simulated files agree");
    assert_eq!(files, 12);
}

/// The fast sensor spans the simulated extent. Averaged over 256 lines its noise of 0.2 nm leaves
/// 0.02 nm; creep and settling at the line's ends are below 0.3 nm.
fn check_extent(scan: &Scan, truth: &Value, set: &str) {
    for line in [LineDirection::Trace, LineDirection::Retrace] {
        let sensors = position_sensors(scan, line).expect("sensors in nm");
        assert_eq!(sensors.x.line_direction, Some(line));
        let (fast, extent) = match set {
            "slow_y" => (sensors.x, "extent_x"),
            _ => (sensors.y, "extent_y"),
        };
        let values = fast.values();
        let columns = fast.columns;
        let mean_of = |column: usize| {
            values.iter().skip(column).step_by(columns).sum::<f64>() / fast.rows as f64
        };
        let span = mean_of(columns - 1) - mean_of(0);
        close(span, truth[extent].as_f64().expect("extent"), 0.5, set);
    }
}
