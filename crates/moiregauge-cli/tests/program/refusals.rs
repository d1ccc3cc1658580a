//! What cannot be done ends in a clear message and an exit code, never in a crash or a wrong number.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::{Run, analyze, caveats, program, results, run, simulate, small_set, succeed};

/// The first bytes of every JPEG file.
const JPEG: [u8; 12] = *b"\xff\xd8\xff\xe0\x00\x10JFIF\x00\x01";

/// A run that has to end with exit code 1, these words on the screen, and no word of a crash.
fn refuse(run: &Run, words: &[&str]) {
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "no {word:?} in {}", run.stderr);
    }
    assert!(!run.stderr.contains("panicked"), "{}", run.stderr);
}

fn failed(results: &Value) -> Vec<(PathBuf, String)> {
    let list = results["failed"].as_array().expect("a list");
    let text = |entry: &Value, key: &str| entry[key].as_str().expect("text").to_owned();
    list.iter()
        .map(|f| (PathBuf::from(text(f, "file")), text(f, "error")))
        .collect()
}

#[test]
fn an_empty_folder() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    let run = run(&mut analyze(&empty, &out));
    refuse(
        &run,
        &["empty", "no scan files", "nothing could be analysed"],
    );
    assert!(!out.exists(), "nothing is written");
}

#[test]
fn a_file_that_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let run = run(&mut analyze(
        &folder.path().join("gone.spm"),
        &folder.path().join("out"),
    ));
    refuse(&run, &["gone.spm", "no such file or folder"]);
}

#[test]
fn a_jpeg() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for name in ["picture.jpg", "picture.spm"] {
        let picture = folder.path().join(name);
        std::fs::write(&picture, JPEG).unwrap();
        refuse(&run(&mut analyze(&picture, &out)), &[name, "JPEG"]);
    }
    // In a folder one is no scan by its name, and the other should be one.
    refuse(
        &run(&mut analyze(folder.path(), &out)),
        &[
            "left alone: 1 other file (picture.jpg)",
            "picture.spm",
            "it holds a picture",
        ],
    );
}

#[test]
fn a_truncated_scan() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let bytes = std::fs::read(scans.join("scan.000.spm")).unwrap();
    let out = folder.path().join("out");
    for (name, length) in [("in-the-header.spm", 3000), ("no-data.spm", 40_000)] {
        let cut = folder.path().join(name);
        std::fs::write(&cut, &bytes[..length]).unwrap();
        refuse(&run(&mut analyze(&cut, &out)), &[name]);
        assert!(!out.exists());
    }
}

/// The good ones are analysed, the broken one is named, and the exit code tells.
#[test]
fn a_broken_file_among_good_ones() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let whole = folder.path().join("whole");
    succeed(&mut analyze(&scans, &whole));
    let bytes = std::fs::read(scans.join("scan.001.spm")).unwrap();
    let broken = scans.join("scan.999.spm");
    std::fs::write(&broken, &bytes[..50_000]).unwrap();
    let out = folder.path().join("out");
    refuse(
        &run(&mut analyze(&scans, &out)),
        &["not used: 1", "scan.999.spm"],
    );
    let found = results(&out);
    let failed = failed(&found);
    assert_eq!(failed.len(), 1);
    assert_eq!(failed[0].0, broken);
    assert!(failed[0].1.len() > 20, "a reason: {}", failed[0].1);
    assert_eq!(found["sets"], results(&whole)["sets"]);
}

#[test]
fn one_direction_only() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    for down in ["scan.001.spm", "scan.003.spm"] {
        std::fs::remove_file(scans.join(down)).unwrap();
    }
    let out = folder.path().join("out");
    let run = succeed(&mut analyze(&scans, &out));
    assert!(run.stdout.contains("not determined"), "{}", run.stdout);
    let found = results(&out);
    let set = &found["sets"][0];
    assert_eq!(set["drift"], Value::Null);
    let assumed = &set["mean"]["drift_assumed"]["sigma_nm_per_min"];
    assert!((assumed.as_f64().unwrap() - 1.0).abs() < 1e-9, "{assumed}");
    assert!(set["mean"]["twist_deg"]["sigma_total"].is_number());
    assert!(found["combined"].is_object());
    for scan in set["scans"].as_array().unwrap() {
        assert!(scan["twist_strain"]["sensor"].is_object());
        assert_eq!(scan["twist_strain"]["drift_corrected"], Value::Null);
        assert_eq!(scan["vectors"][0]["drift_corrected"], Value::Null);
    }
    assert!(caveats(&found).contains(&"drift-undetermined"));
    let all = found["caveats"].as_array().unwrap();
    let mut said = all.iter().filter(|c| c["code"] == "drift-undetermined");
    let message = said.next().unwrap()["message"].as_str().unwrap();
    assert!(
        message.contains("known from another measurement can be given"),
        "{message}"
    );
    // The document does not speak of options, the screen does.
    assert!(!message.contains("--"), "{message}");
    assert!(run.stdout.contains("  try --drift X Y\n"), "{}", run.stdout);
}

#[test]
fn a_single_scan() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let out = folder.path().join("out");
    succeed(&mut analyze(&scans.join("scan.001.spm"), &out));
    assert_eq!(results(&out)["sets"][0]["drift"], Value::Null);
}

