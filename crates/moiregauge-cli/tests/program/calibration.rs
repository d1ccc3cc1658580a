//! `moiregauge calibrate` and `plan`: what they find, write, apply and refuse.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::{
    analyze, caveats, estimate, number, program, results, run, simulate, succeed, testdata,
};

/// The options of a simulation from a changed copy of the default settings.
fn simulated(folder: &Path, name: &str, changes: &[(&str, &str)]) -> PathBuf {
    let text = succeed(program().args(["simulate", "--print-config"])).stdout;
    let lines = text.lines().map(|line| {
        let key = line.split(" = ").next().unwrap_or_default();
        match changes.iter().find(|(k, _)| *k == key) {
            Some((key, value)) => format!("{key} = {value}"),
            None => line.to_owned(),
        }
    });
    let config = folder.join(format!("{name}.toml"));
    std::fs::write(&config, lines.collect::<Vec<_>>().join("\n")).unwrap();
    let out = folder.join(name);
    simulate(&out, &["--config", config.to_str().unwrap()])
}

/// A scanner that goes 3 % too short along x and 1.2 % too far along y, with axes 6 mrad from a right angle.
const SCANNER: [(&str, &str); 3] = [
    ("gain", "[0.97, 1.012]"),
    ("shear_mrad", "6.0"),
    ("sensors", "false"),
];

/// Two frames of graphite: layers that are twisted by 60° have a moiré with their own lattice constant.
fn graphite(folder: &Path) -> PathBuf {
    let more = [
        ("twist_deg", "60.0"),
        ("strain_percent", "0.0"),
        ("pixels", "[128, 128]"),
        ("scans", "2"),
        ("nominal_size_nm", "[5.0, 5.0]"),
        ("velocity_nm_per_min", "[0.2, -0.1]"),
    ];
    simulated(folder, "graphite", &[&SCANNER[..], &more].concat())
}

fn moire(folder: &Path) -> PathBuf {
    let more = [
        ("pixels", "[128, 128]"),
        ("scans", "4"),
        ("nominal_size_nm", "[60.0, 60.0]"),
    ];
    simulated(folder, "moire", &[&SCANNER[..], &more].concat())
}

fn calibrate(input: &Path, more: &[&str]) -> std::process::Command {
    let mut command = program();
    command.arg("calibrate").arg(input).args(more);
    command
}

#[test]
fn a_calibration_is_written_and_applied() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scanner.toml");
    let scans = graphite(folder.path());
    let to = file.to_str().unwrap();
    let said = succeed(&mut calibrate(
        &scans,
        &["--material", "graphite", "--out", to],
    ))
    .stdout;
    assert!(
        said.contains("calibration of the nominal coordinates"),
        "{said}"
    );
    assert!(!said.contains("drift-not-separated"), "{said}");
    let written: toml::Table = toml::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    assert_eq!(written["schema"].as_str(), Some("moiregauge/calibration/1"));
    assert_eq!(written["drift_separated"].as_bool(), Some(true));
    let hash = written["files"][0]["sha256"].as_str().unwrap();
    assert_eq!(hash.len(), 64);
    // The inverse of the scanner's gains, by hand to first order in the shear: lengths are shown too long along x.
    let of = |key: &str| written["calibration"][key].as_float().unwrap();
    let (x, y) = (100.0 * (1.0 / 0.97 - 1.0), 100.0 * (1.0 / 1.012 - 1.0));
    assert!((of("gain_percent") - f64::midpoint(x, y)).abs() < 0.15);
    assert!((of("mismatch_percent") - (x - y)).abs() < 0.05);
    assert!((of("orthogonality_mrad") + 6.0).abs() < 0.3);
    let again = run(&mut calibrate(
        &scans,
        &["--material", "graphite", "--out", to],
    ));
    assert_eq!(again.code, Some(1));
    assert!(again.stderr.contains("--force"), "{}", again.stderr);

    let input = moire(folder.path());
    let (a, b, c) = (
        folder.path().join("a"),
        folder.path().join("b"),
        folder.path().join("c"),
    );
    succeed(&mut analyze(&input, &a));
    succeed(analyze(&input, &b).args(["--calibration", to]));
    let config = folder.path().join("settings.toml");
    std::fs::write(&config, "scanner = \"scanner.toml\"\n").unwrap();
    succeed(analyze(&input, &c).arg("--config").arg(&config));
    let (without, with, by_config) = (results(&a), results(&b), results(&c));
    let twist = |r: &Value| estimate(r, "/sets/0/mean/twist_deg");
    assert!((twist(&without).0 - 1.13).abs() > 0.005);
    // The calibration's own error of 0.04 % (the lattice constant of graphite) is 0.0005°.
    assert!((twist(&with).0 - 1.13).abs() < 0.001, "{:?}", twist(&with));
    assert_eq!(twist(&with), twist(&by_config));
    assert_eq!(
        number(&with, "/settings/scanner/gain_percent"),
        of("gain_percent")
    );
    assert!(without["settings"].get("scanner").is_none());
    assert!(caveats(&without).contains(&"no-position-sensors"));
    assert!(!caveats(&with).contains(&"no-position-sensors"));
    assert!(caveats(&with).contains(&"calibration-extrapolated"));

    let both = run(analyze(&input, &folder.path().join("d")).args([
        "--calibration",
        to,
        "--calibration-gain",
        "1",
    ]));
    assert_eq!(both.code, Some(2));
    std::fs::write(&file, "schema = 1").unwrap();
    let broken = run(analyze(&input, &folder.path().join("d")).args(["--calibration", to]));
    assert_eq!(broken.code, Some(1));
    assert!(broken.stderr.contains("scanner.toml"), "{}", broken.stderr);
}

