//! Another name of the same lattice: strained moirés of which the least strained pair of waves is not the true one.

use serde_json::Value;

use crate::common::{analyze, caveats, number, program, results, simulate, succeed, testdata};

/// Twist and strain of the first set, and what chose the pair of waves.
fn reported(found: &Value) -> ([f64; 2], String) {
    let mean = &found["sets"][0]["mean"];
    let chosen = &mean["readings"]["names"]["chosen_by"];
    (
        [
            number(mean, "/twist_deg/value"),
            number(mean, "/heterostrain_percent/value"),
        ],
        chosen.as_str().unwrap_or_default().to_owned(),
    )
}

/// Whether a solution of the list is this one.
fn is_listed(found: &Value, [twist, strain]: [f64; 2]) -> bool {
    let solutions = &found["sets"][0]["mean"]["readings"]["solutions"];
    solutions.as_array().unwrap().iter().any(|s| {
        (number(s, "/twist_deg/value") - twist).abs() < 2e-3
            && (number(s, "/strain_percent/value") - strain).abs() < 2e-3
    })
}

/// Three equally strong waves in the image: the pair that is not the least strained is reported, with the words that say
/// so, and a method that knows no amplitudes says that the pairs compete and lists the truth.
#[test]
fn the_image_decides() {
    let folder = tempfile::tempdir().unwrap();
    let sample = [
        "--twist",
        "0.44",
        "--strain",
        "0.58",
        "--strain-axis",
        "15",
        "--lattice-angle",
        "20",
        "--size",
        "250",
        "250",
        "--pixels",
        "192",
        "--scans",
        "4",
    ];
    let moire = simulate(folder.path(), &sample);
    let truth = [0.44, 0.58];
    let out = folder.path().join("image");
    let run = succeed(&mut analyze(&moire, &out));
    let found = results(&out);
    let ([twist, strain], chosen) = reported(&found);
    assert!(
        (twist - 0.44).abs() < 1e-3 && (strain - 0.58).abs() < 2e-3,
        "{twist} {strain}"
    );
    assert_eq!(chosen, "image");
    assert!(caveats(&found).contains(&"not-the-least-strain"));
    assert!(!caveats(&found).contains(&"names-compete"));
    assert!(run.stdout.contains("chosen by the image"), "{}", run.stdout);
    assert!(is_listed(&found, truth) && is_listed(&found, [0.4234, 0.258]));

    let out = folder.path().join("blind");
    succeed(analyze(&moire, &out).args(["--method", "fourier"]));
    let found = results(&out);
    assert!(
        caveats(&found).contains(&"names-compete"),
        "{:?}",
        caveats(&found)
    );
    assert!(is_listed(&found, truth));
    let bound = number(
        &found["sets"][0]["mean"]["readings"],
        "/solutions_complete_to_percent",
    );
    assert!(bound > 0.58 && bound <= 1.0);
}

/// The same of frames by an independent program: never wrong without a word.
#[test]
fn independent_frames() {
    for (name, truth) in [
        ("hard/other_name_0p3deg", [0.3, 0.35]),
        ("hard/other_name_0p5deg", [0.5, 0.55]),
    ] {
        let Some(shared) = testdata("independent_frames") else {
            return;
        };
        let scans = shared.join(name);
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        succeed(&mut analyze(&scans, &out));
        let found = results(&out);
        let ([twist, strain], chosen) = reported(&found);
        assert!(is_listed(&found, truth), "{name}");
        let right = (twist - truth[0]).abs() < 3e-3 && (strain - truth[1]).abs() < 5e-3;
        assert!(
            right,
            "{name} {twist} {strain} {chosen} {:?}",
            caveats(&found)
        );
    }
}

/// `moire` lists the truth, whichever pair it is given, and names the waves of the vectors that it shows.
#[test]
fn the_calculator_lists_other_pairs() {
    let made = [
        "moire",
        "--twist",
        "0.2",
        "--strain",
        "0.3",
        "--strain-axis",
        "40",
        "--json",
    ];
    let made: Value = serde_json::from_str(&succeed(program().args(made)).stdout).unwrap();
    let vector = |i: usize| {
        let part = |k: usize| number(&made, &format!("/cell/vectors_nm/{i}/{k}"));
        [part(0), part(1)]
    };
    let (a, b) = (vector(0), vector(1));
    // Another pair of the same lattice.
    let first = format!("{},{}", a[0] + 2.0 * b[0], a[1] + 2.0 * b[1]);
    let second = format!("{},{}", a[0] + b[0], a[1] + b[1]);
    let read = ["moire", "--vectors", &first, &second];
    let run = succeed(program().args(read).arg("--json"));
    let read_back: Value = serde_json::from_str(&run.stdout).unwrap();
    let solutions = read_back["readings"]["solutions"].as_array().unwrap();
    let hit = solutions.iter().find(|s| {
        (number(s, "/twist_deg/value") - 0.2).abs() < 1e-9
            && (number(s, "/strain_percent/value") - 0.3).abs() < 1e-9
    });
    let hit = hit.expect("the truth is listed");
    // The waves that are named, for K₁ and K₂ dual to the vectors that are shown.
    let shown = |i: usize, k: usize| number(&read_back, &format!("/cell/vectors_nm/{i}/{k}"));
    let per_area = std::f64::consts::TAU / (shown(0, 0) * shown(1, 1) - shown(0, 1) * shown(1, 0));
    let dual = [
        [shown(1, 1) * per_area, -shown(1, 0) * per_area],
        [-shown(0, 1) * per_area, shown(0, 0) * per_area],
    ];
    let waves = |i: usize, k: usize| dual[i][k];
    let number_of = |i: usize, k: usize| number(hit, &format!("/waves/{i}/{k}"));
    let wave =
        |i: usize| [0, 1].map(|k| number_of(i, 0) * waves(0, k) + number_of(i, 1) * waves(1, k));
    let [m1, m2] = [wave(0), wave(1)];
    // M = (R(θ) S⁻¹ − 1) G for α = 0, but for a turn of all by 60°: the sum of squares tells the triple.
    let squares = |v: [f64; 2]| v[0] * v[0] + v[1] * v[1];
    let sum = squares(m1) + squares(m2) + squares([m1[0] + m2[0], m1[1] + m2[1]]);
    let (theta, strain, ratio) = (0.2_f64.to_radians(), 0.003, 0.16);
    let (along, across) = (1.0 / (1.0 + strain), 1.0 / (1.0 - ratio * strain));
    let mean = f64::midpoint(along, across);
    let p = (mean * theta.cos() - 1.0).powi(2) + (mean * theta.sin()).powi(2);
    let q = ((along - across) / 2.0).powi(2);
    let g = 4.0 * std::f64::consts::PI / (3.0_f64.sqrt() * 0.246);
    let expected = 3.0 * g * g * (p + q);
    assert!((sum / expected - 1.0).abs() < 1e-9, "{sum} {expected}");
    let said = succeed(program().args(read)).stdout;
    assert!(said.contains("other pairs of its waves"), "{said}");
}
