//! Different layers, the orientation of a layer, and the calculator.

use serde_json::Value;

use crate::common::{
    analyze, caveats, estimate, json, number, program, results, run, simulate, succeed,
};

const SMALL: [&str; 4] = ["--pixels", "128", "--scans", "4"];

fn calculate(options: &[&str]) -> Value {
    let run = succeed(program().arg("moire").args(options).arg("--json"));
    serde_json::from_str(&run.stdout).expect("JSON")
}

/// λ = a/(2 sin(θ/2)) at 1.1°, and four electrons in each cell.
#[test]
fn the_moire_of_a_twist() {
    let found = calculate(&["--twist", "1.1"]);
    let period = 0.246 / (2.0 * 0.55_f64.to_radians().sin());
    for i in 0..3 {
        let length = number(&found, &format!("/cell/wavelengths_nm/{i}"));
        assert!((length - period).abs() < 1e-9);
    }
    let area = 0.75_f64.sqrt() * period * period;
    assert!((number(&found, "/cell/density_full_cm2") - 4e14 / area).abs() < 1e3);
    assert!((number(&found, "/cell/density_per_electron_cm2") - 1e14 / area).abs() < 1e3);
}

/// Forwards and backwards: the vectors of a strained moiré mean what made them.
#[test]
fn forwards_and_backwards() {
    let options = [
        "--twist",
        "1.1",
        "--strain",
        "0.3",
        "--strain-axis",
        "20",
        "--lattice-angle",
        "37",
    ];
    let made = calculate(&[&options[..], &["--lattice-angle-of", "reciprocal"]].concat());
    let vector = |i: usize| {
        let part = |k: usize| number(&made, &format!("/cell/vectors_nm/{i}/{k}"));
        format!("{},{}", part(0), part(1))
    };
    let (first, second) = (vector(0), vector(1));
    let read = calculate(&["--vectors", &first, &second, "--lattice-angle", "67±0.1"]);
    let twist = number(&read, "/twist_strain/twist_deg/value");
    assert!((twist - 1.1).abs() < 1e-9);
    assert_eq!(
        read["readings"]["solutions"].as_array().map(Vec::len),
        Some(4)
    );
    let tensor = &read["readings"]["strain_tensor"];
    assert!((number(tensor, "/twist_deg/value") - 1.1).abs() < 1e-9);
    let split = number(tensor, "/splits/0/uniaxial_percent/value");
    let biaxial = number(tensor, "/splits/0/biaxial_percent/value");
    assert!(
        (split - 0.3).abs() < 1e-9 && biaxial.abs() < 1e-9,
        "{split} {biaxial}"
    );
    // A row of atoms lies 30° from the reciprocal vector: 67° and not 37°.
    let (_, sigma) = estimate(tensor, "/mean_strain_percent");
    let expected = 100.0 * 1.1_f64.to_radians() * 0.1_f64.to_radians();
    assert!((sigma / expected - 1.0).abs() < 0.01, "{sigma} {expected}");
}

#[test]
fn three_wavelengths_have_to_say_what_they_are() {
    let ask = |options: &[&str]| {
        run(program()
            .args(["moire", "--wavelengths", "13.72,12.7,10.18"])
            .args(options))
    };
    let refused = ask(&[]);
    assert_eq!(refused.code, Some(1));
    for word in [
        "--meaning real-space",
        "--meaning k-space",
        "1.190",
        "1.152",
    ] {
        assert!(refused.stderr.contains(word), "{}", refused.stderr);
    }
    for (meaning, twist) in [("real-space", "1.190"), ("k-space", "1.152")] {
        let told = ask(&["--meaning", meaning]);
        assert_eq!(told.code, Some(0), "{}", told.stderr);
        assert!(
            told.stdout.contains(&format!("twist {twist}")),
            "{}",
            told.stdout
        );
    }
    let impossible =
        run(program().args(["moire", "--wavelengths", "1,2,4", "--meaning", "real-space"]));
    assert_eq!(impossible.code, Some(1));
    assert!(
        impossible.stderr.contains("longest"),
        "{}",
        impossible.stderr
    );
}

/// What is printed has true minus signs and can be typed in again: forwards and back is the same twist and strain, one
/// of the branches.
#[test]
fn what_is_printed_can_be_typed_in() {
    let options = ["--twist", "1.1", "--strain", "0.3", "--strain-axis", "-70"];
    let forward = succeed(program().arg("moire").args(options)).stdout;
    let line = forward.lines().find(|l| l.contains("L1, L2")).unwrap();
    assert!(line.contains('−'), "{line}");
    let vectors: Vec<&str> = line.split_inclusive(')').collect();
    let vectors = [0, 1].map(|i: usize| {
        let text: &str = vectors[i];
        &text[text.find('(').unwrap()..]
    });
    let back = program()
        .args(["moire", "--vectors"])
        .args(vectors)
        .output()
        .unwrap();
    let back = String::from_utf8(back.stdout).unwrap();
    for text in [&forward, &back] {
        let hyphen = text.as_bytes().windows(2);
        assert!(
            !hyphen
                .clone()
                .any(|w| w[0] == b'-' && w[1].is_ascii_digit()),
            "{text}"
        );
    }
    let branches: Vec<&str> = back.lines().filter(|l| l.contains("along")).collect();
    assert!(branches.len() >= 2, "{back}");
    assert!(
        branches
            .iter()
            .any(|l| l.contains("twist 1.1") && l.contains("strain 0.3")),
        "{back}"
    );
}

