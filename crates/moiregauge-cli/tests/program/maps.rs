//! Maps from the command line: whole, in bands, by tiles.

use std::path::Path;
use std::process::Command;

use moiregauge::frame::Image;
use moiregauge::simulate::{DomainScene, FieldScene};
use serde_json::Value;

use crate::common::{caveats, json, number, program, run, simulate, succeed, testdata};
use crate::schema::problems;

/// 16 pixels per period, 0.7 nm per pixel: 11.2 nm.
const PERIOD: f64 = 16.0;
pub(crate) const PITCH: f64 = 0.7;
const SIDE: usize = 400;

/// A simulated image as an array.
fn array(folder: &Path) -> String {
    let mut scene = FieldScene::hexagonal([SIDE, SIDE], PERIOD, 0.3);
    scene.white = 0.6;
    written(folder, &scene.image())
}

/// An image as an array, top line first.
pub(crate) fn written(folder: &Path, image: &Image) -> String {
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
pub(crate) fn command(folder: &Path, name: &str, options: &[&str]) -> Command {
    let side = SIDE as f64 * PITCH;
    let size = format!("{side}nm×{side}nm");
    let mut command = program();
    command.arg("map").arg(array(folder)).arg("--out");
    command.arg(folder.join(name)).args(["--size", &size]);
    command.args(["--no-report", "--quiet"]).args(options);
    command
}

pub(crate) fn map(folder: &Path, name: &str, options: &[&str]) -> Value {
    succeed(&mut command(folder, name, options));
    let text = std::fs::read(folder.join(name).join("map.json")).expect("map.json");
    serde_json::from_slice(&text).expect("JSON")
}

pub(crate) fn quantity<'a>(results: &'a Value, name: &str) -> &'a Value {
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
        assert!(!there.join("moiregauge-unfinished").exists(), "{name}");
    }
}

/// Two lattices side by side are one map, each node of its own grain, and no mean of both; one of them alone is a map of its own.
#[test]
fn grains_are_two_lattices_of_one_map() {
    let Some(data) = testdata("grains_are_two_lattices_of_one_map") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let input = data.join("hard/two_grains/two_grains.npy");
    let truth = json(&data.join("hard/two_grains/truth.json"));
    let wanted = ["left", "right"].map(|side| number(&truth, &format!("/{side}_theta_deg")));
    let mapped = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let mut command = program();
        command
            .arg("map")
            .arg(&input)
            .args(["--size", "256nm×256nm"]);
        command.args(["--no-report", "--quiet", "--out"]).arg(&out);
        succeed(command.args(more));
        (json(&out.join("map.json")), out)
    };
    let (results, out) = mapped("both", &[]);
    follows_schema(&results);
    let grains = results["details"]["grains"].as_array().expect("grains");
    assert_eq!(grains.len(), 2);
    let mut seen: Vec<f64> = Vec::new();
    for grain in grains {
        let mean = number(grain, "/twist_deg/mean");
        let nearest = wanted
            .into_iter()
            .min_by(|a, b| (a - mean).abs().total_cmp(&(b - mean).abs()));
        let nearest = nearest.expect("two");
        let sigma = number(grain, "/twist_deg/sigma");
        assert!(
            sigma < 0.0005 && (mean - nearest).abs() < 4.0 * sigma,
            "{mean} ± {sigma}, {nearest}"
        );
        // Neither varies: nodes of one in the other would make a spread of a hundredth of a degree.
        assert!(
            number(grain, "/twist_deg/spread_below_95") < 0.002,
            "{grain}"
        );
        assert!(number(grain, "/area_nm2") > 10_000.0, "{grain}");
        seen.push(nearest);
    }
    seen.sort_by(f64::total_cmp);
    assert_eq!(seen, wanted);
    assert_eq!(results["quantities"].as_array().map(Vec::len), Some(0));
    assert!(results["whole_image"].is_null());
    assert!(caveats(&results).contains(&"map-of-grains"));
    assert!(out.join("map.zarr/grain/zarr.json").exists());
    assert!(!out.join("displacement.csv").exists());
    let (alone, out) = mapped("one", &["--grain", "2"]);
    let twist = quantity(&alone, "twist")["mean"].as_f64().expect("a mean");
    let second = number(&grains[1], "/twist_deg/mean");
    assert!((twist - second).abs() < 0.001, "{twist} {second}");
    assert!(out.join("displacement.csv").exists());
}

