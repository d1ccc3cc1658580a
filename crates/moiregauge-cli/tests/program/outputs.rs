//! What is written: whole or not at all, never over files of others, and found out before the work.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{analyze, json, program, results, run, small_set, succeed};
use crate::maps;

/// The folder in which files are before they are whole.
pub(crate) const UNFINISHED: &str = "moiregauge-unfinished";
const LIST: &str = "moiregauge-files.json";

/// Every file below a folder by its name, but for what is unfinished.
pub(crate) fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let Ok(entries) = std::fs::read_dir(folder) else {
        return all;
    };
    for entry in entries {
        let path = entry.expect("an entry").path();
        let name = PathBuf::from(path.file_name().expect("a name"));
        if name.to_string_lossy().starts_with(UNFINISHED) {
            continue;
        }
        if path.is_dir() {
            let inner = contents(&path).into_iter();
            all.extend(inner.map(|(n, b)| (name.join(n), b)));
        } else {
            all.insert(name, std::fs::read(&path).expect("a file"));
        }
    }
    all
}

/// The names of everything in a folder.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let name = |e: std::io::Result<std::fs::DirEntry>| e.expect("an entry").file_name();
    let mut all: Vec<String> = entries
        .map(|e| name(e).to_string_lossy().into_owned())
        .collect();
    all.sort();
    all
}

/// A run that is refused with these words, before it says anything.
pub(crate) fn refused(command: &mut Command, words: &[&str]) {
    let run = run(command);
    assert_eq!(run.code, Some(1), "{command:?}: {}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "no {word:?}: {}", run.stderr);
    }
    assert_eq!(run.stdout, "", "{command:?}");
}

/// The inputs are not there either: what is wrong with the output is said, since it is looked at first.
#[test]
fn whether_anything_can_be_written_is_found_out_before_the_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("plain-file");
    std::fs::write(&file, "mine").expect("written");
    let out = file.join("below");
    let gone = folder.path().join("gone.spm");
    for options in [
        &["analyze", "--out"][..],
        &["map", "--out"],
        &["calibrate", "--material", "graphite", "--out"],
        &["plan", "--twist-sigma", "0.02", "--out"],
        &["validate", "--sets", "2", "--pixels", "64", "--out"],
        &["moire", "--twist", "1.1", "--figure"],
        &["simulate", "--out"],
        &["demo", "--out"],
    ] {
        let mut command = program();
        command.args(options).arg(out.join("a.svg"));
        if ["analyze", "map", "calibrate"].contains(&options[0]) {
            command.arg(&gone);
        }
        let found = run(&mut command);
        assert_eq!(found.code, Some(1), "{options:?}");
        assert!(found.stderr.contains("cannot write"), "{}", found.stderr);
        assert!(!found.stderr.contains("gone"), "{}", found.stderr);
        assert!(!found.stdout.contains("twist"), "{}", found.stdout);
    }
    let mut convert = program();
    convert.arg("convert").arg(&gone).arg(out.join("a.gwy"));
    refused(&mut convert, &["plain-file"]);
    assert_eq!(names(folder.path()), ["plain-file"]);
    assert_eq!(std::fs::read(&file).expect("the file"), b"mine");
}

/// Every name at the top of a folder of results, taken by somebody else, is found before the work, and left alone.
#[test]
fn names_that_are_taken_are_found_out_before_the_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let few = [
        "--drift-draws",
        "0",
        "--strain-draws",
        "0",
        "--export",
        "a.npz",
        "--parquet",
    ];
    let whole = folder.path().join("whole");
    let mut analyzed = program();
    analyzed
        .arg("analyze")
        .arg(&scans)
        .args(few)
        .arg("--out")
        .arg(&whole);
    succeed(&mut analyzed);
    maps::map(
        folder.path(),
        "map",
        &[
            "--region",
            "a=-80,-60,50,50",
            "--profile",
            "b=-80,-80 70,60",
            "--device",
            "60nm×30nm",
        ],
    );
    let gone = folder.path().join("gone.spm");
    for (kind, written) in [("analyze", whole), ("map", folder.path().join("map"))] {
        let list = json(&written.join(LIST));
        assert_eq!(list["kind"], kind);
        let files = list["files"].as_array().expect("a list");
        let paths = files.iter().map(|f| f["path"].as_str().expect("a name"));
        let tops: BTreeSet<&str> = paths
            .map(|p| p.split('/').next().expect("a part"))
            .collect();
        assert!(tops.len() >= 6, "{tops:?}");
        for top in tops {
            let taken = folder.path().join("taken");
            std::fs::create_dir(&taken).expect("a folder");
            std::fs::write(taken.join(top), "mine").expect("written");
            let mut command = program();
            command
                .arg(kind)
                .arg(&gone)
                .arg("--out")
                .arg(&taken)
                .arg("--force");
            if kind == "analyze" {
                command.args(few);
            }
            refused(&mut command, &[top, "not written by an earlier run"]);
            assert_eq!(names(&taken), [top]);
            std::fs::remove_dir_all(&taken).expect("removed");
        }
    }
}