#[test]
fn another_lattice_is_not_taken_for_the_known_one() {
    let folder = tempfile::tempdir().unwrap();
    let scans = graphite(folder.path());
    let other = run(&mut calibrate(&scans, &["--lattice-constant", "0.6nm"]));
    assert_eq!(other.code, Some(1));
    assert!(
        other.stderr.contains("no image shows the lattice"),
        "{}",
        other.stderr
    );
    let unknown = run(&mut calibrate(&scans, &["--material", "cheese"]));
    assert!(unknown.stderr.contains("graphite"), "{}", unknown.stderr);
}

/// A folder without scans and a picture without a size are not blamed on the lattice.
#[test]
fn nothing_to_look_at_is_no_missing_lattice() {
    let folder = tempfile::tempdir().unwrap();
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    let picture = folder.path().join("picture.csv");
    std::fs::write(&picture, "1,2,3\n4,5,6\n7,8,9\n").unwrap();
    for (input, reason) in [
        (&empty, "holds no scan files"),
        (&picture, "--size 70nm (one length"),
    ] {
        let run = run(&mut calibrate(input, &["--material", "graphite"]));
        assert_eq!(run.code, Some(1));
        assert!(
            run.stderr.contains("no image could be read"),
            "{}",
            run.stderr
        );
        assert!(run.stderr.contains(reason), "{}", run.stderr);
        assert!(!run.stderr.contains("shows the lattice"), "{}", run.stderr);
    }
}

/// Numbers after a name in what was printed.
fn printed(said: &str, name: &str) -> f64 {
    let line = said
        .lines()
        .find(|l| l.trim_start().starts_with(name))
        .unwrap_or_else(|| panic!("no {name} in {said}"));
    let number = line.trim_start()[name.len()..]
        .split_whitespace()
        .next()
        .unwrap();
    number.replace('−', "-").parse().unwrap()
}

