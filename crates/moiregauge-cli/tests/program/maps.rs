//! Maps from the command line: whole, in bands, by tiles.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use moiregauge::image::Image;
use moiregauge::simulate::{DomainScene, FieldScene};
use serde_json::Value;

use crate::common::{caveats, json, number, program, run, succeed};

/// 16 pixels per period, 0.7 nm per pixel: 11.2 nm.
const PERIOD: f64 = 16.0;
const PITCH: f64 = 0.7;
const SIDE: usize = 400;

/// A simulated image as an array.
fn array(folder: &Path) -> String {
    let mut scene = FieldScene::hexagonal([SIDE, SIDE], PERIOD, 0.3);
    scene.white = 0.6;
    written(folder, &scene.image())
}

/// An image as an array, top line first.
fn written(folder: &Path, image: &Image) -> String {
    let shape = format!("{}, {}", image.rows, image.columns);
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for row in (0..image.rows).rev() {
        bytes.extend(
            image
                .row(row)
                .iter()
                .flat_map(|v| (*v as f32).to_le_bytes()),
        );
    }
    let path = folder.join("image.npy");
    std::fs::write(&path, bytes).expect("an array");
    path.display().to_string()
}

/// The command that maps it.
fn command(folder: &Path, name: &str, options: &[&str]) -> Command {
    let side = SIDE as f64 * PITCH;
    let size = format!("{side}nm×{side}nm");
    let mut command = program();
    command.arg("map").arg(array(folder)).arg("--out");
    command.arg(folder.join(name)).args(["--size", &size]);
    command.args(["--no-report", "--quiet"]).args(options);
    command
}

fn map(folder: &Path, name: &str, options: &[&str]) -> Value {
    succeed(&mut command(folder, name, options));
    let text = std::fs::read(folder.join(name).join("map.json")).expect("map.json");
    serde_json::from_slice(&text).expect("JSON")
}

fn quantity<'a>(results: &'a Value, name: &str) -> &'a Value {
    let all = results["quantities"].as_array().expect("quantities");
    all.iter().find(|q| q["name"] == name).expect(name)
}

/// θ = 2 arcsin(a/2λ) of the undistorted lattice, by every way of mapping, within the stated errors.
#[test]
fn maps_of_one_lattice_show_its_twist() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = 2.0 * (0.246 / (2.0 * PERIOD * PITCH)).asin().to_degrees();
    for (name, options) in [
        ("whole", vec![]),
        ("bands", vec!["--in-bands"]),
        ("tiles", vec!["--map-method", "tiles"]),
    ] {
        let results = map(folder.path(), name, &options);
        let twist = quantity(&results, "twist");
        let number = |key: &str| twist[key].as_f64().expect(key);
        let error = (number("mean") - truth).abs();
        assert!(error < 3.0 * number("mean_sigma"), "{name}: {error}");
        assert!(error < 1e-3 * truth, "{name}: {error}");
        // Nothing varies: the spread is that of noise.
        let ratio = number("spread") / number("noise");
        assert!((0.6..1.5).contains(&ratio), "{name}: {ratio}");
        let there = folder.path().join(name);
        assert!(there.join("map.zarr/twist/zarr.json").exists(), "{name}");
        assert!(there.join("map.gwy").exists(), "{name}");
        assert!(!there.join("bands").exists(), "{name}");
    }
}

/// The rows of a table, split at commas; the first one has the names.
fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(path).expect("a table");
    let row = |line: &str| line.split(',').map(str::to_owned).collect();
    text.lines().map(row).collect()
}

/// A column of numbers.
fn column(table: &[Vec<String>], name: &str) -> Vec<f64> {
    let at = table[0].iter().position(|n| n == name).expect(name);
    table[1..]
        .iter()
        .filter_map(|r| r[at].parse().ok())
        .collect()
}

fn follows_schema(results: &Value) {
    let schema = moiregauge_report::map_schema();
    let validator = jsonschema::validator_for(&schema).expect("a valid schema");
    let errors: Vec<String> = validator
        .iter_errors(results)
        .map(|e| e.to_string())
        .collect();
    assert!(errors.is_empty(), "{errors:?}");
}

