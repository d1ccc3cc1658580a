//! Samples that are no perfect lattice, written by an independent generator.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::{
    analyze, caveats, json, number, program, results, run, simulate, succeed, testdata,
};

/// What an analysis of an example makes of it, and its truth.
fn analysed(data: &Path, name: &str, more: &[&str]) -> (Value, Value) {
    let folder = tempfile::tempdir().expect("a folder");
    let input = data.join("hard").join(name);
    let array = input.join(format!("{name}.npy"));
    let input = if array.exists() { array } else { input };
    succeed(analyze(&input, folder.path()).args(more));
    let truth = json(&data.join("hard").join(name).join("truth.json"));
    (results(folder.path()), truth)
}

/// The twist of the first set, and its statistical error.
fn twist(results: &Value, of: &str) -> [f64; 2] {
    ["value", "sigma"].map(|part| number(results, &format!("/sets/0/{of}/twist_deg/{part}")))
}

/// Half of the frame, all but a hole, a disc of a quarter of it: the lattice is measured where it is, and said to be there.
#[test]
fn a_lattice_in_a_part_of_the_frame_is_measured_there() {
    let Some(data) = testdata("a_lattice_in_a_part_of_the_frame_is_measured_there") else {
        return;
    };
    for name in ["half_covered", "hole", "island"] {
        let (found, truth) = analysed(&data, name, &[]);
        assert_eq!(found["sets"].as_array().map(Vec::len), Some(1), "{name}");
        let [value, sigma] = twist(&found, "mean");
        let wanted = number(&truth, "/theta_deg");
        // The file gives three decimals.
        let room = 3.0 * sigma + 0.0005;
        assert!(
            (value - wanted).abs() < room,
            "{name}: {value} ± {sigma}, {wanted}"
        );
        assert!(sigma < 0.003, "{name}: {sigma}");
        for (i, axis) in ["x", "y"].iter().enumerate() {
            let drift = |part| number(&found, &format!("/sets/0/drift/{axis}_nm_per_min/{part}"));
            let wanted = number(&truth, &format!("/drift_nm_per_min/{i}"));
            let off = (drift("value") - wanted).abs();
            assert!(
                off < 4.0 * drift("sigma") + 0.0005,
                "{name}: {off} along {axis}"
            );
        }
        let codes = caveats(&found);
        assert!(codes.contains(&"partly-covered"), "{name}: {codes:?}");
        assert!(!codes.contains(&"same-scan-twice"), "{name}: {codes:?}");
    }
}

/// Layers do not hold a strain of 7 % on each other: such a lattice has vectors and no twist, unless it is named by hand.
#[test]
fn strain_that_no_layers_hold_has_no_twist() {
    let folder = tempfile::tempdir().expect("a folder");
    let sample = ["--twist", "9", "--strain", "7", "--size", "18", "18"];
    let frames = ["--pixels", "192", "--scans", "4", "--name", "set"];
    let mut simulate = program();
    simulate.args(["simulate", "--out"]).arg(folder.path());
    succeed(simulate.args(sample).args(frames));
    let (set, out) = (folder.path().join("set"), folder.path().join("results"));
    let run = |more: &[&str]| {
        let ran = analyze(&set, &out).args(more).output();
        ran.expect("the program runs");
        results(&out)
    };
    let found = run(&[]);
    let codes = caveats(&found);
    assert!(codes.contains(&"layers-cannot-make-it"), "{codes:?}");
    assert!(found["sets"][0]["mean"].is_null());
    let by_hand = run(&["--near", "1.6", "--force"]);
    let [value, sigma] = twist(&by_hand, "mean");
    assert!(
        (value - 9.0).abs() < 5.0 * sigma + 0.01,
        "{value} ± {sigma}"
    );
}

/// Rough ground has waves of which some three make a lattice by chance; that there are many as strong tells.
#[test]
fn what_is_one_of_many_is_no_lattice() {
    for seed in ["3", "101", "176"] {
        let (_folder, [set, out]) = varied("bare+terrain", seed);
        let said = run(&mut analyze(&set, &out));
        assert_ne!(said.code, Some(0), "{seed}");
        assert!(!out.join("results.json").exists(), "{seed}");
    }
}

