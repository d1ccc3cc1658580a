//! Simulated instruments of every kind → the numbers that were put in.
//!
//! The simulator gives every pixel its own time and place and writes real files, so the chain is
//! tested from the bytes on. Every number has to lie within four of its own σ, and σ may not be so
//! large that this means nothing.

use std::path::Path;

use serde_json::Value;

use crate::common::{analyze, caveats, estimate, json, number, results, simulate, succeed};

/// One kind of instrument.
#[derive(Default)]
struct Case<'a> {
    /// Settings of the simulation that have no option on the command line.
    config: &'static str,
    simulate: &'a [&'a str],
    analyze: &'static [&'static str],
    /// Caveats that have to come, and no others.
    caveats: &'static [&'static str],
}

/// Runs a case with four frames of 128 × 128, if it does not say otherwise.
fn numbers(case: &Case<'_>) -> (Value, Value) {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("set.toml");
    let all = format!("[raster]\nscans = 4\npixels = [128, 128]\n{}", case.config);
    std::fs::write(&config, all).unwrap();
    let config = config.to_str().expect("UTF-8");
    let options = [&["--config", config], case.simulate].concat();
    let scans = simulate(folder.path(), &options);
    let out = folder.path().join("out");
    succeed(analyze(&scans, &out).args(case.analyze));
    (results(&out), json(&scans.join("truth.json")))
}

fn check(case: &Case<'_>) {
    let (found, truth) = numbers(case);
    let set = &found["sets"][0];
    for (pointer, expected, largest_sigma) in [
        (
            "/drift/x_nm_per_min",
            number(&truth, "/drift_nm_per_min/0"),
            0.3,
        ),
        (
            "/drift/y_nm_per_min",
            number(&truth, "/drift_nm_per_min/1"),
            0.3,
        ),
        ("/mean/twist_deg", number(&truth, "/twist_deg"), 0.002),
    ] {
        let (value, sigma) = estimate(set, pointer);
        assert!(
            (value - expected).abs() < 4.0 * sigma && sigma < largest_sigma,
            "{pointer}: {value} ± {sigma}, {expected}"
        );
    }
    strain_vector(set, &truth);
    assert_eq!(caveats(&found), case.caveats);
}

/// The strain as a vector: `(ε cos 2φ, ε sin 2φ)` with φ in the laboratory.
fn strain_vector(set: &Value, truth: &Value) {
    let strain = number(truth, "/strain_percent");
    let axis = number(truth, "/strain_axis_lab_deg").to_radians();
    let expected = [strain * (2.0 * axis).cos(), strain * (2.0 * axis).sin()];
    let off =
        [0, 1].map(|i| number(set, &format!("/mean/strain_vector_percent/{i}")) - expected[i]);
    let c = |i: usize, j: usize| number(set, &format!("/mean/strain_vector_covariance/{i}/{j}"));
    let determinant = c(0, 0) * c(1, 1) - c(0, 1) * c(1, 0);
    let chi2 = (c(1, 1) * off[0] * off[0] - 2.0 * c(0, 1) * off[0] * off[1]
        + c(0, 0) * off[1] * off[1])
        / determinant;
    // Two components: four σ of one.
    assert!(chi2 < 19.3, "strain vector off by {off:?}, χ² {chi2}");
    assert!(c(0, 0).sqrt() < 0.006 && c(1, 1).sqrt() < 0.006);
}

#[test]
fn as_it_comes() {
    check(&Case::default());
}

/// Geometry is the question here. Without the 1/f noise of lines: with it, the few lines of such small
/// frames scatter by about a fifth more along the slow axis than σ says, and four σ are not enough.
#[test]
fn frames_that_are_not_square() {
    for pixels in ["192x96", "96x192"] {
        check(&Case {
            simulate: &["--pixels", pixels, "--size", "80", "60", "--flicker", "0"],
            ..Case::default()
        });
    }
}

#[test]
fn slow_axis_x() {
    check(&Case {
        simulate: &["--slow", "x", "--seed", "3"],
        ..Case::default()
    });
}

#[test]
fn frames_turned_by_33_degrees() {
    check(&Case {
        config: "rotation_deg = 33.0",
        ..Case::default()
    });
}

#[test]
fn trace_only() {
    check(&Case {
        simulate: &["--no-retrace"],
        ..Case::default()
    });
}

#[test]
fn downwards_first_and_a_fast_drift() {
    check(&Case {
        simulate: &["--first", "down", "--drift", "-6", "4"],
        ..Case::default()
    });
}

#[test]
fn the_common_region_of_a_wandering_window() {
    check(&Case {
        config: "[window]\ncreep_nm_per_min = [2.0, -1.5]\nalternation_nm = [1.5, 1.0]",
        analyze: &["--overlap"],
        ..Case::default()
    });
}