/// Boxes, polygons, lines, devices and a wanted twist of one lattice: the same twist everywhere, and nothing varies.
#[test]
fn questions_about_a_map_have_answers() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = array(folder.path());
    let out = folder.path().join("out");
    succeed(
        program()
            .args(["map", &file, "--size", "280nm×280nm", "--out"])
            .arg(&out)
            .args(["--no-png", "--quiet", "--region", "bar=-80,-60,0.1um,50"])
            .args(["--region", "flake=-80,-80 60,-60 -20nm,50"])
            .args(["--region", "edge=-180,-40,90,40"])
            .args(["--profile", "cut=-80,-80 70,60", "--device", "60nm×30nm"])
            .args(["--device-angles", "3", "--wanted", "1.26±0.01"]),
    );
    let results = json(&out.join("map.json"));
    follows_schema(&results);
    let truth = 2.0 * (0.246 / (2.0 * PERIOD * PITCH)).asin().to_degrees();
    let details = &results["details"];
    let regions = details["regions"].as_array().expect("regions");
    assert_eq!(regions.len(), 3);
    for region in &regions[..2] {
        let error = (number(region, "/twist_deg/mean") - truth).abs();
        assert!(error < 4.0 * number(region, "/twist_deg/sigma"), "{region}");
        // A mean over many windows is better than a node, and worse than independent nodes would have it.
        let (sigma, noise) = (
            number(region, "/twist_deg/sigma"),
            number(region, "/twist_deg/noise"),
        );
        assert!(sigma < 0.5 * noise, "{region}");
        assert!(sigma > 0.1 * noise / number(region, "/good_nodes").sqrt());
    }
    assert!((number(&regions[0], "/area_nm2") - 5000.0).abs() < 1e-9);
    assert!(number(&regions[2], "/covered_percent") < 60.0);
    assert!(caveats(&results).contains(&"region-in-part"));
    let devices = details["devices"].as_array().expect("devices");
    assert!(devices.len() >= 3);
    for (n, device) in devices.iter().enumerate() {
        assert_eq!(number(device, "/rank"), n as f64 + 1.0);
    }
    // 2 arcsin(a/2λ) = 1.2584°: all of it is wanted.
    assert!(number(details, "/wanted/corrected_percent") > 99.0);
    assert_eq!(details["regime"]["use_of"], "phase map");
    let table = rows(&out.join("regions.csv"));
    let listed = column(&table, "twist_deg");
    assert!((listed[0] - number(&regions[0], "/twist_deg/mean")).abs() < 1e-12);
    assert_eq!(rows(&out.join("devices.csv")).len(), devices.len() + 1);
    let profile = rows(&out.join("profiles.csv"));
    let length = column(&profile, "distance_nm");
    assert!((length.last().expect("points") - 150.0f64.hypot(140.0)).abs() < 1e-6);
    for (twist, sigma) in column(&profile, "twist_deg")
        .iter()
        .zip(column(&profile, "twist_sigma_deg"))
    {
        assert!((twist - truth).abs() < 6.0 * sigma);
    }
    let page = std::fs::read_to_string(out.join("report.html")).expect("a page");
    for part in [
        "flake",
        "Uniform areas",
        "Regime: phase map",
        "calibration of the scanner",
        "id=\"map-profiles\"",
    ] {
        assert!(page.contains(part), "{part}");
    }
    for name in [
        "twist",
        "strain",
        "wavelength",
        "displacement",
        "histograms",
        "mask",
        "profiles",
    ] {
        assert!(
            out.join(format!("figures/map-{name}.svg")).exists(),
            "{name}"
        );
    }
    let columns = std::fs::read_to_string(out.join("columns.md")).expect("columns.md");
    assert!(columns.contains("calibration of the scanner"));
}

/// What cannot be answered is refused with the reason.
#[test]
fn questions_beyond_the_map_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = array(folder.path());
    let out = folder.path().join("out");
    for (options, expected) in [
        (
            ["--region", "far=500,0,20,20"],
            "far: x from 500.0 to 520.0 nm",
        ),
        (
            ["--profile", "far=0,300 10,400"],
            "lies outside of the map, which reaches from",
        ),
        (
            ["--region", "two=0,0 10,10"],
            "three corners or more, found 2",
        ),
        (["--region", "bow=0,0 20,20 20,0 0,20"], "cross each other"),
        (["--wanted", "1.1"], "as in 1.05±0.02"),
        (["--device", "60×30"], "with a unit"),
        (["--profile", "a=1,2"], "two places"),
    ] {
        let found = run(program()
            .args([
                "map",
                &file,
                "--size",
                "280nm×280nm",
                "--no-report",
                "--quiet",
                "--out",
            ])
            .arg(&out)
            .args(options));
        assert_ne!(found.code, Some(0), "{options:?}");
        assert!(
            found.stderr.contains(expected),
            "{options:?}: {}",
            found.stderr
        );
        assert!(!out.join("map.json").exists());
    }
    let found = run(program()
        .args(["map", &file, "--size", "280nm×280nm", "--out"])
        .arg(&out)
        .args(["--region", "a=0,0,9,9", "--region", "a=9,9,9,9"]));
    assert!(
        found.stderr.contains("\"a\" is used twice"),
        "{}",
        found.stderr
    );
}