#[test]
fn figures_of_the_cell() {
    let folder = tempfile::tempdir().unwrap();
    for (name, start) in [("cell.svg", &b"<svg"[..]), ("cell.png", &b"\x89PNG"[..])] {
        let path = folder.path().join(name);
        succeed(
            program()
                .args(["moire", "--twist", "1.1", "--figure"])
                .arg(&path),
        );
        let bytes = std::fs::read(&path).unwrap();
        let head = &bytes[..bytes.len().min(200)];
        assert!(head.windows(start.len()).any(|w| w == start), "{name}");
    }
    let refused = run(program().args(["moire", "--twist", "1.1", "--figure", "cell.gif"]));
    assert_eq!(refused.code, Some(1));
}

/// Layers of one's own, and names that nobody knows.
#[test]
fn layers_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("layers.toml");
    let text = "[[layer]]\nname = \"mine\"\nlattice_constant_nm = 0.3\nlattice_constant_b_nm = 0.5\n\
                cell_angle_deg = 85.0\npoisson_ratio = 0.2\n";
    std::fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap();
    let found = calculate(&["--materials", path, "--layers", "mine", "--twist", "2"]);
    let area = 0.3 * 0.5 * 85_f64.to_radians().sin() / (2.0 * 1_f64.to_radians().sin()).powi(2);
    assert!((number(&found, "/cell/area_nm2") / area - 1.0).abs() < 1e-9);
    for layers in ["graphene/unobtainium", "unobtainium"] {
        let refused = run(program().args(["moire", "--layers", layers, "--twist", "1"]));
        assert_eq!(refused.code, Some(1));
        assert!(refused.stderr.contains("hBN"), "{}", refused.stderr);
    }
    std::fs::write(path, text.replace("cell_angle_deg = 85.0\n", "")).unwrap();
    let refused = run(program().args([
        "moire",
        "--materials",
        path,
        "--layers",
        "mine",
        "--twist",
        "1",
    ]));
    assert!(refused.stderr.contains("go together"), "{}", refused.stderr);
}

/// Graphene on hBN: two solutions that differ at first order, one of them the truth, and a caveat; with atomic
/// images of the lower layer the whole tensor.
#[test]
fn graphene_on_boron_nitride() {
    let folder = tempfile::tempdir().unwrap();
    let layers = ["--layers", "graphene/hBN"];
    let sample = [
        &layers[..],
        &["--twist", "0.8", "--strain", "0.2", "--biaxial", "0.1"],
    ]
    .concat();
    let moire = simulate(folder.path(), &[&SMALL[..], &sample].concat());
    let atoms = [
        &sample[..],
        &SMALL,
        &["--atoms", "1", "--size", "5", "5", "--name", "atoms"],
    ]
    .concat();
    simulate(folder.path(), &atoms);
    let atoms = folder.path().join("atoms");

    let out = folder.path().join("plain");
    let plain = succeed(
        analyze(&moire, &out)
            .args(layers)
            .args(["--isotropic-strain", "0.1"]),
    );
    assert!(
        plain.stdout.contains("either") && plain.stdout.contains("or  "),
        "{}",
        plain.stdout
    );
    let found = results(&out);
    assert!(caveats(&found).contains(&"twist-trades-with-strain"));
    let readings = &found["sets"][0]["mean"]["readings"];
    let open = &readings["isotropic_strain"]["twist_interval_deg"];
    assert!(
        number(open, "/0") < 0.8 && number(open, "/1") > 0.8,
        "{open}"
    );
    assert!(readings["strain_tensor"].is_null());
    let twists: Vec<f64> = readings["solutions"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| number(s, "/twist_deg/value"))
        .filter(|t| *t > 0.0)
        .collect();
    assert!(
        twists.len() == 2 && (twists[0] - twists[1]).abs() > 0.02,
        "{twists:?}"
    );

    let out = folder.path().join("atomic");
    succeed(
        analyze(&moire, &out)
            .args(layers)
            .arg("--atomic")
            .arg(&atoms),
    );
    let found = results(&out);
    let tensor = &found["sets"][0]["mean"]["readings"]["strain_tensor"];
    let truth = json(&moire.join("truth.json"));
    assert_eq!(number(&truth, "/biaxial_percent"), 0.1);
    for (pointer, truth) in [
        ("/twist_deg", 0.8),
        ("/splits/0/uniaxial_percent", 0.2),
        ("/splits/0/biaxial_percent", 0.1),
    ] {
        let (value, sigma) = estimate(tensor, pointer);
        assert!(
            (value - truth).abs() < 4.0 * sigma,
            "{pointer}: {value} ± {sigma}"
        );
    }
    assert_eq!(found["atomic"]["layer"], 1);
    assert_eq!(
        found["provenance"]["inputs"].as_array().map(Vec::len),
        Some(8)
    );
    // The same by its number.
    let (angle, sigma) = estimate(&found, "/atomic/lattice_angle_deg");
    let given = format!("{angle}±{sigma}");
    let out = folder.path().join("given");
    let options = [
        "--lattice-angle",
        &given,
        "--lattice-angle-of",
        "reciprocal",
    ];
    succeed(analyze(&moire, &out).args(layers).args(options));
    let again = results(&out);
    let again = &again["sets"][0]["mean"]["readings"]["strain_tensor"];
    let twist = |v: &Value| number(v, "/twist_deg/value");
    assert!((twist(again) - twist(tensor)).abs() < 1e-9);
}