#[test]
fn a_quadratic_background() {
    check(&Case {
        analyze: &["--background", "quadratic"],
        ..Case::default()
    });
}

#[test]
fn another_material() {
    check(&Case {
        simulate: &["--material", "MoS2", "--twist", "1.45", "--strain", "0.3"],
        analyze: &["--material", "MoS2"],
        ..Case::default()
    });
}

#[test]
fn the_other_form_of_the_strain_equation() {
    check(&Case {
        config: "[sample]\nstrain_convention = \"k-space\"",
        analyze: &["--strain-convention", "k-space"],
        ..Case::default()
    });
}

/// The analysis without sensors is right where the instrument was.
#[test]
fn no_sensors() {
    check(&Case {
        config: "[window]\ngain = [1.0, 1.0]\nshear_mrad = 0.0\nalternation_nm = [0.0, 0.0]",
        simulate: &["--no-sensors", "--size", "55", "57"],
        caveats: &["no-position-sensors"],
        ..Case::default()
    });
}

/// Frames of one direction say nothing about the drift; a drift known from elsewhere does.
#[test]
fn one_direction_and_a_drift_from_elsewhere() {
    check(&Case {
        config: "alternating = false",
        analyze: &["--drift", "0.5", "-0.15", "--drift-sigma", "0.02"],
        caveats: &["drift-given"],
        ..Case::default()
    });
}

/// σ of a given drift has to reach the strain. How much of it does is known from finite differences:
/// the same frames analysed with drifts that are a little too large and too small. The frames have to
/// agree with each other (χ²/dof ≤ 1), or all of σ is enlarged.
#[test]
fn the_error_of_a_given_drift_is_carried_on() {
    const STEP: f64 = 0.5;
    const SEED: &str = "2";
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("set.toml");
    let text = "[raster]\nscans = 2\npixels = [128, 128]\nalternating = false";
    std::fs::write(&config, text).unwrap();
    let options = ["--config", config.to_str().unwrap(), "--seed", SEED];
    let scans = simulate(folder.path(), &options);
    let mean = |x: f64, y: f64, sigma: f64| {
        let out = tempfile::tempdir().unwrap();
        let [x, y, sigma] = [x, y, sigma].map(|number| number.to_string());
        let drift = ["--drift", &x, &y, "--drift-sigma", &sigma];
        succeed(analyze(&scans, out.path()).args(drift));
        results(out.path())["sets"][0]["mean"].clone()
    };
    let vector = |x: f64, y: f64| {
        let mean = mean(x, y, 0.0);
        [0, 1].map(|i| number(&mean, &format!("/strain_vector_percent/{i}")))
    };
    let slope =
        |plus: [f64; 2], minus: [f64; 2]| [0, 1].map(|i| (plus[i] - minus[i]) / (2.0 * STEP));
    let by_x = slope(vector(0.5 + STEP, -0.15), vector(0.5 - STEP, -0.15));
    let by_y = slope(vector(0.5, -0.15 + STEP), vector(0.5, -0.15 - STEP));
    let (sharp, vague) = (mean(0.5, -0.15, 0.0), mean(0.5, -0.15, 1.0));
    assert!(number(&sharp, "/chi2_per_dof") <= 1.0);
    for i in [0, 1] {
        let pointer = format!("/strain_vector_covariance/{i}/{i}");
        let added = number(&vague, &pointer) - number(&sharp, &pointer);
        let expected = by_x[i].powi(2) + by_y[i].powi(2);
        // Differences over ±0.5 nm/min leave out the third order: a per cent of a per cent.
        assert!(
            (added / expected - 1.0).abs() < 0.01,
            "{pointer}: {added} instead of {expected}"
        );
    }
}

/// Truth and file agree before anything is analysed: the instrument's own words about a frame.
#[test]
fn directions_are_read_from_the_files() {
    let (found, truth) = numbers(&Case {
        simulate: &["--first", "down"],
        ..Case::default()
    });
    let directions = |list: &Value| -> Vec<String> {
        let list = list.as_array().unwrap();
        list.iter()
            .map(|scan| scan["frame_direction"].as_str().unwrap().to_owned())
            .collect()
    };
    let read = directions(&found["sets"][0]["scans"]);
    assert_eq!(read, ["down", "up", "down", "up"]);
    assert_eq!(read, directions(&truth["frames"]));
    let file = found["sets"][0]["scans"][0]["file"].as_str().unwrap();
    assert_eq!(Path::new(file).file_name(), Some("scan.000.spm".as_ref()));
}
