//! Omicron Matrix: images whose log lies beside them.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::{analyze, caveats, program, results, run, succeed};
use crate::writer::{Log, V, data, dictionary, session, transfer};

/// As the program of the instrument names files; in a folder with other letters, too.
const BASE: &str = "default_2020Sep21-125320_STM-STM_Spectroscopy";
const STORED: u64 = 1_600_692_800;

fn counts(n: i32) -> Vec<i32> {
    (0..n).collect()
}

/// Two frames of Z and I, a curve, notes of the user, and the log of all.
fn write_session(work: &Path, base: &str) -> PathBuf {
    let folder = work.join("Graphen auf Ru – 測定");
    std::fs::create_dir(&folder).expect("a folder");
    let write =
        |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes).expect("written");
    let name = |tail: &str| format!("{base}--{tail}");
    let mut log = session().channels(&[
        dictionary([true, true], &[(7, "Z", "m", 1), (8, "I", "A", 1)]),
        transfer(8, "TFF_Linear1D", "A", &[("Factor", 1e12), ("Offset", 0.0)]),
    ]);
    for (number, tail) in ["1_1.Z_mtrx", "1_1.I_mtrx", "1_2.Z_mtrx", "1_2.I_mtrx"]
        .iter()
        .enumerate()
    {
        let time = STORED + number as u64 / 2 * 100;
        log = log.stored(time, &name(tail));
        let channel = 7 + number as u64 % 2;
        write(&name(tail), &data(time, channel, 48, &counts(48)));
    }
    log = log
        .mark("MTRX$SAMPLE_NAME-Gr/Ru")
        .stored(STORED + 300, &name("2_1.I(V)_mtrx"));
    write(&name("2_1.I(V)_mtrx"), &data(STORED, 9, 10, &counts(10)));
    write(&format!("{base}_0001.mtrx"), &log.0);
    write("notes.txt", b"tip was bad\n");
    folder
}

fn infos(paths: &[&Path], options: &[&str]) -> Vec<Value> {
    let ran = succeed(
        program()
            .arg("info")
            .args(paths)
            .arg("--json")
            .args(options),
    );
    let value: Value = serde_json::from_str(&ran.stdout).expect("JSON");
    value.as_array().expect("a list").clone()
}

#[test]
fn info_and_convert_find_the_log() {
    let work = tempfile::tempdir().expect("a folder");
    let folder = write_session(work.path(), &format!("Größe_{BASE}"));
    let found = infos(&[&folder], &[]);
    assert_eq!(found.len(), 2, "one file of each frame");
    for info in &found {
        let file = info["file"].as_str().expect("a name");
        assert!(file.contains("測定") && file.ends_with(".Z_mtrx"), "{file}");
        assert_eq!(info["frame_direction"], "up");
        let width = info["size_nm"][0].as_f64().expect("a width");
        assert!((width - 80.0).abs() < 1e-9);
        let note = info["notes"][0].as_str().expect("a note");
        assert!(note.contains("untested"), "{note}");
        let channels = info["channels"].as_array().expect("channels");
        assert_eq!(channels.len(), 2);
        // Count 0 of half a nanometre each, 10 of them too many.
        let least = channels[0]["min"].as_f64().expect("a number");
        assert!((least + 5e-9).abs() < 1e-18, "{least}");
    }
    let text = succeed(program().arg("info").arg(&folder)).stdout;
    assert_eq!(
        text.matches("note: the reader of Omicron").count(),
        2,
        "{text}"
    );

    let out = work.path().join("out");
    succeed(
        program()
            .arg("convert")
            .arg(&folder)
            .arg(&out)
            .args(["--to", "gwy"]),
    );
    let stem = format!("Größe_{BASE}--1_2.Z.gwy");
    let read = infos(&[&out.join(stem)], &[]);
    assert!(
        read[0]["format"]
            .as_str()
            .expect("words")
            .contains("Omicron Matrix")
    );
    assert!(
        read[0]["notes"][0]
            .as_str()
            .expect("a note")
            .contains("untested")
    );
    assert_eq!(
        read[0]["rotation_deg"].as_f64().map(f64::round),
        Some(-30.0)
    );
}

