//! Surveys: images mapped in bands, stopped and gone on with, calibrated, and real images mapped as a whole.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use moiregauge::frame::Image;
use moiregauge::simulate::FieldScene;
use nalgebra::{Matrix2, Vector2};
use serde_json::Value;

use crate::common::{caveats, json, number, program, run, succeed, testdata};
use crate::maps::{PITCH, command, map, quantity};

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

/// A survey that is stopped goes on with the bands it has, and ends with the same bytes as one that is not: a band that is
/// cut off, or in which a single bit is another one, is made again.
#[test]
fn an_interrupted_survey_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    map(folder.path(), "straight", &["--in-bands"]);
    let straight = files(&folder.path().join("straight"));
    assert!(straight.contains_key(Path::new("map.json")));
    let out = folder.path().join("stopped");
    let parts = out.join("moiregauge-unfinished").join("parts");
    // A region beyond the map stops the program when all bands are done.
    let beyond = ["--in-bands", "--region", "far=9000,9000,10,10"];
    let stopped = run(&mut command(folder.path(), "stopped", &beyond));
    assert_eq!(stopped.code, Some(1), "{}", stopped.stderr);
    assert!(!out.join("map.json").exists());
    let kept: Vec<PathBuf> = files(&parts).into_keys().collect();
    assert!(kept.len() >= 3, "{kept:?}");
    let spoil = |band: usize, change: &dyn Fn(&mut Vec<u8>)| {
        let path = parts.join(&kept[band]);
        let mut bytes = std::fs::read(&path).expect("a band");
        change(&mut bytes);
        std::fs::write(&path, bytes).expect("a band");
    };
    // One bit of a number in the middle; a band that is half there; one that was not reached.
    spoil(0, &|bytes| {
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
    });
    spoil(1, &|bytes| bytes.truncate(bytes.len() / 2));
    std::fs::remove_file(parts.join(&kept[kept.len() - 1])).expect("a band");
    let whole = succeed(&mut command(folder.path(), "stopped", &["--in-bands"]));
    assert!(
        whole.stderr.contains("band 1 was damaged"),
        "{}",
        whole.stderr
    );
    assert!(
        whole.stderr.contains("band 2 was damaged"),
        "{}",
        whole.stderr
    );
    assert!(
        !whole.stderr.contains("band 3 was damaged"),
        "{}",
        whole.stderr
    );
    assert!(files(&out) == straight);
}

/// A simple field (`.gsf`) of part of an image, top line first; `first` is its first pixel (column, row) and says where it lies.
fn simple_field(path: &Path, image: &Image, first: [usize; 2], size: [usize; 2]) {
    let part = image.cropped(first, size);
    let metres = |pixels: usize| pixels as f64 * PITCH * 1e-9;
    let header = format!(
        "Gwyddion Simple Field 1.0\nXRes = {}\nYRes = {}\nXReal = {:e}\nYReal = {:e}\nXOffset = {:e}\n\
         YOffset = {:e}\nXYUnits = m\nZUnits = m\nTitle = Height\n",
        size[0],
        size[1],
        metres(size[0]),
        metres(size[1]),
        metres(first[0]),
        metres(first[1]),
    );
    let mut bytes = header.into_bytes();
    bytes.resize((bytes.len() / 4 + 1) * 4, 0);
    for row in (0..part.rows).rev() {
        bytes.extend(part.row(row).iter().flat_map(|v| (*v as f32).to_le_bytes()));
    }
    std::fs::write(path, bytes).expect("a file");
}

/// Maps files in bands.
fn survey(folder: &Path, files: &[&str], options: &[&str]) -> Value {
    let mut command = program();
    let out = folder.join(format!("{}-{}", files.concat(), options.len()));
    command
        .arg("map")
        .args(files.iter().map(|f| folder.join(f)));
    command
        .args(["--in-bands", "--no-report", "--quiet", "--out"])
        .arg(&out);
    succeed(command.args(options));
    json(&out.join("map.json"))
}

