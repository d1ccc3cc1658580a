//! The documents: the paths that are promised, the schema, the tables, settings fed back.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use crate::common::{analyze, json, program, results, run, small_set, succeed};
use crate::schema::problems;

/// What has to stand at the end of a path.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Text,
    OneOf(&'static [&'static str]),
    Number,
    /// `{"value", "sigma"}`, both finite.
    Estimate,
    EstimateOrNull,
    Pair,
    Matrix,
    /// A number of entries.
    List(usize),
    AnyList,
}

use Kind::{AnyList, Estimate, EstimateOrNull, List, Matrix, Number, OneOf, Pair, Text};

/// What `moiregauge/results/1` promises for four good scans; `[]` stands for every entry of a list.
const PROMISED: &[(&str, Kind)] = &[
    ("schema", OneOf(&["moiregauge/results/1"])),
    ("sets", List(1)),
    ("sets[].name", Text),
    ("sets[].slow_axis", OneOf(&["x", "y"])),
    ("sets[].line_rate_hz", Number),
    ("sets[].drift.x_nm_per_min", Estimate),
    ("sets[].drift.y_nm_per_min", Estimate),
    ("sets[].drift.correlation", Number),
    ("sets[].mean.twist_deg", Estimate),
    ("sets[].mean.heterostrain_percent", Estimate),
    ("sets[].mean.strain_axis_lab_deg", EstimateOrNull),
    ("sets[].mean.strain_vector_percent", Pair),
    ("sets[].mean.strain_vector_covariance", Matrix),
    ("sets[].scans", List(4)),
    ("sets[].scans[].file", Text),
    ("sets[].scans[].frame_direction", OneOf(&["up", "down"])),
    ("sets[].scans[].window.centre_nm", Pair),
    ("sets[].scans[].window.extent_nm", Pair),
    ("sets[].scans[].tip_velocity_nm_per_s.fast", Estimate),
    ("sets[].scans[].tip_velocity_nm_per_s.slow", Estimate),
    ("sets[].scans[].vectors", List(3)),
    ("sets[].scans[].vectors[].polar_angle_deg", Number),
    ("sets[].scans[].vectors[].nominal.x_nm", Number),
    ("sets[].scans[].vectors[].nominal.y_nm", Number),
    ("sets[].scans[].vectors[].nominal.wavelength_nm", Estimate),
    ("sets[].scans[].vectors[].nominal.naive_twist_deg", Estimate),
    ("sets[].scans[].vectors[].sensor.x_nm", Number),
    ("sets[].scans[].vectors[].sensor.y_nm", Number),
    ("sets[].scans[].vectors[].sensor.wavelength_nm", Estimate),
    ("sets[].scans[].vectors[].sensor.naive_twist_deg", Estimate),
    ("sets[].scans[].vectors[].drift_corrected.x_nm", Number),
    ("sets[].scans[].vectors[].drift_corrected.y_nm", Number),
    (
        "sets[].scans[].vectors[].drift_corrected.wavelength_nm",
        Estimate,
    ),
    (
        "sets[].scans[].vectors[].drift_corrected.naive_twist_deg",
        Estimate,
    ),
    ("sets[].scans[].twist_strain.sensor.twist_deg", Estimate),
    (
        "sets[].scans[].twist_strain.sensor.heterostrain_percent",
        Estimate,
    ),
    (
        "sets[].scans[].twist_strain.sensor.lattice_angle_deg",
        Estimate,
    ),
    (
        "sets[].scans[].twist_strain.sensor.strain_axis_lab_deg",
        EstimateOrNull,
    ),
    (
        "sets[].scans[].twist_strain.sensor.strain_axis_lattice_deg",
        EstimateOrNull,
    ),
    (
        "sets[].scans[].twist_strain.drift_corrected.twist_deg",
        Estimate,
    ),
    (
        "sets[].scans[].twist_strain.drift_corrected.heterostrain_percent",
        Estimate,
    ),
    (
        "sets[].scans[].twist_strain.drift_corrected.lattice_angle_deg",
        Estimate,
    ),
    (
        "sets[].scans[].twist_strain.drift_corrected.strain_axis_lab_deg",
        EstimateOrNull,
    ),
    (
        "sets[].scans[].twist_strain.drift_corrected.strain_axis_lattice_deg",
        EstimateOrNull,
    ),
    ("sets[].mean.strain_interval_95_percent", Pair),
    ("sets[].mean.budget.twist_deg.image", Number),
    ("sets[].mean.budget.twist_deg.total", Number),
    ("sets[].mean.budget.heterostrain_percent.total", Number),
    ("sets[].mean.budget.strain_e1_percent.drift", Number),
    ("sets[].mean.budget.strain_vector_covariance", Matrix),
    ("combined.budget.twist_deg.calibration_gain", Number),
    ("combined.twist_deg", Estimate),
    ("combined.heterostrain_percent", Estimate),
    ("combined.vectors", List(3)),
    ("combined.vectors[].wavelength_nm", Estimate),
    ("caveats", AnyList),
    ("failed", AnyList),
    ("provenance.version", OneOf(&[env!("CARGO_PKG_VERSION")])),
    ("provenance.seed", Number),
    ("provenance.inputs", List(4)),
    ("provenance.inputs[].sha256", Text),
    ("settings.drift_draws", Number),
    ("conventions.strain", Text),
];

