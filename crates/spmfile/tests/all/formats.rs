//! Every real file of every format against its record, which independent readers made.
//!
//! Where a record and the reader look at the same thing differently, the difference is named here:
//!
//! - Igor: the record's size is step × N; ours is the `ScanSize` of the note, step × (N − 1), the
//!   distance of the outermost pixel centres. The step is the same.
//! - Units: records are in SI units, NanoScope's and some others are read in the unit of the file
//!   (nm, µm, mV). NanoScope records of millivolts say `V`; `scale_rule.unit_before_SI` is right.
//! - ISO 28632: the record calls the line `Forward`, by the channel's name, and so do we; the
//!   directions in the header are invented by the program that exported it, as it says itself.
//! - Names: readers put the line direction into the name or beside it; compared are both without
//!   it, and the direction wherever the record has one.
//! - Createc: the record has the counts as they are stored; ours are values by the scale.
//! - `createc_partial_11nm.dat` is whole. Its header is 112 bytes shorter than others; the record's reader looks for
//!   the zlib stream at byte 16384 all the same and takes a quarter of the packed bytes for the number of samples.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;
use spmfile::{Channel, DateTime, FrameDirection, LineDirection, ReadError, Scan, nm_per, read};

use crate::common;

fn record_of(path: &Path) -> Value {
    let mut name = path.as_os_str().to_owned();
    name.push(".truth.json");
    serde_json::from_slice(&common::bytes(Path::new(&name))).expect("records are JSON")
}

/// All real files, by folder.
fn real_files(data: &Path) -> Vec<(String, PathBuf)> {
    let entries = |folder: &Path| -> Vec<PathBuf> {
        let read = std::fs::read_dir(folder).expect("a folder");
        let mut paths: Vec<_> = read.map(|e| e.expect("an entry").path()).collect();
        paths.sort();
        paths
    };
    let mut files = Vec::new();
    for folder in entries(&data.join("real")) {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        for path in entries(&folder) {
            if path.extension().is_none_or(|e| e != "json") {
                files.push((name.clone().into_owned(), path));
            }
        }
    }
    files
}

/// Letters and digits in lower case, without the words for line directions.
fn plain(name: &str) -> String {
    let mut plain: String = name
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .map(|c| c.to_ascii_lowercase())
        .collect();
    for word in ["forward", "backward", "retrace", "trace", "left", "right"] {
        plain = plain.replace(word, "");
    }
    plain
}

fn direction(word: Option<&str>) -> Option<LineDirection> {
    match word?.to_ascii_lowercase().as_str() {
        "forward" | "trace" => Some(LineDirection::Trace),
        "backward" | "retrace" => Some(LineDirection::Retrace),
        other => panic!("a direction {other:?}"),
    }
}

/// What our values are multiplied with to be in the record's unit.
fn factor(channel: &Channel, record: &Value) -> Option<f64> {
    let ours = channel.unit.as_str();
    let theirs = match record["scale_rule"]["unit_before_SI"].as_str() {
        Some(unit) if nm_per(unit.split('/').next()?).is_none() => unit.split('/').next()?,
        _ => record["unit"].as_str().unwrap_or(""),
    };
    let sign = |unit: &str| match unit {
        "deg" | "º" => "°".to_owned(),
        other => other.replace('\u{3bc}', "µ"),
    };
    let (ours, theirs) = (sign(ours), sign(theirs));
    if ours == theirs {
        return Some(1.0);
    }
    if let (Some(a), Some(b)) = (nm_per(&ours), nm_per(&theirs)) {
        return Some(a / b);
    }
    let prefixes = [
        ("f", 1e-15),
        ("p", 1e-12),
        ("n", 1e-9),
        ("µ", 1e-6),
        ("m", 1e-3),
        ("k", 1e3),
    ];
    prefixes
        .into_iter()
        .find(|(prefix, _)| ours == format!("{prefix}{theirs}"))
        .map(|(_, factor)| factor)
}