/// Sets of two slow axes show the same two grains: each is in one map with the other, and has the numbers of all sets that show it.
#[test]
fn grains_are_followed_over_slow_axes() {
    let folder = tempfile::tempdir().expect("a folder");
    let sample = "grains:twist=0.05,turn=3,share=0.5,angle=20";
    let sets = ["x", "y"].map(|slow| {
        let options = ["--slow", slow, "--scans", "2", "--pixels", "256"];
        let size = ["--size", "140", "140", "--sample", sample, "--seed", "3"];
        let set = folder.path().join(slow);
        simulate(&set, &[options.as_slice(), &size].concat())
    });
    let out = folder.path().join("maps");
    let mut command = program();
    command.arg("map").args(&sets).arg("--out").arg(&out);
    succeed(command.args(["--no-report", "--quiet"]));
    let results = json(&out.join("map.json"));
    follows_schema(&results);
    let truth = json(&sets[0].join("truth.json"));
    let grains = results["details"]["grains"].as_array().expect("grains");
    assert_eq!(grains.len(), 2);
    let mut seen: Vec<usize> = Vec::new();
    for grain in grains {
        let [mean, sigma] =
            ["mean", "sigma"].map(|key| number(grain, &format!("/twist_deg/{key}")));
        let off = |i: usize| {
            let wanted = number(&truth, &format!("/sample/grains/{i}/mean/twist_deg"));
            (mean - wanted).abs()
        };
        let nearest = usize::from(off(1) < off(0));
        assert!(
            sigma < 0.003 && off(nearest) < 4.0 * sigma,
            "{mean} ± {sigma}"
        );
        seen.push(nearest);
    }
    seen.sort_unstable();
    assert_eq!(seen, [0, 1]);
    assert!(caveats(&results).contains(&"map-of-grains"));
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

pub(crate) fn follows_schema(results: &Value) {
    let errors = problems(&moiregauge_report::map_schema(), results);
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
        "undistorted",
        "cell",
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
    let field = rows(&out.join("displacement.csv"));
    let masks: Vec<f64> = column(&field, "mask");
    let known = column(&field, "registry_x_nm").len();
    assert!(masks.len() == field.len() - 1 && known > 0);
    assert!(known <= masks.iter().filter(|m| **m == 0.0).count());
    let cell = rows(&out.join("cell.csv"));
    assert_eq!(column(&cell, "mean").len(), cell.len() - 1);
    for group in ["undistorted/image", "cell/mean", "registry_x_sigma"] {
        assert!(out.join(format!("map.zarr/{group}/zarr.json")).exists());
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
            "lies outside the map, which reaches from",
        ),
        (
            ["--region", "two=0,0 10,10"],
            "at least three corners, found 2",
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
    assert!((0.8..1.25).contains(&(spread / noise)), "{spread} {noise}");
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
    // In bands the same mesh is found in blocks of pixels.
    let bands = map(&folder.path().join("bands"), &["--in-bands", "--no-report"]);
    assert_eq!(bands["details"]["regime"]["use_of"], "domains");
    let of = |key: &str| number(&bands, &format!("/details/domains/{key}"));
    let share = of("triangles") / number(details, "/domains/triangles");
    assert!((0.9..1.1).contains(&share), "{share}");
    let noise = of("twist_noise_deg");
    assert!((of("median_twist_deg") - truth).abs() < 0.6 * noise);
    let off = map(
        &folder.path().join("off"),
        &["--domains", "off", "--no-report"],
    );
    assert_eq!(off["details"]["regime"]["use_of"], "phase map");
    assert!(caveats(&off).contains(&"phases-in-doubt"));
    assert!(off["details"]["domains"].is_null());
}