/// Every value that a path leads to.
fn values_at<'a>(value: &'a Value, path: &str) -> Vec<&'a Value> {
    let mut found = vec![value];
    for part in path.split('.') {
        let key = part.trim_end_matches("[]");
        found = found.iter().map(|v| &v[key]).collect();
        if part.ends_with("[]") {
            found = found
                .into_iter()
                .flat_map(|v| v.as_array().map_or(&[][..], Vec::as_slice))
                .collect();
        }
    }
    found
}

fn is_estimate(value: &Value) -> bool {
    value["value"].is_number() && value["sigma"].as_f64().is_some_and(|sigma| sigma > 0.0)
}

fn is_pair(value: &Value) -> bool {
    let list = value.as_array();
    list.is_some_and(|l| l.len() == 2 && l.iter().all(Value::is_number))
}

fn fits(value: &Value, kind: Kind) -> bool {
    let list = value.as_array();
    match kind {
        Text => value.as_str().is_some_and(|s| !s.is_empty()),
        OneOf(words) => value.as_str().is_some_and(|s| words.contains(&s)),
        Number => value.is_number(),
        Estimate => is_estimate(value),
        EstimateOrNull => value.is_null() || is_estimate(value),
        Pair => is_pair(value),
        Matrix => list.is_some_and(|l| l.len() == 2 && l.iter().all(is_pair)),
        List(n) => list.is_some_and(|l| l.len() == n),
        AnyList => list.is_some(),
    }
}

#[test]
fn every_promised_path_is_there_with_its_type() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    succeed(&mut analyze(&small_set(folder.path()), &out));
    let document = results(&out);
    for &(path, kind) in PROMISED {
        let found = values_at(&document, path);
        assert!(!found.is_empty(), "nothing at {path}");
        // A null axis in every scan would pass without a number having been seen.
        if matches!(kind, EstimateOrNull) {
            assert!(found.iter().any(|v| is_estimate(v)), "only null at {path}");
        }
        for value in found {
            assert!(fits(value, kind), "{path}: {kind:?} expected, {value}");
        }
    }
}

/// The entries of lists that are empty when all is well.
#[test]
fn caveats_and_failures_name_what_and_where() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    std::fs::write(scans.join("bad.spm"), b"\\*File list\r\n").unwrap();
    let out = folder.path().join("out");
    let run = run(analyze(&scans, &out).args(["--method", "paper"]));
    assert_eq!(run.code, Some(1));
    let document = results(&out);
    for path in [
        "caveats[].code",
        "caveats[].message",
        "caveats[].where",
        "failed[].file",
        "failed[].error",
    ] {
        let found = values_at(&document, path);
        assert!(!found.is_empty(), "nothing at {path}");
        assert!(found.iter().all(|v| fits(v, Text)), "{path}: {found:?}");
    }
}

#[test]
fn what_the_program_writes_follows_the_published_schema() {
    let schema = moiregauge_report::schema();
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let one = scans.join("scan.000.spm");
    for (input, name) in [(&scans, "whole"), (&one, "one")] {
        let out = folder.path().join(name);
        succeed(&mut analyze(input, &out));
        let document = results(&out);
        let errors = problems(&schema, &document);
        assert!(errors.is_empty(), "{errors:?}");
    }
}

/// Rows of a table by the names of its columns. Cells in quotes may hold commas.
fn table(path: &Path) -> Vec<BTreeMap<String, String>> {
    let text = std::fs::read_to_string(path).unwrap();
    let cells = |line: &str| -> Vec<String> {
        let quoted = line.split('"').enumerate();
        let plain = quoted.map(|(i, part)| match i % 2 {
            0 => part.to_owned(),
            _ => part.replace(',', ";"),
        });
        let line: String = plain.collect();
        line.split(',').map(str::to_owned).collect()
    };
    let mut lines = text.lines();
    let names = cells(lines.next().expect("a header"));
    let rows = lines.map(|line| {
        let cells = cells(line);
        assert_eq!(cells.len(), names.len(), "{line}");
        names.iter().cloned().zip(cells).collect()
    });
    rows.collect()
}

/// Every number of a table's column, for the rows of drift-corrected coordinates.
fn column(rows: &[BTreeMap<String, String>], name: &str) -> Vec<f64> {
    rows.iter()
        .filter(|row| {
            row.get("coordinates")
                .is_none_or(|c| c == "drift_corrected")
        })
        .map(|row| row[name].parse().unwrap_or_else(|_| panic!("{row:?}")))
        .collect()
}