/// Nominal sizes are used then, and the user is told, once for all scans that are used; one that is not has a word of its own.
#[test]
fn no_sensors() {
    let folder = tempfile::tempdir().unwrap();
    let scans = simulate(
        folder.path(),
        &["--pixels", "128", "--scans", "4", "--no-sensors"],
    );
    let out = folder.path().join("out");
    let run = succeed(&mut analyze(&scans, &out));
    assert!(run.stdout.contains("no-position-sensors"), "{}", run.stdout);
    let found = results(&out);
    assert_eq!(caveats(&found), ["no-position-sensors"]);
    let set = &found["sets"][0]["name"];
    let told = |found: &Value, i: usize, place: &Value, end: &str| {
        let told = &found["caveats"][i];
        assert_eq!(&told["where"], place);
        assert!(told["message"].as_str().unwrap().ends_with(end), "{told}");
    };
    told(&found, 0, set, " (4 of 4 scans)");
    let line = &found["sets"][0]["scans"][0]["lines"][0];
    assert_eq!(line["from_sensors"], Value::Bool(false));
    let out = folder.path().join("without");
    succeed(analyze(&scans, &out).args(["--exclude", "scan.001.spm"]));
    let without = results(&out);
    assert_eq!(caveats(&without), ["no-position-sensors"; 2]);
    told(&without, 0, set, " (3 of 3 scans)");
    let file = &without["sets"][0]["scans"][1]["file"];
    told(&without, 1, file, "sensor channels");
}

/// Noise without a moiré gives no numbers, not even with large error bars.
#[test]
fn no_lattice_in_the_image() {
    let folder = tempfile::tempdir().unwrap();
    let scans = simulate(
        folder.path(),
        &["--pixels", "128", "--scans", "2", "--noise", "500"],
    );
    let out = folder.path().join("out");
    refuse(&run(&mut analyze(&scans, &out)), &["shows no lattice"]);
}

#[test]
fn spaces_and_umlauts_in_a_path() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(&folder.path().join("Messung für Jürgen, 2. Versuch"));
    let out = folder.path().join("Ergebnisse ü");
    succeed(program().arg("analyze").arg(&scans).arg("--out").arg(&out));
    let found = results(&out);
    let file = found["sets"][0]["scans"][0]["file"].as_str().unwrap();
    assert_eq!(Path::new(file), scans.join("scan.000.spm"));
    let html = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(html.contains("für Jürgen"));
    succeed(program().arg("info").arg(scans.join("scan.000.spm")));
}

#[test]
fn results_are_not_overwritten_without_force() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let out = folder.path().join("out");
    succeed(&mut analyze(&scans, &out));
    let before = std::fs::read(out.join("results.json")).unwrap();
    let again = run(analyze(&scans, &out).args(["--seed", "9"]));
    refuse(&again, &["already holds results", "--force"]);
    assert_eq!(std::fs::read(out.join("results.json")).unwrap(), before);
    succeed(analyze(&scans, &out).args(["--seed", "9", "--force"]));
    assert_ne!(std::fs::read(out.join("results.json")).unwrap(), before);
}

#[test]
fn an_unknown_channel_lists_those_there_are() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let out = folder.path().join("out");
    let run = run(analyze(&scans, &out).args(["--channel", "Phse"]));
    refuse(&run, &["Phse", "TR Phase", "TR Amplitude"]);
}

#[test]
fn a_line_direction_that_was_not_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let scans = simulate(
        folder.path(),
        &["--pixels", "64", "--scans", "2", "--no-retrace"],
    );
    let run = run(analyze(&scans, &folder.path().join("out")).args(["--line", "retrace"]));
    refuse(&run, &["TR Phase", "retrace"]);
}

#[test]
fn a_wrong_settings_file() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let out = folder.path().join("out");
    let config = folder.path().join("settings.toml");
    for (text, word) in [
        ("metod = \"fourier\"", "metod"),
        ("method = \"furier\"", "furier"),
        ("material = \"unobtainium\"", "unobtainium"),
        ("seed = ", "settings.toml"),
    ] {
        std::fs::write(&config, text).unwrap();
        let run = run(analyze(&scans, &out).arg("--config").arg(&config));
        refuse(&run, &["settings.toml", word]);
        assert!(!out.exists());
    }
    let gone = folder.path().join("gone.toml");
    let run = run(analyze(&scans, &out).arg("--config").arg(&gone));
    refuse(&run, &["gone.toml"]);
}

#[test]
fn numbers_that_make_no_sense() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let out = folder.path().join("out");
    for options in [
        &["--lattice-constant", "0"][..],
        &["--lattice-constant", "nan"],
        &["--poisson-ratio", "1.5"],
        &["--poisson-ratio", "nan"],
        &["--calibration-gain", "-1"],
        &["--calibration-mismatch", "nan"],
        &["--drift", "nan", "0"],
        &["--drift", "0", "inf"],
        &["--drift-sigma", "-1", "--drift", "0.5", "0"],
        &["--drift-draws", "18446744073709551615"],
        &["--line-rate", "1e-308"],
        &["--threads", "100000"],
    ] {
        let run = run(analyze(&scans, &out).args(options));
        // Arguments that cannot be read at all have an exit code of their own.
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        let told = run.stderr.contains(options[0]) && run.stderr.contains(" from ");
        assert!(told, "{options:?}: {}", run.stderr);
    }
    let size = ["--size", "4294967296nm×70nm"];
    let run_of_size = run(analyze(&scans, &out).args(size));
    assert!(
        run_of_size.stderr.contains("--size"),
        "{}",
        run_of_size.stderr
    );
    let sigma = ["--lattice-constant-sigma", "1"];
    let run_of_sigma = run(analyze(&scans, &out).args(sigma));
    refuse(&run_of_sigma, &["the uncertainty"]);
    // The same from a file.
    let config = folder.path().join("settings.toml");
    std::fs::write(&config, "[drift]\nx_nm_per_min = nan\ny_nm_per_min = 0.1").unwrap();
    let from_file = run(analyze(&scans, &out).arg("--config").arg(&config));
    refuse(&from_file, &["drift"]);
    assert!(!out.exists());
}