/// At a small angle domains are looked for by themselves: nodes, triangles, and the twist of the simulation.
#[test]
fn small_angles_have_domains() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut scene = DomainScene::hexagonal([360, 340], 40.0, 0.25);
    (scene.white, scene.seed) = (0.3, 7);
    let file = written(folder.path(), &scene.image());
    let map = |out: &Path, more: &[&str]| {
        succeed(
            program()
                .args([
                    "map",
                    &file,
                    "--size",
                    "720nm×680nm",
                    "--quiet",
                    "--no-png",
                    "--out",
                ])
                .arg(out)
                .args(more),
        );
        json(&out.join("map.json"))
    };
    let out = folder.path().join("auto");
    let results = map(&out, &[]);
    follows_schema(&results);
    let details = &results["details"];
    assert_eq!(
        details["regime"]["use_of"], "domains",
        "{}",
        details["regime"]
    );
    assert!(caveats(&results).contains(&"use-domains"));
    // 40 pixels of 2 nm.
    let truth = 2.0 * (0.246f64 / (2.0 * 80.0)).asin().to_degrees();
    let twist = number(details, "/domains/median_twist_deg");
    let noise = number(details, "/domains/twist_noise_deg");
    assert!(
        (twist - truth).abs() < 0.6 * noise,
        "{twist} {truth} {noise}"
    );
    // Nothing varies: the spread is the noise of a triangle.
    let spread = number(details, "/domains/twist_spread_deg");
    assert!((0.7..1.4).contains(&(spread / noise)), "{spread} {noise}");
    assert!(number(details, "/domains/node_sigma_nm") < 2.0);
    let triangles = rows(&out.join("domains.csv"));
    assert_eq!(
        triangles.len() as f64,
        number(details, "/domains/triangles") + 1.0
    );
    let nodes = rows(&out.join("nodes.csv"));
    assert_eq!(nodes.len() as f64, number(details, "/domains/nodes") + 1.0);
    assert!(column(&nodes, "x_sigma_nm").iter().all(|s| *s > 0.0));
    assert!(out.join("figures/map-domains.svg").exists());
    let page = std::fs::read_to_string(out.join("report.html")).expect("a page");
    assert!(page.contains("Regime: domains"));
    let off = map(
        &folder.path().join("off"),
        &["--domains", "off", "--no-report"],
    );
    assert_eq!(off["details"]["regime"]["use_of"], "phase map");
    assert!(caveats(&off).contains(&"phases-in-doubt"));
    assert!(off["details"]["domains"].is_null());
}

/// All files under a folder, by their names there.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("inside").to_owned();
                all.insert(name, std::fs::read(&path).expect("a file"));
            }
        }
    }
    all
}

/// A survey that is stopped goes on with the bands it has, and ends with the same bytes as one that is not.
#[test]
fn an_interrupted_survey_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    map(folder.path(), "straight", &["--in-bands"]);
    let straight = files(&folder.path().join("straight"));
    assert!(straight.contains_key(Path::new("map.json")));
    for spoil in [false, true] {
        let name = format!("stopped-{spoil}");
        let out = folder.path().join(&name);
        // A file where the folder of the map should be stops the program when all bands are done.
        std::fs::create_dir(&out).expect("a folder");
        std::fs::write(out.join("map.zarr"), b"in the way").expect("a file");
        let stopped = run(&mut command(folder.path(), &name, &["--in-bands"]));
        assert!(stopped.stderr.contains("map.zarr"), "{}", stopped.stderr);
        let kept: Vec<PathBuf> = files(&out.join("bands")).into_keys().collect();
        assert!(kept.len() >= 3, "{kept:?}");
        let band = |i: usize| out.join("bands").join(&kept[i]);
        // One band was not reached, another only half written.
        std::fs::remove_file(band(kept.len() - 1)).expect("a band");
        let half = std::fs::read(band(1)).expect("a band");
        std::fs::write(band(1), &half[..half.len() / 2]).expect("a band");
        if spoil {
            // The last numbers of a band are the signal to noise ratios.
            let mut bytes = std::fs::read(band(0)).expect("a band");
            let last = bytes.len() - 4;
            bytes[last..].copy_from_slice(&99f32.to_le_bytes());
            std::fs::write(band(0), bytes).expect("a band");
        }
        std::fs::remove_file(out.join("map.zarr")).expect("the file");
        map(folder.path(), &name, &["--in-bands"]);
        // What was kept is used, and nothing else changes.
        assert_eq!(files(&out) == straight, !spoil);
    }
}

/// What calibration and a given drift do to the lengths of a survey.
#[test]
fn surveys_are_calibrated() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scanner.toml");
    let text = "schema = \"moiregauge/calibration/1\"\n[calibration]\ngain_percent = 2.0\n\
                mismatch_percent = 0.0\northogonality_mrad = 0.0\n\
                covariance = [[1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0], [0.0, 0.0, 1e-6]]\n\
                coordinates = \"nominal\"\n";
    std::fs::write(&file, text).expect("a file");
    let plain = map(folder.path(), "plain", &["--in-bands"]);
    let file = file.display().to_string();
    let right = map(
        folder.path(),
        "right",
        &["--in-bands", "--calibration", &file],
    );
    for name in ["wavelength 1", "wavelength 2", "wavelength 3"] {
        let mean = |r: &Value| quantity(r, name)["mean"].as_f64().expect("a mean");
        let ratio = mean(&plain) / mean(&right);
        assert!((ratio - 1.02).abs() < 1e-4, "{name}: {ratio}");
    }
    // Without times nothing is known of a drift, and that is said.
    let drift = ["--in-bands", "--drift", "1.0", "0.0"];
    let still = map(folder.path(), "still", &drift);
    assert!(
        still["caveats"]
            .to_string()
            .contains("not corrected for the drift")
    );
}
