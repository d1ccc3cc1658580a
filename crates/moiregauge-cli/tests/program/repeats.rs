//! A run is repeated from its results: the same bytes, from the same files or not at all.

use std::path::Path;
use std::process::Command;

use moiregauge::simulate::FieldScene;

use crate::common::{Run, json, program, run, simulate, succeed};
use crate::maps::written;
use crate::same_bytes::{assert_same, contents};

/// The program in a folder, so that names of files are those of a user; `~` is a blank within an argument.
fn within(folder: &Path, arguments: &str) -> Command {
    let mut command = program();
    let arguments = arguments.split(' ').map(|a| a.replace('~', " "));
    command.current_dir(folder).args(arguments);
    command
}

/// Runs it, repeats it elsewhere, and compares every file of both.
fn repeated(folder: &Path, arguments: &str) {
    let command = arguments.split(' ').next().unwrap_or_default();
    let first = run(&mut within(folder, &format!("{arguments} --out first")));
    let document = if command == "map" { "map" } else { "results" };
    assert!(
        folder.join("first").exists(),
        "{arguments}\n{}",
        first.stderr
    );
    let replay =
        format!("{command} --replay first/{document}.json --threads 2 --quiet --out second");
    let second = run(&mut within(folder, &replay));
    assert_eq!(second.code, first.code, "{arguments}\n{}", second.stderr);
    assert!(
        !second.stderr.contains("byte for byte"),
        "{}",
        second.stderr
    );
    let [a, b] = ["first", "second"].map(|name| contents(&folder.join(name)));
    assert_same(&a, &b, arguments);
    for name in ["first", "second"] {
        std::fs::remove_dir_all(folder.join(name)).unwrap();
    }
}

/// A calibration with numbers of seventeen digits, which have to come back to the last bit.
const SCANNER: &str = r#"schema = "moiregauge/calibration/1"
version = "0.1.0"
[calibration]
gain_percent = 0.83214156263718291
mismatch_percent = -0.21234567891234567
orthogonality_mrad = 1.1000000000000001
covariance = [[0.0016000000000000003, 0.0, 0.0], [0.0, 0.0025000000000000005, 1.2345678901234567e-7], [0.0, 1.2345678901234567e-7, 0.04]]
coordinates = "sensors"
[known_lattice]
name = "graphite"
a_nm = 0.246
b_nm = 0.246
angle_deg = 60.0
sigma_percent = 0.04
source = "made up"
"#;

#[test]
fn runs_are_repeated_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let size = ["--pixels", "128", "--scans", "2"];
    simulate(folder, &[&size[..], &["--name", "s"]].concat());
    simulate(
        folder,
        &[&size[..], &["--name", "t", "--seed", "2"]].concat(),
    );
    std::fs::write(folder.join("scanner.toml"), SCANNER).unwrap();
    // A file that looks like a scan but is not one fails again with the same words.
    let scan = std::fs::read_dir(folder.join("t")).unwrap();
    let scan = scan
        .map(|e| e.unwrap().path())
        .find(|p| p.extension().is_some_and(|e| e == "spm"));
    let bytes = std::fs::read(scan.unwrap()).unwrap();
    std::fs::write(folder.join("t/cut.spm"), &bytes[..bytes.len() / 2]).unwrap();
    // The same image without its sensors, and these in a file of their own.
    let mut scan = spmfile::read(&bytes).unwrap();
    scan.channels
        .retain(|c| c.line_direction == Some(spmfile::LineDirection::Trace));
    let sensors = spmfile::gwy::write(&scan, &[]).unwrap();
    std::fs::write(folder.join("sensors.gwy"), sensors).unwrap();
    succeed(&mut within(
        folder,
        "convert sensors.gwy bare.gwy --channel TR~Phase",
    ));
    let draws = "--drift-draws 20 --strain-draws 20";
    repeated(folder, &format!("analyze s {draws} --no-png --seed 3"));
    repeated(
        folder,
        &format!("analyze bare.gwy --sensors sensors.gwy --no-report {draws}"),
    );
    repeated(
        folder,
        &format!(
            "analyze ./s t --set a=s/ --set b=./t --no-report --calibration scanner.toml --export c.gsf {draws}"
        ),
    );
    repeated(
        folder,
        &format!(
            "analyze s --rotation 12.3 --crop 3,5,120,118 --frame-direction alternating-down --line-rate 3.7 --size 0.0713um×0.0691um --colormap grey --no-png --overlap {draws}"
        ),
    );
}

