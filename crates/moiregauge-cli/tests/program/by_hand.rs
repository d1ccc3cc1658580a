//! What the eye knows better than the search: which lattice is meant, and where it is.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::{
    analyze, caveats, json, number, program, results, simulate, succeed, testdata,
};

/// The two grains of an independent example, 256 nm wide with the boundary near the middle, as they are measured with some options.
fn grain(data: &Path, options: &[&str]) -> Value {
    let folder = tempfile::tempdir().expect("a folder");
    let image = data.join("hard/two_grains/two_grains.npy");
    let mut command = analyze(&image, folder.path());
    succeed(command.args(["--size", "256nmx256nm"]).args(options));
    results(folder.path())
}

fn twist(results: &Value) -> [f64; 2] {
    ["value", "sigma"].map(|part| number(results, &format!("/sets/0/uncorrected/twist_deg/{part}")))
}

/// A mask of columns, as an array of bytes.
fn mask(folder: &Path, name: &str, used: impl Fn(usize) -> bool) -> PathBuf {
    let mut header = "{'descr': '|u1', 'fortran_order': False, 'shape': (512, 512), }".to_owned();
    header.push_str(&" ".repeat(117 - header.len()));
    header.push('\n');
    let path = folder.join(format!("{name} für die Maske.npy"));
    let mut file = std::fs::File::create(&path).expect("a file");
    file.write_all(b"\x93NUMPY\x01\x00").expect("a header");
    let length = u16::try_from(header.len()).expect("short");
    file.write_all(&length.to_le_bytes()).expect("a length");
    file.write_all(header.as_bytes()).expect("a header");
    let row: Vec<u8> = (0..512).map(|c| u8::from(used(c))).collect();
    file.write_all(&row.repeat(512)).expect("pixels");
    path
}

/// Each grain by its box, its polygon and its mask: the same twist, that of the generator, and no word of a second one.
#[test]
fn a_part_of_the_frame_is_measured_alone() {
    let Some(data) = testdata("a_part_of_the_frame_is_measured_alone") else {
        return;
    };
    let truth = json(&data.join("hard/two_grains/truth.json"));
    let folder = tempfile::tempdir().expect("a folder");
    let left = mask(folder.path(), "left", |column| column < 200);
    let right = mask(folder.path(), "right", |column| column >= 320);
    for (name, options) in [
        ("left", ["--region", "0,0,100nm,0.256um"]),
        ("right", ["--region", "160,0 256,0 256,256 160,256"]),
        ("left", ["--mask", left.to_str().expect("a name")]),
        ("right", ["--mask", right.to_str().expect("a name")]),
    ] {
        let found = grain(&data, &options);
        let [value, sigma] = twist(&found);
        let wanted = number(&truth, &format!("/{name}_theta_deg"));
        // The file gives three decimals.
        let off = (value - wanted).abs();
        assert!(off < 4.0 * sigma + 0.0005, "{options:?}: {value} ± {sigma}");
        assert!(sigma < 0.001, "{options:?}: {sigma}");
        let codes = caveats(&found);
        assert!(!codes.contains(&"several-grains"), "{options:?}: {codes:?}");
        assert!(codes.contains(&"partly-covered"), "{options:?}: {codes:?}");
    }
}

/// The lattice near given vectors or a wavelength is measured, and the choice stands in the results.
#[test]
fn the_lattice_that_was_told_is_measured() {
    let Some(data) = testdata("the_lattice_that_was_told_is_measured") else {
        return;
    };
    let truth = json(&data.join("hard/two_grains/truth.json"));
    let near = grain(&data, &["--near", "12nm"]);
    let [value, sigma] = twist(&near);
    let miss = ["/left_theta_deg", "/right_theta_deg"].map(|g| (value - number(&truth, g)).abs());
    assert!(miss[0].min(miss[1]) < 5.0 * sigma, "{value} ± {sigma}");
    assert_eq!(number(&near, "/settings/by_hand/near_nm"), 12.0);
    let lattice = grain(
        &data,
        &["--region", "0,0,100,256", "--lattice", "6.6,10.1,-5.0,11.7"],
    );
    let [value, sigma] = twist(&lattice);
    let off = (value - number(&truth, "/left_theta_deg")).abs();
    assert!(off < 4.0 * sigma + 0.0005, "{value} ± {sigma}");
}