/// Files of others stay on every run; stale figures of ours go with --force.
#[test]
fn files_of_others_stay_and_stale_ones_of_ours_go() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let out = folder.path().join("out");
    let few = ["--drift-draws", "0", "--strain-draws", "0"];
    std::fs::create_dir_all(out.join("figures")).expect("a folder");
    std::fs::write(out.join("figures/mine.svg"), "mine").expect("written");
    std::fs::write(out.join("notes.txt"), "mine").expect("written");
    let mut first = program();
    first.arg("analyze").arg(&scans).arg("--out").arg(&out);
    succeed(first.args(few).arg("--no-png"));
    assert!(names(&out.join("figures")).len() > 5);
    succeed(analyze(&scans, &out).args(few).arg("--force"));
    assert_eq!(names(&out.join("figures")), ["mine.svg"]);
    assert!(!out.join("report.html").exists());
    assert_eq!(
        std::fs::read(out.join("notes.txt")).expect("notes"),
        b"mine"
    );
    // One of ours that was changed is named, and nothing happens.
    std::fs::write(out.join("sets.csv"), "corrected by hand").expect("written");
    let before = contents(&out);
    refused(
        analyze(&scans, &out).arg("--force"),
        &["sets.csv", "changed"],
    );
    assert_eq!(contents(&out), before);
}

/// `map` has nothing to do with a folder `bands`, and does not take another's `map.zarr` for its own.
#[test]
fn a_map_leaves_folders_of_others_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["whole", "in-bands"] {
        let bands = folder.path().join(name).join("bands");
        std::fs::create_dir_all(&bands).expect("a folder");
        std::fs::write(bands.join("mine"), "mine").expect("written");
        let options: &[&str] = if name == "whole" {
            &[]
        } else {
            &["--in-bands"]
        };
        maps::map(folder.path(), name, options);
        assert_eq!(names(&bands), ["mine"]);
    }
    let group = folder.path().join("taken").join("map.zarr");
    std::fs::create_dir_all(&group).expect("a folder");
    std::fs::write(group.join("zarr.json"), "{}").expect("written");
    std::fs::write(group.join("data"), "mine").expect("written");
    for options in [&[][..], &["--force"]] {
        let mut command = maps::command(folder.path(), "taken", options);
        refused(&mut command, &["map.zarr", "not written by an earlier run"]);
        assert_eq!(names(&group), ["data", "zarr.json"]);
    }
}

#[test]
fn results_of_two_kinds_do_not_mix() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let out = folder.path().join("image");
    succeed(analyze(&scans, &out).args(["--drift-draws", "0", "--strain-draws", "0"]));
    let before = contents(&out);
    for options in [&[][..], &["--force"]] {
        let mut command = maps::command(folder.path(), "image", options);
        refused(&mut command, &["analyze", "map"]);
        assert_eq!(contents(&out), before);
    }
    // Nor do results go among scans.
    refused(&mut analyze(&scans, &scans), &["simulate"]);
}

/// Raw data are never written over, whatever they are called.
#[test]
fn inputs_are_never_written_over() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let raw = folder.path().join("raw.gwy");
    succeed(
        program()
            .arg("convert")
            .arg(scans.join("scan.000.spm"))
            .arg(&raw),
    );
    let bytes = std::fs::read(&raw).expect("a file");
    let spelled = scans.join("..").join("raw.gwy");
    let mut outs = vec![raw.clone(), spelled];
    #[cfg(unix)]
    {
        let link = folder.path().join("link.gwy");
        std::os::unix::fs::symlink(&raw, &link).expect("a link");
        outs.push(link);
    }
    for out in outs {
        let mut command = program();
        command.arg("convert").arg(&raw).arg(out).arg("--force");
        refused(&mut command, &["input"]);
    }
    let mut batch = program();
    batch.arg("convert").arg(&raw).arg(folder.path());
    refused(batch.args(["--to", "gwy", "--force"]), &["input"]);
    assert!(std::fs::read(&raw).expect("a file") == bytes);
    // Conditions of a plan are inputs as well.
    let config = folder.path().join("mine.toml");
    let printed = succeed(program().args(["simulate", "--print-config"]));
    std::fs::write(&config, &printed.stdout).expect("written");
    let mut plan = program();
    plan.args(["plan", "--twist-sigma", "0.02", "--force", "--config"]);
    refused(plan.arg(&config).arg("--out").arg(&config), &["input"]);
    assert_eq!(
        std::fs::read_to_string(&config).expect("a file"),
        printed.stdout
    );
}