/// First shells that noise hides in single images: of one set in most of them, of another in both directions of some scans, of the third in
/// all that its images could say one by one; of the fourth one line in eight knows nothing of it, and one of its waves stands along the slow axis in the
/// last, where the offsets of lines hide it. Ground that is taken off a set with an edge has its waves.
#[test]
fn a_first_shell_that_hides_is_found() {
    let seeds = ["1", "116", "120", "33", "242"].map(|seed| ("second-shell", seed));
    for (sample, seed) in [&seeds[..], &[("second-shell+edge", "6")]].concat() {
        let (_folder, [set, out]) = varied(sample, seed);
        succeed(&mut analyze(&set, &out));
        let [value, sigma] = twist(&results(&out), "mean");
        let wanted = number(&json(&set.join("truth.json")), "/twist_deg");
        assert!(
            (value - wanted).abs() < 4.0 * sigma,
            "{seed}: {value} ± {sigma}, {wanted}"
        );
        assert!(sigma < 2e-4, "{seed}: {sigma}");
    }
}

/// Rough ground hides the first waves of sharp walls. A lattice that changes around a hole, and by more than windows show of it in single images, gives its mean.
#[test]
fn what_is_hard_to_see_is_right() {
    let cases = [
        ("walls+terrain", "6", 0.004, None),
        ("twist-wave+hole", "1", 0.002, Some("changing-lattice")),
    ];
    for (sample, seed, most, word) in cases {
        let (_folder, [set, out]) = varied(sample, seed);
        succeed(&mut analyze(&set, &out));
        let found = results(&out);
        let [value, sigma] = twist(&found, "mean");
        let wanted = number(&json(&set.join("truth.json")), "/sample/mean/twist_deg");
        assert!(
            (value - wanted).abs() < 4.0 * sigma && sigma < most,
            "{sample}: {value} ± {sigma}, {wanted}"
        );
        assert!(
            word.is_none_or(|word| caveats(&found).contains(&word)),
            "{sample}"
        );
    }
}

/// A simulated set of a class with numbers of its own, and where its results go.
fn varied(sample: &str, seed: &str) -> (tempfile::TempDir, [PathBuf; 2]) {
    let folder = tempfile::tempdir().expect("a folder");
    let numbers = ["--vary", "--scans", "4", "--pixels", "192", "--seed", seed];
    let options = [&["--sample", sample], numbers.as_slice()].concat();
    let set = simulate(folder.path(), &options);
    let out = folder.path().join("results");
    (folder, [set, out])
}

/// Sharp stripes and a lattice lie near the points of one lattice of twice its size, 0.3 cycles per frame beside them: the lattice is measured, the stripes
/// are told.
#[test]
fn waves_beside_the_points_of_a_lattice_are_none_of_its() {
    let (_folder, [set, out]) = varied("stripes", "45");
    succeed(&mut analyze(&set, &out));
    let found = results(&out);
    let [value, sigma] = twist(&found, "mean");
    let wanted = number(&json(&set.join("truth.json")), "/twist_deg");
    assert!(
        (value - wanted).abs() < 4.0 * sigma,
        "{value} ± {sigma}, {wanted}"
    );
    assert!(caveats(&found).contains(&"second-lattice"));
}

/// Of two grains one has frames that do not fit each other: its twist is told with an error that holds and a warning, and the other is right.
#[test]
fn a_grain_whose_frames_do_not_fit_is_imprecise() {
    let (_folder, [set, out]) = varied("grains", "84");
    succeed(&mut analyze(&set, &out));
    let (found, truth) = (results(&out), json(&set.join("truth.json")));
    let sets = found["sets"].as_array().expect("sets");
    assert_eq!(sets.len(), 2);
    is_grain(&sets[0], &truth, 1, 5e-4);
    is_grain(&sets[1], &truth, 0, 0.5);
    let codes = caveats(&found);
    assert!(codes.contains(&"twist-imprecise") && codes.contains(&"drift-undetermined"));
}

/// A strip between two grains is no lattice: in one frame it passed for the smaller of them, whose set then contradicted the other.
#[test]
fn a_strip_is_no_grain() {
    let (_folder, [set, out]) = varied("grains", "55");
    succeed(&mut analyze(&set, &out));
    let (found, truth) = (results(&out), json(&set.join("truth.json")));
    let sets = found["sets"].as_array().expect("sets");
    assert_eq!(sets.len(), 2);
    is_grain(&sets[0], &truth, 1, 5e-4);
    is_grain(&sets[1], &truth, 0, 3e-3);
}

