//! Scanners as they are: sensors that lag, calibrations that no scanner has.

use serde_json::Value;

use crate::common::{
    analyze, caveats, estimate, program, results, run, simulate, succeed, testdata,
};

/// Four frames whose sensors lag by 2 ms at 8 lines/s, by an independent program: a twist of 1.280° and a strain of 0.069 %
/// along 177.48°.
#[test]
fn sensors_that_lag_are_seen() {
    let Some(data) = testdata("sensors_that_lag_are_seen") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    succeed(&mut analyze(&data.join("hard/sensor_lag"), &out));
    let found = results(&out);
    let (twist, sigma) = estimate(&found, "/sets/0/mean/twist_deg");
    assert!((twist - 1.28).abs() < 3.0 * sigma, "{twist} ± {sigma}");
    assert!(sigma < 0.001, "{sigma}");
    let mean = &found["sets"][0]["mean"];
    let axis = 2.0 * 177.48_f64.to_radians();
    for (part, truth) in [0.069 * axis.cos(), 0.069 * axis.sin()]
        .into_iter()
        .enumerate()
    {
        let value = mean["strain_vector_percent"][part].as_f64().unwrap();
        let variance = &mean["strain_vector_covariance"][part][part];
        let sigma = variance.as_f64().unwrap().sqrt();
        assert!(
            (value - truth).abs() < 3.5 * sigma,
            "{part}: {value} ± {sigma}"
        );
    }
    let told = found["caveats"].as_array().unwrap().iter();
    let lags: Vec<&Value> = told.filter(|c| c["code"] == "sensor-lag").collect();
    assert!(!lags.is_empty());
    for lag in lags {
        let words = lag["message"].as_str().unwrap();
        let constant = words.split("a time constant of ").nth(1).unwrap();
        let constant: f64 = constant.split(' ').next().unwrap().parse().unwrap();
        assert!((constant - 2.0).abs() < 0.1, "{words}");
    }
    // Sensors of the same program without a lag.
    for set in ["sets/slow_x", "sets/slow_y"] {
        let out = folder.path().join(set.replace('/', "_"));
        succeed(&mut analyze(&data.join(set), &out));
        assert!(!caveats(&results(&out)).contains(&"sensor-lag"), "{set}");
    }
}

/// Four frames with one sensor sample in a hundred off by a micrometre, by an independent program: a twist of 1.167° and a
/// strain of 0.174 %, as certain as with sound sensors.
#[test]
fn sensors_that_glitch_are_no_loss() {
    let Some(data) = testdata("sensors_that_glitch_are_no_loss") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    succeed(&mut analyze(&data.join("hard/sensor_glitches"), &out));
    let found = results(&out);
    let (twist, sigma) = estimate(&found, "/sets/0/mean/twist_deg");
    assert!((twist - 1.167).abs() < 3.5 * sigma, "{twist} ± {sigma}");
    assert!(sigma < 0.001, "{sigma}");
    assert!(caveats(&found).contains(&"sensor-glitches"));
    let out = folder.path().join("sound");
    succeed(&mut analyze(&data.join("sets/slow_y"), &out));
    assert!(!caveats(&results(&out)).contains(&"sensor-glitches"));
}

/// Atoms of MoS2 named graphite are a gain of 28 %, which no position sensors have: said, not written, and not applied.
#[test]
fn a_calibration_of_something_else_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let atoms = simulate(
        &folder.path().join("atoms"),
        &[
            "--atoms",
            "1",
            "--layers",
            "MoS2",
            "--size",
            "5",
            "5",
            "--scans",
            "2",
            "--pixels",
            "96",
            "--no-retrace",
        ],
    );
    let file = folder.path().join("scanner.toml");
    let to = file.to_str().unwrap();
    let calibrate = |material: &str| {
        let mut command = program();
        command.arg("calibrate").arg(&atoms);
        command.args(["--material", material, "--out", to]);
        command
    };
    let wrong = run(&mut calibrate("graphite"));
    assert_eq!(wrong.code, Some(1));
    assert!(
        wrong.stdout.contains("calibration-implausible"),
        "{}",
        wrong.stdout
    );
    assert!(wrong.stderr.contains("the common gain"), "{}", wrong.stderr);
    assert!(!file.exists());
    succeed(&mut calibrate("MoS2"));

    // The same by hand.
    let right = std::fs::read_to_string(&file).unwrap();
    for (key, value) in [
        ("gain_percent", "100.0"),
        ("a_nm", "nan"),
        ("line_rates_hz", "[inf]"),
    ] {
        let lines = right.lines().map(|line| {
            if line.starts_with(&format!("{key} =")) {
                format!("{key} = {value}")
            } else {
                line.to_owned()
            }
        });
        let changed: Vec<String> = lines.collect();
        std::fs::write(&file, changed.join("\n")).unwrap();
        let refused = run(analyze(&atoms, &folder.path().join("out")).args(["--calibration", to]));
        assert_eq!(refused.code, Some(1), "{key}");
        assert!(
            refused.stderr.contains("scanner.toml"),
            "{}",
            refused.stderr
        );
        assert!(refused.stderr.contains("expected"), "{}", refused.stderr);
    }
}

/// One moiré asked for as two: no second one, and no stripes either.
#[test]
fn one_moire_is_no_stripes() {
    let folder = tempfile::tempdir().unwrap();
    let scans = simulate(
        &folder.path().join("one"),
        &["--scans", "2", "--pixels", "128", "--no-retrace"],
    );
    let refused = run(analyze(&scans, &folder.path().join("out")).args(["--moires", "2"]));
    assert_eq!(refused.code, Some(1));
    assert!(
        refused.stderr.contains("but only 1 can be found"),
        "{}",
        refused.stderr
    );
    assert!(
        !refused.stderr.contains("shows stripes"),
        "{}",
        refused.stderr
    );
}

/// Line rates that no microscope has.
#[test]
fn line_rates_have_a_range() {
    for rate in ["1e9", "1e-308", "nan", "-4", "0"] {
        let refused = run(program().args(["info", "nothing.npy", &format!("--line-rate={rate}")]));
        assert_eq!(refused.code, Some(2), "{rate}: {}", refused.stderr);
        assert!(refused.stderr.contains("--line-rate"), "{}", refused.stderr);
    }
}
