//! Maps from the command line: whole, in bands, by tiles.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use moiregauge::simulate::FieldScene;
use serde_json::Value;

use crate::common::{program, run, succeed};

/// 16 pixels per period, 0.7 nm per pixel: 11.2 nm.
const PERIOD: f64 = 16.0;
const PITCH: f64 = 0.7;
const SIDE: usize = 400;

/// A simulated image as an array, top line first.
fn array(folder: &Path) -> String {
    let mut scene = FieldScene::hexagonal([SIDE, SIDE], PERIOD, 0.3);
    scene.white = 0.6;
    let image = scene.image();
    let header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({SIDE}, {SIDE}), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for row in (0..SIDE).rev() {
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