/// The twist of a set is that of a grain within four errors, which are below a limit, degrees.
fn is_grain(set: &Value, truth: &Value, grain: usize, limit: f64) {
    let [value, sigma] =
        ["value", "sigma"].map(|key| number(set, &format!("/mean/twist_deg/{key}")));
    let wanted = number(truth, &format!("/sample/grains/{grain}/mean/twist_deg"));
    assert!(
        (value - wanted).abs() < 4.0 * sigma,
        "{value} ± {sigma}, {wanted}"
    );
    assert!(sigma < limit, "{sigma}");
}

/// A third grain that is seen in one line of one scan, from which no drift is known, has no twist of 3.4 ± 4.8°.
#[test]
fn a_grain_of_one_line_has_no_twist() {
    let (_folder, [set, out]) = varied("grains", "42");
    succeed(&mut analyze(&set, &out));
    let found = results(&out);
    let sets = found["sets"].as_array().expect("sets");
    let with_twist = sets.iter().filter(|set| !set["mean"].is_null()).count();
    assert_eq!((sets.len(), with_twist), (3, 2));
    assert!(caveats(&found).contains(&"drift-undetermined"));
}

/// Sharp walls make harmonics of any order, and a weak first shell is a first shell: one perfect lattice without a doubt.
#[test]
fn unusual_contrast_is_no_second_lattice() {
    let Some(data) = testdata("unusual_contrast_is_no_second_lattice") else {
        return;
    };
    for name in ["walls", "second_shell"] {
        let (found, truth) = analysed(&data, name, &[]);
        let [value, sigma] = twist(&found, "mean");
        let wanted = number(&truth, "/theta_deg");
        assert!(
            (value - wanted).abs() < 4.0 * sigma + 0.0005,
            "{name}: {value} ± {sigma}, {wanted}"
        );
        let codes = caveats(&found);
        assert!(!codes.contains(&"second-lattice"), "{name}: {codes:?}");
    }
}

/// A lattice that changes gives the mean over the area, with a word.
#[test]
fn a_lattice_that_changes_gives_its_mean() {
    let Some(data) = testdata("a_lattice_that_changes_gives_its_mean") else {
        return;
    };
    let (found, truth) = analysed(&data, "bent", &["--size", "512nmx512nm"]);
    let [value, sigma] = twist(&found, "uncorrected");
    let wanted = number(&truth, "/mean_theta_deg");
    assert!(
        (value - wanted).abs() < 4.0 * sigma,
        "{value} ± {sigma}, {wanted}"
    );
    assert!(sigma < 0.001 * wanted, "{sigma}");
    assert!(caveats(&found).contains(&"changing-lattice"));
}

/// Two grains side by side are two results, and no mixture comes out.
#[test]
fn two_grains_are_not_mixed() {
    let Some(data) = testdata("two_grains_are_not_mixed") else {
        return;
    };
    let (found, truth) = analysed(&data, "two_grains", &["--size", "256nmx256nm"]);
    let [value, sigma] = twist(&found, "uncorrected");
    let near =
        ["/left_theta_deg", "/right_theta_deg"].map(|grain| (value - number(&truth, grain)).abs());
    let least = near[0].min(near[1]);
    assert!(least < 5.0 * sigma, "{value} ± {sigma}: {near:?}");
    assert!(caveats(&found).contains(&"several-grains"));
    let sets = found["sets"].as_array().unwrap();
    assert_eq!(sets.len(), 2);
    let mut twists: Vec<f64> = (sets.iter())
        .map(|set| number(set, "/uncorrected/twist_deg/value"))
        .collect();
    let mut wanted = ["/left_theta_deg", "/right_theta_deg"].map(|grain| number(&truth, grain));
    twists.sort_by(f64::total_cmp);
    wanted.sort_by(f64::total_cmp);
    for (twist, wanted) in twists.iter().zip(wanted) {
        assert!((twist / wanted - 1.0).abs() < 0.002, "{twist} {wanted}");
    }
}