/// The frame downwards of the same file, and channels of their own.
#[test]
fn the_user_chooses_frame_and_channel() {
    let work = tempfile::tempdir().expect("a folder");
    let folder = write_session(work.path(), BASE);
    let current = folder.join(format!("{BASE}--1_1.I_mtrx"));
    let down = &infos(&[&current], &["--frame-direction", "down"])[0];
    assert_eq!(down["frame_direction"], "down");
    assert_eq!(down["channels"][0]["unit"], "A");
    // Count 24 is the first one downwards.
    let least = down["channels"][0]["min"].as_f64().expect("a number");
    assert!((least - 24e-12).abs() < 1e-24, "{least}");
    // The top line is the first.
    let top = infos(&[&current], &["--frame-direction", "down", "--at", "0,0"]);
    let value = top[0]["channels"][0]["samples"][0]["value"].as_f64();
    assert!((value.expect("a value") - 24e-12).abs() < 1e-24);
    let pattern = folder.join("*.I_mtrx");
    assert_eq!(infos(&[&pattern], &[]).len(), 2);
}

#[test]
fn what_is_missing_is_named() {
    let work = tempfile::tempdir().expect("a folder");
    let folder = write_session(work.path(), BASE);
    let said = |path: &Path| {
        let ran = run(program().arg("info").arg(path));
        assert_eq!(ran.code, Some(1));
        ran.stderr
    };
    let log = folder.join(format!("{BASE}_0001.mtrx"));
    assert!(said(&log).contains("give the images"), "the log itself");
    let curve = folder.join(format!("{BASE}--2_1.I(V)_mtrx"));
    assert!(said(&curve).contains("spectroscopy curve"));
    let image = folder.join(format!("{BASE}--1_1.Z_mtrx"));
    // The log of another session, under the right name.
    let other = Log::new().stored(STORED, "other--1_1.Z_mtrx").0;
    std::fs::write(&log, other).expect("written");
    assert!(said(&image).contains("such as other--1_1.Z_mtrx"));
    std::fs::remove_file(&log).expect("removed");
    let error = said(&image);
    assert!(
        error.contains(&format!("expected the file {BASE}_0001.mtrx")),
        "{error}"
    );
}