#[test]
fn runs_of_arrays_and_maps_are_repeated() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let side = 160;
    let mut scene = FieldScene::hexagonal([side, side], 16.0, 0.3);
    scene.white = 0.6;
    written(folder, &scene.image());
    let told = "--size 112nm×112nm --line-rate 4 --frame-direction up --unit mV";
    repeated(
        folder,
        &format!(
            "analyze image.npy {told} --drift 0.3 -0.2 --drift-sigma 0.05 --no-report --strain-draws 20"
        ),
    );
    repeated(
        folder,
        &format!(
            "map image.npy {told} --no-report --region bar=-20,-20,40,40 --wanted 1.26±0.05 --window 9"
        ),
    );
    repeated(
        folder,
        &format!(
            "map image.npy {told} --no-report --in-bands --crop 10,0,140,150 --profile cut=-20,0~20,0"
        ),
    );
}

/// A refusal names every file with the hash that was expected and the one that was found; nothing is written.
#[test]
fn changed_files_are_refused_and_moved_ones_found() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    simulate(folder, &["--pixels", "128", "--scans", "2", "--name", "s"]);
    succeed(&mut within(
        folder,
        "analyze s --out r --no-report --drift-draws 20 --strain-draws 20",
    ));
    let before = contents(&folder.join("r"));
    let replay = |options: &str| -> Run {
        run(&mut within(
            folder,
            &format!("analyze --replay r/results.json{options}"),
        ))
    };
    let document = json(&folder.join("r/results.json"));
    let files: Vec<(String, String)> = document["provenance"]["inputs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| ["file", "sha256"].map(|k| f[k].as_str().unwrap().to_owned()))
        .map(|[file, hash]| (file, hash))
        .collect();
    assert_eq!(files.len(), 2);
    // What was asked stands there, without the place of the results.
    let asked = &document["provenance"]["run"];
    assert_eq!(asked["arguments"][1], "s");
    assert!(!asked.to_string().contains("--out"), "{asked}");

    // Moved and renamed: found by content, in the folder above that of the document or where the user says.
    std::fs::create_dir_all(folder.join("archive/old")).unwrap();
    for (number, (file, _)) in files.iter().enumerate() {
        let place = folder.join(format!("archive/old/renamed {number}"));
        std::fs::rename(folder.join(file), place).unwrap();
    }
    let found = replay(" --data archive --out moved");
    assert_eq!(found.code, Some(0), "{}", found.stderr);
    assert_same(&before, &contents(&folder.join("moved")), "moved files");
    let lost = replay(" --out lost");
    assert_eq!(lost.code, Some(1));
    assert!(!folder.join("lost").exists());
    for (file, hash) in &files {
        assert!(
            lost.stderr.contains(file) && lost.stderr.contains(hash),
            "{}",
            lost.stderr
        );
    }

    // Without a place the results lie beside the others.
    for (number, (file, _)) in files.iter().enumerate() {
        let place = folder.join(format!("archive/old/renamed {number}"));
        std::fs::rename(place, folder.join(file)).unwrap();
    }
    succeed(&mut within(folder, "analyze --replay r/results.json -q"));
    assert_same(&before, &contents(&folder.join("r-replayed")), "beside");

    // One bit.
    let (file, hash) = &files[1];
    let mut bytes = std::fs::read(folder.join(file)).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(folder.join(file), &bytes).unwrap();
    let changed = replay(" --out changed");
    assert_eq!(changed.code, Some(1));
    assert!(!folder.join("changed").exists());
    let said = &changed.stderr;
    assert!(
        said.contains(file) && said.contains(hash) && said.contains("found"),
        "{said}"
    );
    assert!(!said.contains(&files[0].0), "{said}");

    // Options beside it would make it another run.
    let other = replay(" --out other --seed 7");
    assert_eq!(other.code, Some(1));
    assert!(other.stderr.contains("--seed 7"), "{}", other.stderr);
}

/// The settings that results hold are settings of another run.
#[test]
fn settings_are_read_from_results() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    simulate(folder, &["--pixels", "128", "--scans", "2", "--name", "s"]);
    let settings =
        "--seed 5 --drift-draws 20 --strain-draws 21 --lattice-constant 0.2461 --drift 0.1 -0.3";
    succeed(&mut within(
        folder,
        &format!("analyze s --out a --no-report {settings}"),
    ));
    succeed(&mut within(
        folder,
        "analyze s --out b --no-report --config a/results.json --strain-draws 22",
    ));
    let [a, b] =
        ["a", "b"].map(|name| json(&folder.join(name).join("results.json"))["settings"].clone());
    assert_eq!(b["strain_draws"], 22);
    let mut expected = a;
    expected["strain_draws"] = 22.into();
    assert_eq!(b, expected);
    std::fs::write(folder.join("other.json"), "{\"schema\": 1}").unwrap();
    let refused = run(&mut within(folder, "analyze s --out c --config other.json"));
    assert_eq!(refused.code, Some(1));
    assert!(
        refused.stderr.contains("results.json"),
        "{}",
        refused.stderr
    );
}