#[test]
fn tables_hold_the_numbers_of_the_document() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    succeed(&mut analyze(&small_set(folder.path()), &out));
    let document = results(&out);
    let numbers = |path: &str| -> Vec<f64> {
        let found = values_at(&document, path);
        found
            .iter()
            .map(|v| v.as_f64().expect("a number"))
            .collect()
    };
    let corrected = "sets[].scans[].twist_strain.drift_corrected";
    let vector = "sets[].scans[].vectors[].drift_corrected";
    for (file, name, path) in [
        (
            "scans.csv",
            "twist_deg",
            format!("{corrected}.twist_deg.value"),
        ),
        (
            "scans.csv",
            "heterostrain_sigma_percent",
            format!("{corrected}.heterostrain_percent.sigma"),
        ),
        (
            "sets.csv",
            "twist_deg",
            "sets[].mean.twist_deg.value".to_owned(),
        ),
        (
            "sets.csv",
            "drift_y_sigma_nm_per_min",
            "sets[].drift.y_nm_per_min.sigma".to_owned(),
        ),
        ("vectors.csv", "x_nm", format!("{vector}.x_nm")),
        (
            "vectors.csv",
            "wavelength_nm",
            format!("{vector}.wavelength_nm.value"),
        ),
    ] {
        let expected = numbers(&path);
        assert!(!expected.is_empty(), "{path}");
        assert_eq!(column(&table(&out.join(file)), name), expected, "{file}");
    }
}

#[test]
fn the_printed_settings_fed_back_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let printed = succeed(program().arg("config")).stdout;
    let config = folder.path().join("settings.toml");
    std::fs::write(&config, &printed).unwrap();
    let bytes = |name: &str, config: Option<&Path>, options: &[&str]| {
        let out = folder.path().join(name);
        let mut command = analyze(&scans, &out);
        if let Some(config) = config {
            command.arg("--config").arg(config);
        }
        succeed(command.args(options));
        // How the settings were given is recorded; nothing else differs.
        let mut found = results(&out);
        let run = found.pointer_mut("/provenance/run").unwrap();
        let arguments = run.as_object_mut().unwrap().remove("arguments");
        assert_eq!(arguments.unwrap()[0], "analyze");
        serde_json::to_vec(&found).unwrap()
    };
    let plain = bytes("plain", None, &[]);
    assert!(plain == bytes("fed-back", Some(&config), &[]));

    // An edited file counts like the option, and the option wins over the file.
    let edited = printed.replace("method = \"lattice\"", "method = \"fourier\"");
    assert_ne!(edited, printed);
    std::fs::write(&config, edited).unwrap();
    let fourier = bytes("edited", Some(&config), &[]);
    assert!(fourier != plain);
    assert!(fourier == bytes("option", None, &["--method", "fourier"]));
    let back = ["--method", "lattice"];
    assert!(plain == bytes("over", Some(&config), &back));
}

/// A gain of 0.2 % and its part of the twist; the σ of the scans does not know of it.
#[test]
fn the_calibration_is_what_the_user_says() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let of = |name: &str, options: &[&str]| {
        let out = folder.path().join(name);
        succeed(analyze(&scans, &out).args(options));
        let document = results(&out);
        let number = |path: &str| document.pointer(path).and_then(Value::as_f64).unwrap();
        let twist = number("/combined/twist_deg/value");
        let gain = number("/combined/budget/twist_deg/calibration_gain");
        (gain / twist, number("/combined/twist_deg/sigma"))
    };
    let (by_default, sigma) = of("default", &[]);
    let (chosen, same) = of("chosen", &["--calibration-gain", "0.2"]);
    assert!((by_default - 0.01).abs() < 1e-4, "{by_default}");
    assert!((chosen - 0.002).abs() < 1e-4, "{chosen}");
    assert_eq!(sigma, same);
}

#[test]
fn json_goes_to_the_screen_alone() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let out = folder.path().join("out");
    let run = succeed(analyze(&scans, &out).arg("--json"));
    let printed: Value = serde_json::from_str(&run.stdout).expect("nothing but JSON");
    assert_eq!(printed, json(&out.join("results.json")));
}

#[test]
fn the_summary_ends_with_drift_twist_and_strain() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let run = succeed(&mut analyze(&scans, &folder.path().join("out")));
    for word in [
        "drift",
        "twist",
        "heterostrain",
        "(statistical ± ",
        "nm/min",
        "4 scans (2 up, 2 down)",
    ] {
        assert!(run.stdout.contains(word), "no {word:?} in {}", run.stdout);
    }
    let quiet = succeed(analyze(&scans, &folder.path().join("quiet")).arg("--quiet"));
    assert_eq!(quiet.stdout, "");
    assert_eq!(quiet.stderr, "");
}

/// What is printed by `info` agrees with the truth of a simulated file.
#[test]
fn info_tells_channels_sizes_and_directions() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let file = scans.join("scan.001.spm");
    let run = succeed(program().args(["info", "--json", "--at", "0,0"]).arg(&file));
    let list: Value = serde_json::from_str(&run.stdout).unwrap();
    let info = &list[0];
    assert_eq!(info["frame_direction"], "down");
    assert_eq!(info["line_rate_hz"], 8.0);
    let channels = info["channels"].as_array().unwrap();
    // Phase, amplitude and both sensors, trace and retrace.
    assert_eq!(channels.len(), 8);
    for channel in channels {
        assert_eq!(channel["rows"], 128);
        assert_eq!(channel["columns"], 128);
        assert!(channel["samples"][0]["value"].is_number());
    }
}