/// Bands of less than a period, with gaps of a period and a half between them, tell the lattice together: phases under windows leave
/// whole turns from band to band open.
#[test]
fn bands_that_a_mask_leaves_are_one_lattice() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = simulate(folder.path(), &["--pixels", "512", "--scans", "2"]);
    let truth = json(&scans.join("truth.json"));
    let wanted = number(&truth, "/twist_deg");
    for radius in [34.0, 48.0, 62.0] {
        let bands = mask(folder.path(), "bands", |column| {
            let apart = |middle: f64| (column as f64 - 512.0 * middle).abs();
            apart(0.3) > radius && apart(0.7) > radius
        });
        let out = folder.path().join(radius.to_string());
        let mut command = analyze(&scans, &out);
        succeed(command.arg("--mask").arg(&bands));
        let found = results(&out);
        let [value, sigma] = ["value", "sigma"]
            .map(|part| number(&found, &format!("/sets/0/mean/twist_deg/{part}")));
        let error = (value - wanted) / sigma;
        assert!(error.abs() < 5.0, "{radius}: {value} ± {sigma}");
        assert!(sigma < 1e-3, "{radius}: {value} ± {sigma}");
    }
}

/// Each grain alone by its number, with the numbers that it has beside the other; the record of the run repeats it.
#[test]
fn a_grain_is_chosen_by_its_number() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = folder.path();
    let sample = [
        "--size",
        "160",
        "160",
        "--sample",
        "grains:share=0.6,turn=8",
    ];
    let scans = simulate(
        place,
        &[&["--pixels", "128", "--scans", "2"], &sample[..]].concat(),
    );
    let found = |name: &str, options: &[&str]| {
        let out = place.join(name);
        let mut command = analyze(&scans, &out);
        succeed(command.args(["--strain-draws", "0"]).args(options));
        results(&out)
    };
    let both = found("both", &[]);
    assert_eq!(both["sets"].as_array().expect("sets").len(), 2);
    for (index, grain) in ["1", "2"].into_iter().enumerate() {
        let alone = found(grain, &["--grain", grain]);
        let sets = alone["sets"].as_array().expect("sets");
        assert_eq!(sets.len(), 1);
        let name = sets[0]["name"].as_str().expect("a name");
        assert!(name.ends_with(&format!("grain {grain}")), "{name}");
        assert_eq!(sets[0]["mean"], both["sets"][index]["mean"]);
        assert_eq!(alone["settings"]["grain"].to_string(), grain);
    }
    let record = place.join("2/results.json");
    let again = place.join("again");
    let mut replay = program();
    replay.args(["analyze", "--replay"]).arg(&record);
    succeed(replay.arg("--out").arg(&again));
    assert_eq!(results(&again)["sets"], json(&record)["sets"]);
    for (grain, expected) in [("3", "no scan shows a grain 3"), ("0", "from 1 to 16")] {
        let mut command = analyze(&scans, &place.join("none"));
        let run = command
            .args(["--grain", grain])
            .output()
            .expect("the program runs");
        assert!(!run.status.success());
        let words = String::from_utf8_lossy(&run.stderr);
        assert!(words.contains(expected), "{words}");
    }
}

/// What is not there is refused with the reason, and so is a mask of another size.
#[test]
fn what_was_told_wrongly_is_refused() {
    let Some(data) = testdata("what_was_told_wrongly_is_refused") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let image = data.join("hard/hole");
    let other = mask(folder.path(), "other", |_| true);
    for (options, expected) in [
        (["--near", "300nm"], "no lattice like the given one"),
        (["--mask", other.to_str().expect("a name")], "512 × 512"),
        (["--lattice", "10,0,20,0"], "must not be parallel"),
        (["--region", "0,0 1,1"], "three corners"),
    ] {
        let mut command = analyze(&image, &folder.path().join("out"));
        let run = command.args(options).output().expect("the program runs");
        assert!(!run.status.success(), "{options:?}");
        let words = String::from_utf8_lossy(&run.stderr);
        assert!(words.contains(expected), "{options:?}: {words}");
    }
}