/// Four files of one surface, written with their stage offsets, give the map of the whole: the same extent, and the same
/// numbers in boxes of it, one across the seams.
#[test]
fn parts_of_a_survey_lie_where_they_were() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut scene = FieldScene::rippled(420, 37.5, 0.03);
    scene.white = 0.6;
    let image = scene.image();
    simple_field(&folder.path().join("all.gsf"), &image, [0, 0], [420, 420]);
    // They overlap, as the margin of each has no good nodes.
    let names = ["a.gsf", "b.gsf", "c.gsf", "d.gsf"];
    let firsts = [[0, 0], [168, 0], [0, 168], [168, 168]];
    for (name, first) in names.iter().zip(firsts) {
        simple_field(&folder.path().join(name), &image, first, [252, 252]);
    }
    let boxes = [
        "--region",
        "seam=105,105,84,84",
        "--region",
        "corner=210,210,42,42",
        "--window",
        "9",
    ];
    let whole = survey(folder.path(), &["all.gsf"], &boxes);
    let parts = survey(folder.path(), &names, &boxes);
    for axis in 0..2 {
        for end in 0..2 {
            let of = |r: &Value| number(r, &format!("/extent_nm/{axis}/{end}"));
            let apart = (of(&whole) - of(&parts)).abs();
            assert!(
                apart < 5.0,
                "{apart} nm: {} {}",
                whole["extent_nm"],
                parts["extent_nm"]
            );
        }
    }
    for region in 0..2 {
        let of =
            |r: &Value, key: &str| number(r, &format!("/details/regions/{region}/twist_deg/{key}"));
        let apart = (of(&whole, "mean") - of(&parts, "mean")).abs();
        // The same pixels: what differs is which nodes are there, and the noise that the files see at their edges.
        assert!(
            apart < 1.5 * of(&whole, "sigma"),
            "{region}: {apart} {}",
            of(&whole, "sigma")
        );
    }
}

/// A hexagonal lattice recorded while the sample drifts, whose drift is given with the line rate: twist and strain are those
/// of the lattice at rest. Pixel (i, j) of an upward trace shows the sample at `(p i − Dₓ t, p j − D_y t)`, t = (i/2N + j)/f.
#[test]
fn surveys_are_corrected_for_a_given_drift() {
    let folder = tempfile::tempdir().expect("a folder");
    let (rate, drift) = (0.5, [0.6, -0.9]);
    let mut scene = FieldScene::hexagonal([400, 400], 16.0, 0.3);
    let velocity = Vector2::new(drift[0] / 60.0, drift[1] / 60.0);
    let time = Vector2::new(0.5 / 400.0, 1.0) / rate;
    let to_sample = Matrix2::identity() * PITCH - velocity * time.transpose();
    scene.pair = to_sample.tr_mul(&(scene.pair / PITCH));
    scene.white = 0.6;
    simple_field(
        &folder.path().join("drifting.gsf"),
        &scene.image(),
        [0, 0],
        [400, 400],
    );
    let told = [
        "--line-rate",
        "0.5",
        "--frame-direction",
        "up",
        "--drift",
        "0.6",
        "-0.9",
    ];
    let right = survey(folder.path(), &["drifting.gsf"], &told);
    let truth = 2.0 * (0.246 / (2.0 * 16.0 * PITCH)).asin().to_degrees();
    let twist = quantity(&right, "twist");
    let error = (number(twist, "/mean") - truth).abs();
    assert!(error < 3.0 * number(twist, "/mean_sigma"), "{twist}");
    for name in ["strain vector 1", "strain vector 2"] {
        let component = quantity(&right, name);
        let pull = number(component, "/mean") / number(component, "/mean_sigma");
        assert!(pull.abs() < 3.0, "{component}");
    }
    // Without it the strain would be many times its error.
    let wrong = survey(folder.path(), &["drifting.gsf"], &[]);
    let component = quantity(&wrong, "strain vector 2");
    assert!(number(component, "/mean").abs() > 20.0 * number(component, "/mean_sigma"));
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