/// Single frames of real surfaces: a distortion, and the word that drift is in it. The distortion of the 7 × 7 frame
/// is that of its two shortest vectors between corner holes, read off the image by eye within a few pixels: about
/// (3.0, 0.6) and (−1.5, −3.1) nm or lengths of 3.0, 3.5 and 4.2 nm.
#[test]
fn real_surfaces() {
    let Some(data) = testdata("real_surfaces") else {
        return;
    };
    let silicon = data.join("real/nanonis/si111_7x7_20nm.sxm");
    let mut found = Vec::new();
    for channel in ["Z", "Current"] {
        let options = ["--material", "si111-7x7", "--channel", channel];
        let said = succeed(&mut calibrate(&silicon, &options)).stdout;
        assert!(said.contains("drift-not-separated"), "{said}");
        let line = said.lines().find(|l| l.contains("lattice shown")).unwrap();
        let mut lengths: Vec<f64> = line
            .replace(',', " ")
            .split_whitespace()
            .filter_map(|w| w.parse().ok())
            .collect();
        lengths.sort_by(f64::total_cmp);
        for (length, expected) in lengths.iter().zip([3.0, 3.5, 4.2]) {
            assert!((length / expected - 1.0).abs() < 0.05, "{lengths:?}");
        }
        found.push((printed(&said, "gain"), printed(&said, "mismatch")));
    }
    // Two channels of one frame show one distortion.
    assert!((found[0].0 - found[1].0).abs() < 1.0, "{found:?}");
    assert!((found[0].1 - found[1].1).abs() < 2.0, "{found:?}");

    let graphite = data.join("real/iso28632/graphite_terrace_11nm.spm");
    let out = tempfile::tempdir().unwrap();
    let file = out.path().join("scanner.toml");
    let options = ["--material", "graphite", "--out", file.to_str().unwrap()];
    let refused = run(&mut calibrate(&graphite, &options));
    assert_eq!(refused.code, Some(1));
    assert!(
        refused.stdout.contains("drift-not-separated"),
        "{}",
        refused.stdout
    );
    assert!(refused.stderr.contains("--line-rate"), "{}", refused.stderr);
    assert!(!file.exists());
    // The mean over the three rows of atoms is right within a per cent, x and y are 19 % apart.
    assert!(printed(&refused.stdout, "gain").abs() < 1.0);
    assert!((printed(&refused.stdout, "mismatch") - 19.0).abs() < 1.0);
    let mut known = calibrate(&graphite, &options);
    let said = succeed(known.args(["--line-rate", "10", "--drift-sigma", "0.5"])).stdout;
    assert!(said.contains("0 ± 0.5 nm/min"), "{said}");
    let written: toml::Table = toml::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    assert_eq!(written["drift_separated"].as_bool(), Some(false));
    // 0.5 nm/min over 512 lines at 10 Hz and 11.48 nm: 0.0372 along the slow axis, which is half of it in the gain.
    let variance = written["calibration"]["covariance"][0][0]
        .as_float()
        .unwrap();
    let slow = 0.5 / 60.0 * 51.2 / 11.48 * 0.906;
    assert!(
        (variance.sqrt() / (100.0 * slow / 2.0) - 1.0).abs() < 0.1,
        "{variance}"
    );
}

#[test]
fn a_plan_says_how_and_what_cannot_be_had() {
    let folder = tempfile::tempdir().unwrap();
    let scans = simulate(folder.path(), &["--pixels", "128", "--scans", "2"]);
    let out = folder.path().join("plan.toml");
    let planned = succeed(
        program()
            .args([
                "plan",
                "--twist-sigma",
                "0.02",
                "--drift-sigma",
                "0.05",
                "--like",
            ])
            .arg(&scans)
            .arg("--out")
            .arg(&out),
    )
    .stdout;
    assert!(planned.contains("recommended:"), "{planned}");
    assert!(!planned.contains("out of reach"), "{planned}");
    succeed(
        program()
            .args(["validate", "--sets", "2", "--quiet", "--config"])
            .arg(&out),
    );
    // 1 % of gain are 0.011° of twist: 0.001° cannot be had without a calibration.
    let vain = succeed(program().args(["plan", "--twist-sigma", "0.001"])).stdout;
    assert!(vain.contains("out of reach: twist ± 0.001°"), "{vain}");
    assert!(
        vain.contains("± 0.011°") && vain.contains("moiregauge calibrate"),
        "{vain}"
    );
    let known = [
        "plan",
        "--twist-sigma",
        "0.001",
        "--calibration-gain",
        "0.02",
        "--isotropic-strain",
        "0",
    ];
    let known = succeed(program().args(known)).stdout;
    assert!(!known.contains("out of reach"), "{known}");
    let nothing = run(program().arg("plan"));
    assert_eq!(nothing.code, Some(2));
}

/// The atoms of other frames through the same scanner, up and down, take its gains off at once; their magnification has a row's share of the
/// budget, which the user's own number changes.
#[test]
fn the_atoms_of_other_frames_are_the_ruler() {
    let folder = tempfile::tempdir().unwrap();
    let (atoms, scans) = (graphite(folder.path()), moire(folder.path()));
    let from = atoms.join("*.spm");
    let analysed = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let from = ["--ruler-from", from.to_str().unwrap()];
        succeed(analyze(&scans, &out).args(from).args(more));
        results(&out)
    };
    let usual = analysed("usual", &[]);
    let (twist, _) = estimate(&usual, "/sets/0/mean/twist_deg");
    assert!((twist - 1.13).abs() < 0.003, "{twist}");
    let gain = |found: &Value| number(found, "/sets/0/mean/budget/twist_deg/calibration_gain");
    let exact = analysed("exact", &["--ruler-magnification", "0"]);
    // Half a per cent along either axis, over the square root of two.
    let of_magnification = (gain(&usual).powi(2) - gain(&exact).powi(2)).sqrt();
    let expected = 0.005 * twist / 2f64.sqrt();
    assert!(
        (of_magnification / expected - 1.0).abs() < 0.05,
        "{of_magnification}"
    );
    assert_eq!(
        usual["settings"]["scanner"]["sizes_nm"],
        serde_json::json!([])
    );
}
