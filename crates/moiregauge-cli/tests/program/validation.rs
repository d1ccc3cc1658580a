//! `moiregauge validate`: on conditions given by a file, by scans, and what it writes.

use serde_json::Value;

use crate::common::{json, number, program, run, simulate, succeed};

#[test]
fn a_validation_writes_its_evidence_and_repeats_itself() {
    let folder = tempfile::tempdir().unwrap();
    let validate = |name: &str, threads: &str| {
        let out = folder.path().join(name);
        let run = succeed(
            program()
                .args([
                    "validate", "--sets", "4", "--pixels", "64", "--quiet", "--out",
                ])
                .arg(&out)
                .env("RAYON_NUM_THREADS", threads),
        );
        assert!(run.stdout.contains("rms/bound"), "{}", run.stdout);
        out
    };
    let (a, b) = (validate("a", "1"), validate("b", "2"));
    for file in [
        "validation.json",
        "sets.csv",
        "conditions.toml",
        "pulls.svg",
        "pulls.png",
    ] {
        let of = |out: &std::path::Path| std::fs::read(out.join(file)).expect(file);
        assert_eq!(of(&a), of(&b), "{file}");
    }
    let found = json(&a.join("validation.json"));
    assert_eq!(found["schema"], "moiregauge/validation/1");
    let twist = &found["quantities"][2];
    assert_eq!(
        (&twist["name"], &twist["unit"]),
        (&Value::from("twist"), &Value::from("°"))
    );
    // Four sets are within a factor of a few of the bound; nobody gets below it on average.
    let ratio = number(twist, "/error_over_bound");
    assert!((0.2..4.0).contains(&ratio), "{ratio}");

    let out = folder.path().join("c");
    let conditions = a.join("conditions.toml");
    succeed(
        program()
            .args(["validate", "--sets", "4", "--quiet", "--config"])
            .arg(&conditions)
            .arg("--out")
            .arg(&out),
    );
    let same = json(&out.join("validation.json"));
    assert_eq!(same["quantities"], found["quantities"]);
    let again = run(program()
        .args(["validate", "--sets", "4", "--out"])
        .arg(&out));
    assert_eq!(again.code, Some(1));
    assert!(again.stderr.contains("--force"), "{}", again.stderr);
}

/// The conditions that `--like` reads off simulated scans are those that were put in: within a few per
/// cent for the noise, which the fit measures at the harmonics only, and within its error for the rest.
#[test]
fn like_finds_the_conditions_of_scans() {
    let folder = tempfile::tempdir().unwrap();
    let scans = simulate(
        folder.path(),
        &["--pixels", "128", "--scans", "4", "--noise", "0.8"],
    );
    let out = folder.path().join("like");
    succeed(
        program()
            .args(["validate", "--sets", "2", "--quiet", "--like"])
            .arg(&scans)
            .arg("--out")
            .arg(&out),
    );
    let found = json(&out.join("validation.json"));
    let conditions = &found["conditions"];
    let near = |pointer: &str, expected: f64, tolerance: f64| {
        let value = number(conditions, pointer);
        assert!(
            (value - expected).abs() <= tolerance,
            "{pointer}: {value}, {expected}"
        );
    };
    assert_eq!(
        conditions["raster"]["pixels"],
        serde_json::json!([128, 128])
    );
    near("/raster/scans", 4.0, 0.0);
    near("/raster/line_rate_hz", 8.0, 1e-9);
    near("/raster/rounding", 0.05, 1e-6);
    near("/raster/nominal_size_nm/0", 54.7, 0.01);
    near("/raster/nominal_size_nm/1", 56.8, 0.01);
    near("/raster/gap_s", 1.0, 1.5);
    near("/noise/pixel_deg", 0.8, 0.12);
    near("/noise/sensor_nm", 0.2, 0.05);
    near("/sample/twist_deg", 1.13, 0.002);
    near("/sample/strain_percent", 0.12, 0.01);
    near("/sample/sharpness", 0.3, 0.05);
    near("/drift/velocity_nm_per_min/0", 0.5, 0.1);
}

/// Real samples: one line for each class, the same on any number of threads, and every set can be made again.
#[test]
fn real_samples_are_counted_class_by_class() {
    let folder = tempfile::tempdir().unwrap();
    let validate = |name: &str, threads: &str| {
        let out = folder.path().join(name);
        let run = succeed(
            program()
                .args(["validate", "--sets", "3", "--pixels", "96", "--quiet"])
                .args(["--sample", "scars:count=3", "--sample", "bare", "--out"])
                .arg(&out)
                .env("RAYON_NUM_THREADS", threads),
        );
        (
            run.stdout,
            std::fs::read_to_string(out.join("samples.csv")).unwrap(),
        )
    };
    let (shown, rows) = validate("a", "1");
    assert_eq!(validate("b", "2").1, rows);
    let words = |start: &str| -> Vec<String> {
        let line = shown
            .lines()
            .find(|line| line.starts_with(start))
            .expect(start);
        line.split_whitespace().map(str::to_owned).collect()
    };
    assert_eq!(words("scars:count=3")[1..5], ["3", "3", "0", "0"]);
    assert_eq!(words("bare")[1..5], ["3", "0", "3", "0"]);
    let seeds: Vec<&str> = rows
        .lines()
        .filter_map(|row| row.split(',').nth(1))
        .collect();
    assert_eq!(seeds, ["seed", "1", "2", "3", "1", "2", "3"]);

    let refused = run(program().args(["validate", "--sample", "edges"]));
    assert_eq!(refused.code, Some(1));
    assert!(
        refused.stderr.contains("one of clean, edge"),
        "{}",
        refused.stderr
    );
}

/// Samples go through a settings file, as do the numbers that were drawn.
#[test]
fn drawn_samples_can_be_printed_and_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let sample = [
        "--sample",
        "edge:share=0.6+glitches",
        "--vary",
        "--seed",
        "9",
    ];
    let config = folder.path().join("set.toml");
    let printed = succeed(program().args(["simulate", "--print-config"]).args(sample));
    assert!(
        printed.stdout.contains("[[features]]"),
        "{}",
        printed.stdout
    );
    std::fs::write(&config, &printed.stdout).unwrap();
    let small = ["--pixels", "32", "--scans", "1"];
    let made = |name: &str, arguments: &[&str]| {
        let folder = simulate(&folder.path().join(name), &[&small[..], arguments].concat());
        let scan = std::fs::read(folder.join("scan.000.spm")).unwrap();
        (scan, json(&folder.join("truth.json")))
    };
    let (scan, truth) = made("a", &sample);
    let (again, same) = made("b", &["--config", config.to_str().unwrap()]);
    assert_eq!(truth["settings"]["features"], same["settings"]["features"]);
    assert_eq!(scan, again);
    let share = number(&truth, "/sample/share_covered");
    assert!((share - 0.6).abs() < 0.05, "{share}");
    let refused = run(program().args(["simulate", "--out", "x", "--sample", "edge:share=2"]));
    assert_eq!(refused.code, Some(2));
    assert!(
        refused.stderr.contains("0.02 to 0.98"),
        "{}",
        refused.stderr
    );
    let listed = succeed(program().args(["simulate", "--list-samples"]));
    assert!(listed.stdout.contains("twist-wave") && listed.stdout.contains("share=0.5"));
}
