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
