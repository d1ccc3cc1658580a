//! Maps from the command line: whole, in bands, by tiles.

use std::path::Path;

use moiregauge::simulate::FieldScene;
use serde_json::Value;

use crate::common::{program, succeed};

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

fn map(folder: &Path, name: &str, options: &[&str]) -> Value {
    let file = array(folder);
    let out = folder.join(name).display().to_string();
    let side = SIDE as f64 * PITCH;
    let size = format!("{side}nm×{side}nm");
    let mut args = vec![
        "map",
        &file,
        "--out",
        &out,
        "--size",
        &size,
        "--no-report",
        "--quiet",
    ];
    args.extend(options);
    succeed(program().args(&args));
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