/// What was there is asked about first.
#[test]
fn figures_and_validations_are_not_written_over_without_force() {
    let folder = tempfile::tempdir().expect("a folder");
    let figure = folder.path().join("cell.svg");
    std::fs::write(&figure, "mine").expect("written");
    let draw = || {
        let mut command = program();
        command
            .args(["moire", "--twist", "1.1", "--figure"])
            .arg(&figure);
        command
    };
    refused(&mut draw(), &["cell.svg", "--force"]);
    assert_eq!(std::fs::read(&figure).expect("a file"), b"mine");
    succeed(draw().arg("--force"));
    assert_ne!(std::fs::read(&figure).expect("a file"), b"mine");

    let out = folder.path().join("validation");
    std::fs::create_dir(&out).expect("a folder");
    std::fs::write(out.join("sets.csv"), "mine").expect("written");
    let mut validate = program();
    validate.args(["validate", "--sets", "2", "--pixels", "64", "--out"]);
    refused(validate.arg(&out), &["sets.csv"]);
    assert_eq!(names(&out), ["sets.csv"]);
}

/// Names that are not Unicode: read again for exports and maps by the name they have.
#[cfg(target_os = "linux")]
#[test]
fn names_that_are_not_unicode() {
    use std::os::unix::ffi::OsStrExt as _;
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let odd = folder.path().join("odd");
    std::fs::create_dir(&odd).expect("a folder");
    for (number, name) in [(0, b"a\xfe.spm"), (1, b"a\xff.spm")] {
        let name = std::ffi::OsStr::from_bytes(name);
        let scan = scans.join(format!("scan.{number:03}.spm"));
        std::fs::copy(scan, odd.join(name)).expect("copied");
    }
    let out = folder.path().join("out");
    let few = [
        "--drift-draws",
        "0",
        "--strain-draws",
        "0",
        "--export",
        "corrected.npz",
    ];
    succeed(analyze(&odd, &out).args(few));
    let exported = names(&out.join("corrected"));
    assert_eq!(exported.len(), 4, "{exported:?}");
    assert!(exported[0].contains("a%FE.spm"), "{exported:?}");
    let found = results(&out);
    let file = |scan: usize| {
        found["sets"][0]["scans"][scan]["file"]
            .as_str()
            .expect("a name")
    };
    assert_ne!(file(0), file(1));
    // Each export is that of its own file.
    let plain = folder.path().join("plain");
    let two = [scans.join("scan.000.spm"), scans.join("scan.001.spm")];
    let mut command = program();
    command.arg("analyze").args(&two).arg("--no-report");
    succeed(command.args(few).arg("--out").arg(&plain));
    let values = |path: PathBuf| {
        let scan = spmfile::read(&std::fs::read(path).expect("a file")).expect("a scan");
        scan.channels[0].values()
    };
    for (odd, plain) in exported.iter().zip(names(&plain.join("corrected"))) {
        let a = values(out.join("corrected").join(odd));
        let b = values(folder.path().join("plain/corrected").join(plain));
        let same = |(a, b): (&f64, &f64)| a == b || (a.is_nan() && b.is_nan());
        assert!(a.len() == b.len() && a.iter().zip(&b).all(same), "{odd}");
    }
    let mut map = program();
    map.arg("map")
        .arg(&odd)
        .args(["--no-report", "--quiet", "--out"]);
    succeed(map.arg(folder.path().join("map")));
}

#[test]
fn one_scan_is_told_as_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut simulate = program();
    simulate.arg("simulate").arg("--out").arg(folder.path());
    let said = succeed(simulate.args(["--scans", "1", "--pixels", "32"])).stdout;
    assert!(said.contains(": 1 scan, twist"), "{said}");
}
