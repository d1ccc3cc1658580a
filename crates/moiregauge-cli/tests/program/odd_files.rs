//! Files as laboratories have them and nobody expects them: turned frames, dead channels, frames of a few lines,
//! sizes in other units.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix2, Vector2};
use serde_json::Value;

use crate::common::{analyze, caveats, estimate, program, results, run, succeed};

const PIXELS: usize = 96;
const SIZE_NM: f64 = 60.0;
const LINE_TIME_S: f64 = 0.25;
/// Drift, nm/min.
const DRIFT: [f64; 2] = [0.4, -0.25];

/// Real-space vectors of the sample, nm.
fn lattice() -> Matrix2<f64> {
    Matrix2::new(12.6, 5.9, 1.1, 11.4)
}

/// What the sample shows at a position (nm) and time (s): three cosines that move with the drift.
fn seen(at: Vector2<f64>, time: f64) -> f64 {
    let moved = at - Vector2::from(DRIFT) / 60.0 * time;
    let dual = lattice().try_inverse().expect("an area").transpose();
    let (k1, k2) = (dual.column(0), dual.column(1));
    [k1.dot(&moved), k2.dot(&moved), (k1 + k2).dot(&moved)]
        .map(|cycles| (std::f64::consts::TAU * cycles).cos())
        .iter()
        .sum()
}

/// Noise from a place: enough of it that errors are errors.
fn noise(n: usize) -> f64 {
    let mut z = (n as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z >> 11) as f64 / (1u64 << 53) as f64 - 0.5
}

/// One Nanonis frame, turned clockwise by `angle` degrees: a constant Z and a current that shows the lattice,
/// forward and backward.
struct Frame {
    angle: f64,
    up: bool,
    lines: usize,
    /// Start, s after midnight.
    start: u32,
}