/// Of a file that holds a frame upwards and one downwards both are measured, which gives the drift: 2 % of a frame in the time of
/// one, in a frame of 80 nm. Who says which frame to read gets that one.
#[test]
fn both_frames_of_a_file_give_the_drift() {
    let work = tempfile::tempdir().expect("a folder");
    let side = 128;
    let mut samples = Vec::new();
    for n in 0..2 * side {
        let line = if n < side { n } else { 2 * side - 1 - n };
        let place = f64::from(line) - 0.02 * f64::from(n);
        let row = |x: i32| {
            let at = |degrees: f64| {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let phase = (f64::from(x) * cos + place * sin) * 9.0 / f64::from(side);
                (std::f64::consts::TAU * phase).cos()
            };
            (1e6 * (at(7.0) + at(67.0) + at(127.0))) as i32
        };
        samples.extend((0..side).map(row));
        samples.extend((0..side).rev().map(row));
    }
    let name = "s--1_1.Z_mtrx";
    let log = session()
        .change(5, "XYScanner", "Points", "Count", V::Long(side))
        .change(5, "XYScanner", "Lines", "Count", V::Long(side))
        .change(5, "XYScanner", "Height", "Meter", V::Double(8e-8))
        .stored(STORED, name);
    let file = work.path().join(name);
    std::fs::write(&file, data(STORED, 7, samples.len() as u32, &samples)).expect("written");
    std::fs::write(work.path().join("s_0001.mtrx"), log.0).expect("written");
    let out = work.path().join("out");
    let folder = work.path();
    succeed(analyze(folder, &out).args(["--channel", "Z"]));
    let found = results(&out);
    let set = &found["sets"][0];
    let frames: Vec<(&str, &str)> = set["scans"]
        .as_array()
        .expect("scans")
        .iter()
        .map(|scan| {
            let text = |key: &str| scan[key].as_str().expect("text");
            (text("file"), text("frame_direction"))
        })
        .collect();
    let second = format!("{name} (down)");
    assert_eq!(frames.len(), 2);
    assert!(
        frames[0].0.ends_with(name) && frames[0].1 == "up",
        "{frames:?}"
    );
    assert!(
        frames[1].0.ends_with(&second) && frames[1].1 == "down",
        "{frames:?}"
    );
    // Along the lines in the axes of the frame, which is turned; 0.02 of the speed of the slow scan.
    let drift = |axis: &str| set["drift"][axis]["value"].as_f64().expect("a drift") / 60.0;
    let speed = set["scans"][0]["tip_velocity_nm_per_s"]["slow"]["value"].as_f64();
    let share = drift("x_nm_per_min").hypot(drift("y_nm_per_min")) / speed.expect("a speed");
    assert!((share - 0.02).abs() < 0.001, "{share}");
    let again = work.path().join("again");
    let document = out.join("results.json");
    succeed(
        program()
            .args(["analyze", "--replay"])
            .arg(&document)
            .arg("--out")
            .arg(&again),
    );
    let one = work.path().join("one");
    succeed(analyze(&file, &one).args(["--channel", "Z", "--frame-direction", "down"]));
    let one = &results(&one)["sets"][0]["scans"];
    assert_eq!(one.as_array().map(Vec::len), Some(1));
    assert_eq!(one[0]["frame_direction"], "down");
}

/// A lattice through the whole chain: the doubt of the reader is one of the results.
#[test]
fn results_carry_the_doubt() {
    let work = tempfile::tempdir().expect("a folder");
    let side = 128;
    let mut samples = Vec::new();
    for line in 0..side {
        let row = |x: i32| {
            let at = |degrees: f64| {
                let (sin, cos) = degrees.to_radians().sin_cos();
                // Nine nodes across.
                let period = f64::from(side) / 9.0;
                let phase = (f64::from(x) * cos + f64::from(line) * sin) / period;
                (std::f64::consts::TAU * phase).cos()
            };
            (1e6 * (at(7.0) + at(67.0) + at(127.0))) as i32
        };
        samples.extend((0..side).map(row));
        samples.extend((0..side).rev().map(row));
    }
    let name = "s--1_1.Z_mtrx";
    let log = session()
        .change(5, "XYScanner", "Points", "Count", V::Long(side))
        .change(5, "XYScanner", "Lines", "Count", V::Long(side))
        .change(5, "XYScanner", "Height", "Meter", V::Double(8e-8))
        .change(5, "XYScanner", "Y_Retrace", "--", V::Bool(false))
        .stored(STORED, name);
    let file = work.path().join(name);
    std::fs::write(&file, data(STORED, 7, samples.len() as u32, &samples)).expect("written");
    std::fs::write(work.path().join("s_0001.mtrx"), log.0).expect("written");
    let out = work.path().join("out");
    let ran = succeed(analyze(&file, &out).args(["--channel", "Z"]));
    assert!(ran.stdout.contains("reader-doubt"), "{}", ran.stdout);
    let found = results(&out);
    assert!(caveats(&found).contains(&"reader-doubt"));
    // The same frame by another channel is no second frame.
    let current = work.path().join("s--1_1.I_mtrx");
    std::fs::copy(&file, &current).expect("copied");
    let twice = run(analyze(&file, &work.path().join("twice")).arg(&current));
    assert_eq!(twice.code, Some(1));
    assert!(
        twice.stderr.contains("another channel of the frame"),
        "{}",
        twice.stderr
    );
    assert_eq!(results(&work.path().join("twice"))["scans"], found["scans"]);
}
