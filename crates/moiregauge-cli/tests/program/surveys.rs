//! Surveys: images mapped in bands, stopped and gone on with, calibrated, and real images mapped as a whole.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::{caveats, json, number, program, run, succeed, testdata};
use crate::maps::{command, map, quantity};

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
    let text = "schema = \"moiregauge/calibration/1\"\nversion = \"0\"\n[calibration]\ngain_percent = 2.0\n\
                mismatch_percent = 0.0\northogonality_mrad = 0.0\n\
                covariance = [[1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0], [0.0, 0.0, 1e-6]]\n\
                coordinates = \"nominal\"\n\
                [known_lattice]\nname = \"graphite\"\na_nm = 0.2461\nb_nm = 0.2461\nangle_deg = 120.0\n\
                sigma_percent = 0.04\nsource = \"the test\"\n";
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

/// Maps of real images: at the middle of the frame the plane through the good nodes is the fit of the whole image, within
/// three errors of both, and plane and noise explain the spread: what is left is below the error of a node.
#[test]
fn real_images_have_maps() {
    let Some(data) = testdata("real_images_have_maps") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    for (name, channel) in [
        ("moire_nanomesh_10nm", "Z"),
        ("moire_nanomesh_10nm", "Current"),
        ("si111_7x7_20nm", "Z"),
        ("si111_7x7_20nm", "Current"),
    ] {
        let out = folder.path().join(format!("{name}-{channel}"));
        let file = data.join(format!("real/nanonis/{name}.sxm"));
        let mut command = program();
        command.arg("map").arg(file).arg("--out").arg(&out);
        succeed(command.args(["--no-report", "--quiet", "--channel", channel]));
        let results = json(&out.join("map.json"));
        let twist = quantity(&results, "twist");
        let of = |key: &str| number(twist, &format!("/{key}"));
        let whole = |key: &str| number(&results, &format!("/whole_image/twist_deg/{key}"));
        let off = (of("trend/middle") - whole("value")).abs();
        let sigma = of("trend/middle_sigma").hypot(whole("sigma"));
        assert!(off < 3.0 * sigma, "{name} {channel}: {off} {sigma} {twist}");
        assert!(of("trend/rest") < of("noise"), "{name} {channel}: {twist}");
        // 2.5 periods leave no margin of two windows, and that is said.
        let narrow = caveats(&results).contains(&"map-narrow-margin");
        assert_eq!(narrow, name == "moire_nanomesh_10nm");
    }
}
