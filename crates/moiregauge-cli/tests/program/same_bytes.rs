//! Same inputs, same settings, same seed: the same bytes, on any number of threads.

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::{program, small_set, succeed};

/// Every file below a folder by its name.
pub(crate) fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            for (inner, bytes) in contents(&path) {
                files.insert(format!("{name}/{inner}"), bytes);
            }
        } else {
            files.insert(name, std::fs::read(&path).unwrap());
        }
    }
    files
}

fn analysed(scans: &Path, options: &[&str]) -> BTreeMap<String, Vec<u8>> {
    let out = tempfile::tempdir().unwrap();
    let mut command = program();
    command.arg("analyze").arg(scans).arg("--out");
    succeed(command.arg(out.path()).args(options));
    contents(out.path())
}

pub(crate) fn assert_same(
    a: &BTreeMap<String, Vec<u8>>,
    b: &BTreeMap<String, Vec<u8>>,
    what: &str,
) {
    assert!(a.keys().eq(b.keys()), "{what}: other files");
    let differ: Vec<&String> = a.keys().filter(|name| a[*name] != b[*name]).collect();
    assert!(differ.is_empty(), "{what}: {differ:?} differ");
}

#[test]
fn results_tables_figures_and_report_do_not_depend_on_threads_or_on_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let one = analysed(&scans, &["--threads", "1"]);
    for name in [
        "results.json",
        "vectors.csv",
        "scans.csv",
        "sets.csv",
        "report.html",
    ] {
        assert!(one.contains_key(name), "{name} is missing");
    }
    for ending in [".svg", ".png"] {
        let figures = one.keys().filter(|name| name.ends_with(ending)).count();
        assert!(figures > 5, "only {figures} figures in {ending}");
    }
    assert!(one.values().all(|bytes| !bytes.is_empty()));
    assert_same(&one, &analysed(&scans, &["--threads", "1"]), "a rerun");
    assert_same(&one, &analysed(&scans, &["--threads", "2"]), "2 threads");
    assert_same(&one, &analysed(&scans, &["--threads", "7"]), "7 threads");
}

/// The counterpart: where the seed changes, the draws do, or the test above would prove nothing.
#[test]
fn another_seed_gives_other_draws() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let one = analysed(&scans, &["--no-report", "--seed", "1"]);
    let two = analysed(&scans, &["--no-report", "--seed", "2"]);
    assert_ne!(one["results.json"], two["results.json"]);
}

#[test]
fn a_simulation_gives_the_same_files_again() {
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let sets = folders.each_ref().map(|folder| small_set(folder.path()));
    assert_same(&contents(&sets[0]), &contents(&sets[1]), "a rerun");
}