/// Collects what disagrees, so that one run shows everything.
#[derive(Default)]
struct Findings(Vec<String>);

impl Findings {
    fn check(&mut self, right: bool, what: impl FnOnce() -> String) {
        if !right {
            self.0.push(what());
        }
    }

    fn close(&mut self, found: f64, expected: f64, tolerance: f64, what: &str) {
        self.check((found - expected).abs() <= tolerance, || {
            format!("{what}: found {found}, expected {expected} within {tolerance:e}")
        });
    }
}

/// Values, statistics, shape, unit, direction and size.
fn check_channel(folder: &str, channel: &Channel, record: &Value, what: &str, out: &mut Findings) {
    let Some(factor) = factor(channel, record) else {
        let unit = &channel.unit;
        return out.check(false, || {
            format!("{what}: unit {unit:?} for {}", record["unit"])
        });
    };
    let shape = Value::from(vec![channel.rows, channel.columns]);
    if record["shape"] != shape {
        return out.check(false, || {
            format!("{what}: shape {shape} for {}", record["shape"])
        });
    }
    if let Some(word) = record["direction"].as_str() {
        out.check(channel.line_direction == direction(Some(word)), || {
            format!("{what}: {:?} for {word}", channel.line_direction)
        });
    }
    let values: Vec<f64> = channel.values().iter().map(|v| v * factor).collect();
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let missing = (values.len() - finite.len()) as u64;
    let expected = record["n_nan"].as_u64().unwrap_or(0);
    out.check(missing == expected, || {
        format!("{what}: {missing} missing, not {expected}")
    });
    let number = |key: &str| {
        record[key]
            .as_f64()
            .unwrap_or_else(|| panic!("{what}: no {key}"))
    };
    let n = finite.len() as f64;
    let mean = finite.iter().sum::<f64>() / n;
    let std = (finite.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let low = finite.iter().copied().fold(f64::INFINITY, f64::min);
    let high = finite.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // Scales are printed with seven digits or more; a constant channel has no range to measure by.
    let range = number("max") - number("min");
    let tolerance = 1e-6 * range + 1e-9 * number("max").abs();
    for (found, key) in [(low, "min"), (high, "max"), (mean, "mean"), (std, "std")] {
        out.close(found, number(key), tolerance, &format!("{what}: {key}"));
    }
    let pixels = record["pixels"].as_array().expect("pixels");
    out.check(!pixels.is_empty(), || format!("{what}: no pixels"));
    for pixel in pixels {
        let at = |i: usize| pixel["display"][i].as_u64().expect("index") as usize;
        let found = values[(channel.rows - 1 - at(0)) * channel.columns + at(1)];
        match pixel["value"].as_f64() {
            Some(value) => out.close(
                found,
                value,
                tolerance,
                &format!("{what}: pixel {}", pixel["display"]),
            ),
            None => out.check(found.is_nan(), || format!("{what}: {found} is not missing")),
        }
    }
    check_size(folder, channel, record, what, out);
}

fn check_size(folder: &str, channel: &Channel, record: &Value, what: &str, out: &mut Findings) {
    let sides = [
        ("x_size", channel.width_nm, channel.columns),
        ("y_size", channel.height_nm, channel.rows),
    ];
    for (key, found, count) in sides {
        let metres = record[&format!("{key}_m")].as_f64().or_else(|| {
            (record["unit_xy"] == "m")
                .then(|| record[key].as_f64())
                .flatten()
        });
        let what = format!("{what}: {key}");
        match (metres, found) {
            (None, found) => out.check(found.is_none(), || {
                format!("{what}: {found:?} without a unit")
            }),
            (Some(metres), None) => out.check(false, || format!("{what}: none for {metres}")),
            (Some(metres), Some(nm)) => {
                // Igor: see the head of this file.
                let of_igor = if folder == "ibw" {
                    count as f64 / (count as f64 - 1.0)
                } else {
                    1.0
                };
                out.close(nm * of_igor, metres * 1e9, 1e-6 * metres * 1e9, &what);
            }
        }
    }
}

/// Every record has its channel and every channel its record; returns their number.
fn check_channels(
    folder: &str,
    scan: &Scan,
    record: &Value,
    what: &str,
    out: &mut Findings,
) -> usize {
    let records = record["channels"].as_array().expect("channels");
    out.check(scan.channels.len() == records.len(), || {
        let names: Vec<&str> = scan.channels.iter().map(|c| c.name.as_str()).collect();
        format!(
            "{what}: {} channels for {}: {names:?}",
            scan.channels.len(),
            records.len()
        )
    });
    out.check(scan.unreadable.is_empty(), || {
        format!("{what}: {:?}", scan.unreadable)
    });
    let mut taken = vec![false; scan.channels.len()];
    for t in records {
        let name = t["name"].as_str().expect("a name");
        let line = t["direction"].as_str().or(t["line_direction"].as_str());
        let turned = |c: &Channel| match (line, name) {
            (Some(word), _) => c.line_direction == direction(Some(word)),
            // RHK: the line from the left is the trace.
            (None, name) if name.ends_with("[Right]") => {
                c.line_direction == Some(LineDirection::Trace)
            }
            (None, name) if name.ends_with("[Left]") => {
                c.line_direction == Some(LineDirection::Retrace)
            }
            _ => true,
        };
        let same = |c: &Channel| folder == "array" || plain(&c.name) == plain(name);
        let place = (0..taken.len()).find(|&i| {
            let channel = &scan.channels[i];
            !taken[i] && same(channel) && turned(channel)
        });
        let Some(place) = place else {
            out.check(false, || format!("{what}: no channel {name:?} {line:?}"));
            continue;
        };
        taken[place] = true;
        let what = format!("{what}: {name} {}", line.unwrap_or(""));
        check_channel(folder, &scan.channels[place], t, &what, out);
    }
    records.len()
}

/// The frame of a Nanonis file: its record is a plain decoding of the header.
fn check_nanonis(scan: &Scan, record: &Value, what: &str, out: &mut Findings) {
    let t = &record["scan"];
    let number = |key: &str| t[key].as_f64().expect("a number");
    // Clockwise in the file.
    out.close(
        scan.rotation_rad,
        -number("scan_angle_deg").to_radians(),
        1e-9,
        what,
    );
    let times = scan.line_times_s.unwrap_or([f64::NAN; 2]);
    out.close(times[0], number("line_time_forward_s"), 1e-12, what);
    out.close(times[1], number("line_time_backward_s"), 1e-12, what);
    let rate = scan.line_rate_hz.unwrap_or(f64::NAN);
    out.close(rate, number("line_rate_hz"), 1e-12, what);
    for axis in 0..2 {
        let metres = |key: &str| t[key][axis].as_f64().expect("a number");
        out.close(
            scan.offset_nm[axis],
            metres("scan_offset_m") * 1e9,
            1e-6,
            what,
        );
        let size = scan.size_nm.map_or(f64::NAN, |size| size[axis]);
        out.close(size, metres("scan_range_m") * 1e9, 1e-9, what);
    }
    let up = match scan.frame_direction {
        Some(FrameDirection::Up) => "up",
        Some(FrameDirection::Down) => "down",
        None => "",
    };
    out.check(t["scan_dir"] == up, || {
        format!("{what}: {up:?} for {}", t["scan_dir"])
    });
    // The record has the start, the scan its end.
    let start = format!(
        "{} {}",
        t["date"].as_str().unwrap_or(""),
        t["time"].as_str().unwrap_or("")
    );
    let digits: Vec<i64> = start
        .split(['.', ':', ' '])
        .filter_map(|n| n.parse().ok())
        .collect();
    if let ([_, month, year, hour, minute, second], Some(end)) = (&digits[..], scan.acquired) {
        let duration = number("acq_time_s");
        let seconds = |h: i64, m: i64, s: i64| h * 3600 + m * 60 + s;
        let DateTime {
            hour: h,
            minute: m,
            second: s,
            ..
        } = end;
        let passed = seconds(h.into(), m.into(), s.into()) - seconds(*hour, *minute, *second);
        out.close(
            passed.rem_euclid(86_400) as f64,
            duration,
            1.0,
            &format!("{what}: date"),
        );
        out.check(
            i64::from(end.year) == *year && i64::from(end.month) == *month,
            || format!("{what}: {end:?}"),
        );
    } else {
        out.check(false, || {
            format!("{what}: date {:?} for {start}", scan.acquired)
        });
    }
}

/// The frame of an Asylum file, by the note that `igor2` found.
fn check_asylum(scan: &Scan, record: &Value, what: &str, out: &mut Findings) {
    let t = &record["scan"];
    let Some(size) = t["FastScanSize"].as_str() else {
        out.check(
            scan.line_rate_hz.is_none() && scan.frame_direction.is_none(),
            || format!("{what}: a frame without a note"),
        );
        return;
    };
    let metres: f64 = size.parse().expect("a number");
    out.close(
        scan.size_nm.map_or(f64::NAN, |s| s[0]),
        metres * 1e9,
        1e-6,
        what,
    );
    let rate = t["ScanRate"]
        .as_str()
        .and_then(|s| s.split('@').next()?.parse().ok());
    out.check(scan.line_rate_hz == rate, || {
        format!("{what}: rate {:?}", scan.line_rate_hz)
    });
    out.check(scan.frame_direction == Some(FrameDirection::Up), || {
        format!("{what}: direction")
    });
    out.check(scan.closed_loop == Some(true), || format!("{what}: loop"));
    out.check(scan.rotation_rad == 0.0, || format!("{what}: angle"));
}

/// The counts of a Createc file, where the record has them, and what its header tells; returns the number of channels.
fn check_createc(scan: &Scan, record: &Value, what: &str, out: &mut Findings) -> usize {
    let metadata = |key: &str| {
        let found = scan.metadata.iter().find(|(k, _)| k == key);
        let (_, value) = found.unwrap_or_else(|| panic!("{what}: no {key}"));
        value.parse::<f64>().expect("a number")
    };
    let told: Vec<_> = scan
        .channels
        .iter()
        .map(|c| (&*c.name, &*c.unit, c.line_direction))
        .collect();
    let [trace, retrace] = [LineDirection::Trace, LineDirection::Retrace].map(Some);
    let expected = [
        ("Topography", "nm", trace),
        ("Current", "A", trace),
        ("Topography", "nm", retrace),
        ("Current", "A", retrace),
    ];
    out.check(told == expected, || format!("{what}: {told:?}"));
    for (channel, t) in scan
        .channels
        .iter()
        .zip(record["channels"].as_array().into_iter().flatten())
    {
        let what = format!("{what}: {} {:?}", channel.name, channel.line_direction);
        check_counts(channel, t, &what, out);
    }
    for (axis, key) in ["Length x[A]", "Length y[A]"].into_iter().enumerate() {
        let found = scan.size_nm.map_or(f64::NAN, |size| size[axis]);
        let stated = record["size_as_read_angstrom"][axis].as_f64();
        out.close(found, stated.unwrap_or(metadata(key)) / 10.0, 1e-9, what);
    }
    let stated = |key: &str, of_file: f64| record[key].as_f64().unwrap_or(of_file);
    out.close(
        scan.rotation_rad.to_degrees(),
        stated("rotation_deg", 0.0),
        1e-12,
        what,
    );
    let bias = metadata("Biasvolt[mV]");
    out.close(bias, stated("bias_mV", bias), 0.0, what);
    out.check(scan.frame_direction == Some(FrameDirection::Down), || {
        format!("{what}: {:?}", scan.frame_direction)
    });
    // The header has it in ms.
    let times = scan.line_times_s.unwrap_or([f64::NAN; 2]);
    out.close(times[0], metadata("Sec/line:"), 5e-4, what);
    out.close(times[1], metadata("Sec/line:"), 5e-4, what);
    // The scale of the current: the feedback kept it at the set point (pA), and it has the sign of the bias.
    for current in scan.channels.iter().filter(|c| c.name == "Current") {
        let mut values = current.values();
        values.sort_by(f64::total_cmp);
        let set_point = metadata("FBLogIset") * 1e-12 * bias.signum();
        let median = values[values.len() / 2];
        out.close(
            median,
            set_point,
            0.02 * set_point.abs(),
            &format!("{what}: median"),
        );
    }
    // The volts of a count: the step in x by converter, gain and piezo is that of the size, but for 2 of 65536.
    let volts = metadata("Length x[A]")
        / (metadata("Num.X / Num.X")
            * metadata("Delta X / Delta X [Dac]")
            * metadata("GainX / GainX")
            * metadata("Xpiezoconst"));
    out.close(volts * 1_048_576.0, 20.0, 1e-3, &format!("{what}: volts"));
    if record["channels"].is_null() {
        check_partial(scan, what, out);
    }
    scan.channels.len()
}

/// The file without counts in its record: least, greatest and mean ones of a plain decoding with the zlib of Python.
fn check_partial(scan: &Scan, what: &str, out: &mut Findings) {
    let plain = [
        [-117_780.875, -116_274.0, -117_039.563_979],
        [-19_030.937_5, -12_433.343_75, -15_800.010_489],
        [-117_784.468_75, -116_278.0, -117_042.637_453],
        [-19_729.5, -12_584.875, -15_809.245_942],
    ];
    for (channel, expected) in scan.channels.iter().zip(plain) {
        let counts: Vec<f64> = channel.values().iter().map(|v| v / channel.scale).collect();
        let low = counts.iter().copied().fold(f64::INFINITY, f64::min);
        let high = counts.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = counts.iter().sum::<f64>() / counts.len() as f64;
        for (found, expected) in [low, high, mean].into_iter().zip(expected) {
            out.close(found, expected, 1e-5, &format!("{what}: {}", channel.name));
        }
    }
}

/// The counts of a channel against those of the record, whose row 0 is the top one.
fn check_counts(channel: &Channel, record: &Value, what: &str, out: &mut Findings) {
    let shape = Value::from(vec![channel.rows, channel.columns]);
    out.check(record["shape"] == shape, || {
        format!("{what}: shape {shape}")
    });
    let counts: Vec<f64> = channel.values().iter().map(|v| v / channel.scale).collect();
    let number = |key: &str| record[key].as_f64().expect("a number");
    let n = counts.len() as f64;
    let mean = counts.iter().sum::<f64>() / n;
    let std = (counts.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let low = counts.iter().copied().fold(f64::INFINITY, f64::min);
    let high = counts.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // Mean and deviation of the record are sums in single precision.
    for (found, key, tolerance) in [
        (low, "min", 1e-6),
        (high, "max", 1e-6),
        (mean, "mean", 1e-2),
        (std, "std", 1e-2),
    ] {
        out.close(found, number(key), tolerance, &format!("{what}: {key}"));
    }
    let pixels = record["pixels"].as_array().expect("pixels");
    out.check(!pixels.is_empty(), || format!("{what}: no pixels"));
    for pixel in pixels {
        let at = |key: &str| pixel[key].as_u64().expect("index") as usize;
        let found = counts[(channel.rows - 1 - at("row")) * channel.columns + at("column")];
        let value = pixel["value"].as_f64().expect("a number");
        out.close(found, value, 1e-6, &format!("{what}: pixel {pixel}"));
    }
}

/// Whether a file is refused for the reason it must be.
fn refused_rightly(file: &str, error: &ReadError) -> bool {
    let words = error.to_string();
    match file {
        "mm8_v92_force_volume_16x16.spm" => matches!(error, ReadError::ForceVolume),
        "mm8_v92_force_curve.spm" | "jpk_force_curve.jpk-force" => {
            matches!(error, ReadError::ForceCurve)
        }
        "header_only_v970_lf.spm" | "header_only_v940_lf.spm" => {
            matches!(error, ReadError::HeaderOnly { .. })
        }
        "icon_v91_truncated.spm" => matches!(error, ReadError::Incomplete { .. }),
        "aborted_all_nan.sxm" => matches!(error, ReadError::AllMissing { channels: 20 }),
        "wave_1d_v2_big.ibw" | "wave_1d_v5_little.ibw" => {
            matches!(error, ReadError::Unsupported { .. }) && words.contains("wave of 5 points")
        }
        _ => false,
    }
}

#[test]
fn real_files_of_every_format_agree_with_their_records() {
    let Some(data) = common::testdata("real_files_of_every_format_agree_with_their_records") else {
        return;
    };
    let mut out = Findings::default();
    // Images, channels and refused files by folder.
    let mut counts: BTreeMap<String, [usize; 3]> = BTreeMap::new();
    for (folder, path) in real_files(&data) {
        let file = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let record = record_of(&path);
        let expect = record["expect"].as_str().unwrap_or("read");
        let found = read(&common::bytes(&path));
        let count = counts.entry(folder.clone()).or_default();
        match found {
            Ok(scan) if !expect.starts_with("refuse") => {
                let channels = match folder.as_str() {
                    "createc" => check_createc(&scan, &record, &file, &mut out),
                    _ => check_channels(&folder, &scan, &record, &file, &mut out),
                };
                match folder.as_str() {
                    "nanonis" => check_nanonis(&scan, &record, &file, &mut out),
                    "ibw" => check_asylum(&scan, &record, &file, &mut out),
                    _ => {}
                }
                count[0] += 1;
                count[1] += channels;
            }
            Ok(_) => out.check(false, || format!("{file}: read, but {expect}")),
            Err(error) if expect.starts_with("refuse") => {
                out.check(refused_rightly(&file, &error), || {
                    format!("{file}: {error}")
                });
                count[2] += 1;
            }
            Err(error) => out.check(false, || format!("{file}: {error}")),
        }
    }
    let mut sum = [0; 3];
    for (folder, count) in &counts {
        println!(
            "{folder}: {} files with {} channels, {} files refused as they must",
            count[0], count[1], count[2]
        );
        for (total, n) in sum.iter_mut().zip(count) {
            *total += n;
        }
    }
    println!(
        "{} files with {} channels agree, {} files refused as they must",
        sum[0], sum[1], sum[2]
    );
    assert!(
        out.0.is_empty(),
        "{} disagreements:\n{}",
        out.0.len(),
        out.0.join("\n")
    );
    assert_eq!(sum, [28, 130, 9]);
}

/// The scan that Gwyddion saved again gives the numbers of the original.
#[test]
fn a_converted_file_gives_the_same_numbers() {
    let Some(data) = common::testdata("a_converted_file_gives_the_same_numbers") else {
        return;
    };
    let open = |name: &str| read(&common::bytes(&data.join("real").join(name))).expect("a scan");
    let original = open("nanoscope/icon_v91_tapping_4ch.spm");
    let converted = open("gwy/icon_v91_by_gwyddion.gwy");
    assert_eq!(original.channels.len(), converted.channels.len());
    for (a, b) in original.channels.iter().zip(&converted.channels) {
        let nm = [&a.unit, &b.unit].map(|unit| nm_per(unit));
        let factor = match nm {
            [Some(a), Some(b)] => a / b,
            // Gwyddion took millivolts for volts: see the head of this file.
            _ => 1.0,
        };
        let (left, right) = (a.values(), b.values());
        let range = right.iter().fold(0f64, |range, v| range.max(v.abs()));
        let worst = left
            .iter()
            .zip(&right)
            .fold(0f64, |worst, (x, y)| worst.max((x * factor - y).abs()));
        assert!(worst <= 1e-6 * range, "{}: {worst} of {range}", a.name);
        let width = [a.width_nm, b.width_nm].map(|w| w.expect("a width"));
        assert!((width[0] - width[1]).abs() < 1e-6 * width[0]);
    }
}