impl Frame {
    fn bytes(&self) -> Vec<u8> {
        let duration = 2.0 * LINE_TIME_S * self.lines as f64;
        let height = SIZE_NM * self.lines as f64 / PIXELS as f64;
        let clock = |s: u32| format!("{:02}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
        let mut bytes = format!(
            ":NANONIS_VERSION:\n2\n:SCANIT_TYPE:\n  FLOAT   MSBFIRST\n:REC_DATE:\n 01.02.2024\n\
             :REC_TIME:\n{}\n:ACQ_TIME:\n  {duration}\n:SCAN_PIXELS:\n  {PIXELS}  {}\n:SCAN_TIME:\n \
             {LINE_TIME_S} {LINE_TIME_S}\n:SCAN_RANGE:\n {SIZE_NM}E-9 {height}E-9\n:SCAN_OFFSET:\n 0 0\n\
             :SCAN_ANGLE:\n {}\n:SCAN_DIR:\n{}\n:DATA_INFO:\n\tChannel\tName\tUnit\tDirection\n\
             \t0\tCurrent\tA\tboth\n\t14\tZ\tm\tboth\n\n:SCANIT_END:\n\n\n",
            clock(self.start),
            self.lines,
            self.angle,
            if self.up { "up" } else { "down" },
        )
        .into_bytes();
        bytes.extend([0x1a, 0x04]);
        let (sin, cos) = (-self.angle.to_radians()).sin_cos();
        let pitch = SIZE_NM / PIXELS as f64;
        let mut number = self.start as usize;
        for backward in [false, true] {
            for line in 0..self.lines {
                let row = if self.up { line } else { self.lines - 1 - line };
                for sample in 0..PIXELS {
                    let column = if backward {
                        PIXELS - 1 - sample
                    } else {
                        sample
                    };
                    let share =
                        (sample as f64 + 0.5) / PIXELS as f64 + f64::from(u8::from(backward));
                    let time = f64::from(self.start) + LINE_TIME_S * (2.0 * line as f64 + share);
                    let x = pitch * (column as f64 + 0.5) - SIZE_NM / 2.0;
                    let y = pitch * (row as f64 + 0.5) - height / 2.0;
                    let at = Vector2::new(cos * x - sin * y, sin * x + cos * y);
                    number += 1;
                    let value = 1e-10 * (seen(at, time) + noise(number));
                    bytes.extend((value as f32).to_be_bytes());
                }
            }
        }
        let z = [3e-8f32; 2 * PIXELS];
        bytes.extend(z.repeat(self.lines).into_iter().flat_map(f32::to_be_bytes));
        bytes
    }
}

/// Four frames, up and down in turn.
fn frames(folder: &Path, angle: f64) -> PathBuf {
    for i in 0..4 {
        let frame = Frame {
            angle,
            up: i % 2 == 0,
            lines: PIXELS,
            start: 36_000 + 50 * i,
        };
        let path = folder.join(format!("scan_{i:03}.sxm"));
        std::fs::write(path, frame.bytes()).expect("writable");
    }
    folder.to_owned()
}

/// Every vector of the sample is one of those found, within four σ and 0.3 %.
fn shows_the_lattice(vectors: &Value) {
    let found: Vec<(f64, f64, f64, f64)> = (0..3)
        .map(|i| {
            let part = |name: &str| {
                let number = vectors[i][name].as_f64();
                number.unwrap_or_else(|| panic!("no {name} in {vectors}"))
            };
            let (length, sigma) = estimate(&vectors[i], "/wavelength_nm");
            (part("x_nm"), part("y_nm"), length, sigma)
        })
        .collect();
    let basis = lattice();
    for wanted in [basis.column(0).into_owned(), basis.column(1).into_owned()] {
        let near = found.iter().any(|&(x, y, length, sigma)| {
            let off = |sign: f64| (Vector2::new(x, y) * sign - wanted).norm();
            let most = (4.0 * 1.5 * sigma).min(0.003 * length);
            off(1.0).min(off(-1.0)) < most
        });
        assert!(near, "{wanted:?} in {found:?}");
    }
}

/// A frame turned by any angle shows the same sample: lattice and drift come out in laboratory axes, from up and down
/// scans of Nanonis; in the axes of the image the vectors are turned.
#[test]
fn turned_frames() {
    for angle in [0.0, 33.0, 135.0, -60.0] {
        let work = tempfile::tempdir().expect("a folder");
        let scans = frames(work.path(), angle);
        let out = work.path().join("out");
        succeed(&mut analyze(&scans, &out));
        let found = results(&out);
        let set = &found["sets"][0];
        assert_eq!(set["scans"].as_array().map(Vec::len), Some(4), "{angle}°");
        assert_eq!(set["channel"], "Current");
        shows_the_lattice(&set["mean"]["vectors"]);
        for (pointer, truth) in [
            ("/drift/x_nm_per_min", DRIFT[0]),
            ("/drift/y_nm_per_min", DRIFT[1]),
        ] {
            let (value, sigma) = estimate(set, pointer);
            assert!(
                (value - truth).abs() < 4.0 * sigma && sigma < 0.1,
                "{angle}°: {value} ± {sigma}"
            );
        }
        assert_eq!(caveats(&found).contains(&"frame-turned"), angle != 0.0);
        let image_axes = work.path().join("image-axes");
        succeed(analyze(&scans, &image_axes).args(["--rotation", "0", "--rotate-to-lab"]));
        let turned = results(&image_axes);
        let length = |results: &Value, i: usize| {
            estimate(&results["sets"][0]["mean"]["vectors"][i], "/wavelength_nm").0
        };
        let mut lengths = [&found, &turned].map(|r| [0, 1, 2].map(|i| length(r, i)));
        for list in &mut lengths {
            list.sort_by(f64::total_cmp);
        }
        for (a, b) in lengths[0].iter().zip(lengths[1]) {
            assert!((a - b).abs() < 0.01, "{lengths:?}");
        }
    }
}

/// A channel without a change in it is no reason to fail: the others are analysed, and where the user wants just this
/// one, he is told.
#[test]
fn constant_channels() {
    let work = tempfile::tempdir().expect("a folder");
    let scans = frames(work.path(), 0.0);
    let one = scans.join("scan_000.sxm");
    let failed = run(analyze(&one, &work.path().join("z")).args(["--channel", "Z"]));
    assert_eq!(failed.code, Some(1));
    assert!(failed.stderr.contains("constant"), "{}", failed.stderr);
    let info = succeed(program().arg("info").arg(&one));
    assert!(info.stdout.contains("Current"), "{}", info.stdout);
    // Without another channel that shows anything, every one has been tried.
    let dead = Frame {
        angle: 0.0,
        up: true,
        lines: PIXELS,
        start: 0,
    };
    let mut bytes = dead.bytes();
    let images = bytes.len() - 4 * 4 * PIXELS * PIXELS;
    bytes[images..].fill(0);
    let path = work.path().join("dead.sxm");
    std::fs::write(&path, bytes).expect("writable");
    let failed = run(&mut analyze(&path, &work.path().join("dead")));
    assert_eq!(failed.code, Some(1));
    assert!(failed.stderr.contains("constant"), "{}", failed.stderr);
}

/// Frames of 8 lines are read, described and converted; for a lattice they are too small, and that is said.
#[test]
fn frames_of_eight_lines() {
    let work = tempfile::tempdir().expect("a folder");
    let path = work.path().join("eight.sxm");
    let frame = Frame {
        angle: 33.0,
        up: false,
        lines: 8,
        start: 100,
    };
    std::fs::write(&path, frame.bytes()).expect("writable");
    let info = succeed(program().arg("info").arg(&path));
    assert!(info.stdout.contains("8 × 96"), "{}", info.stdout);
    let failed = run(&mut analyze(&path, &work.path().join("out")));
    assert_eq!(failed.code, Some(1));
    assert!(failed.stderr.contains("96 × 8 pixels"), "{}", failed.stderr);
    for name in ["a.gwy", "a.npz", "a.tiff"] {
        let out = work.path().join(name);
        succeed(program().arg("convert").arg(&path).arg(&out));
        let bytes = std::fs::read(&out).expect("written");
        let scan = spmfile::read(&bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(scan.channels.iter().all(|c| (c.rows, c.columns) == (8, 96)));
    }
    let turned = work.path().join("turned.gwy");
    let mut convert = program();
    convert.arg("convert").args([&path, &turned]);
    succeed(convert.arg("--rotate-to-lab"));
}

/// A `WSxM` image whose sizes are in µm, as its converters write them, here and there with a Greek µ or none.
#[test]
fn micrometres_of_wsxm() {
    let work = tempfile::tempdir().expect("a folder");
    for (name, unit, encoded) in [
        ("windows.stp", "\u{b5}m", b"\xb5m".to_vec()),
        ("utf8.stp", "\u{b5}m", "\u{b5}m".into()),
        ("greek.stp", "\u{3bc}m", "\u{3bc}m".into()),
        ("plain.stp", "um", b"um".to_vec()),
    ] {
        let size = SIZE_NM * 1e-3;
        let text = |unit: &[u8]| {
            let before = format!(
                "WSxM file copyright UAM\r\nSxM Image file\r\nImage header size: 0\r\n\r\n[Control]\r\n\r\n    \
                 X Amplitude: {size} "
            );
            let between = format!("\r\n    Y Amplitude: {size} ");
            let after = format!(
                "\r\n\r\n[General Info]\r\n\r\n    Acquisition channel: Topography\r\n    Image Data Type: \
                 double\r\n    Number of columns: {PIXELS}\r\n    Number of rows: {PIXELS}\r\n    Z Amplitude: 5 nm\r\n\
                 \r\n[Header end]\r\n"
            );
            [
                before.as_bytes(),
                unit,
                between.as_bytes(),
                unit,
                after.as_bytes(),
            ]
            .concat()
        };
        let mut bytes = text(&encoded);
        let pitch = SIZE_NM / PIXELS as f64;
        for row in 0..PIXELS {
            for sample in 0..PIXELS {
                let column = PIXELS - 1 - sample;
                let at = Vector2::new(column as f64, row as f64) * pitch;
                let value = seen(at, 0.0) + noise(row * PIXELS + sample);
                bytes.extend(value.to_le_bytes());
            }
        }
        let path = work.path().join(name);
        std::fs::write(&path, bytes).expect("writable");
        let out = work.path().join(format!("{name}-out"));
        let run = succeed(&mut analyze(&path, &out));
        assert!(run.stdout.contains("direction unknown"), "{}", run.stdout);
        let found = results(&out);
        let set = &found["sets"][0];
        assert!(caveats(&found).contains(&"no-timing"), "{unit}");
        shows_the_lattice(&set["uncorrected"]["vectors"]);
    }
}
