//! The whole protocol: ten scans of 512 × 512 from the files to results.json and the tables.
//!
//! `cargo bench -p moiregauge-cli`. Trace and retrace, 10,000 draws of the drift, 1,000 draws of twist
//! and strain for each scan; no figures. Beside it, reading the same files and doing nothing.

use std::path::{Path, PathBuf};
use std::process::Command;

use divan::Bencher;

fn main() {
    divan::main();
}

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_moiregauge"))
}

fn succeed(command: &mut Command) {
    let output = command.output().expect("the program starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
}

/// The ten scans, in a folder that lives as long as the first part.
fn scans() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    succeed(program().arg("simulate").arg("--out").arg(folder.path()));
    let scans = folder.path().join("simulated");
    (folder, scans)
}

fn analyze(scans: &Path, out: &Path, threads: usize, method: &str) {
    let mut command = program();
    command.arg("analyze").arg(scans).arg("--out").arg(out);
    command.args(["--no-report", "--quiet", "--force", "--method", method]);
    succeed(command.arg("--threads").arg(threads.to_string()));
}

#[divan::bench(args = [1, 2, 4], sample_count = 5, sample_size = 1)]
fn ten_scans_by_threads(bencher: Bencher<'_, '_>, threads: usize) {
    let (folder, scans) = scans();
    let out = folder.path().join("out");
    bencher.bench(|| analyze(&scans, &out, threads, "lattice"));
}

#[divan::bench(args = ["autocorrelation", "fourier", "lattice", "paper"], sample_count = 5, sample_size = 1)]
fn ten_scans_by_method(bencher: Bencher<'_, '_>, method: &str) {
    let (folder, scans) = scans();
    let out = folder.path().join("out");
    bencher.bench(|| analyze(&scans, &out, 2, method));
}

/// The three sets of arXiv 2406.08681: 26 scans, trace and retrace; the joint fit beside the
/// autocorrelation route, two threads.
#[divan::bench(args = ["lattice", "autocorrelation"], sample_count = 3, sample_size = 1)]
fn three_sets_of_26_scans(bencher: Bencher<'_, '_>, method: &str) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let sets = folder.path().join("sets");
    succeed(program().args(["simulate", "--paper", "--out"]).arg(&sets));
    let entries = std::fs::read_dir(&sets).expect("the folder of the sets");
    let mut paths: Vec<PathBuf> = entries.map(|e| e.expect("an entry").path()).collect();
    paths.retain(|path| path.is_dir());
    paths.sort();
    let out = folder.path().join("out");
    bencher.bench(|| {
        let mut command = program();
        command.arg("analyze").args(&paths).arg("--out").arg(&out);
        command.args(["--no-report", "--quiet", "--force", "--threads", "2"]);
        succeed(command.args(["--method", method]));
    });
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn read_the_files_only(bencher: Bencher<'_, '_>) {
    let (_folder, scans) = scans();
    bencher.bench(|| {
        let entries = std::fs::read_dir(&scans).expect("the folder");
        entries
            .map(|entry| std::fs::read(entry.expect("an entry").path()).expect("a file"))
            .map(|bytes| bytes.len())
            .sum::<usize>()
    });
}
