//! Runs that are killed, that meet another one, or that find no room: what they leave is whole.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{analyze, program, results, run, simulate, small_set, succeed};
use crate::outputs::{UNFINISHED, contents, names, refused};

/// A second run into one folder ends at once with the reason, and the first one is as if it had been alone.
#[test]
fn two_runs_into_one_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = simulate(folder.path(), &["--pixels", "256", "--scans", "6"]);
    let (alone, out) = (folder.path().join("alone"), folder.path().join("out"));
    let draws = ["--drift-draws", "100", "--strain-draws", "100"];
    succeed(analyze(&scans, &alone).args(draws));
    let mut first = analyze(&scans, &out);
    let mut first = first
        .args(draws)
        .stdout(Stdio::null())
        .spawn()
        .expect("the program starts");
    let started = Instant::now();
    while !out.join(UNFINISHED).join("lock").exists() {
        assert!(started.elapsed() < Duration::from_secs(60), "no lock");
        std::thread::sleep(Duration::from_millis(1));
    }
    refused(
        analyze(&scans, &out).args(["--seed", "2", "--force"]),
        &["another run"],
    );
    assert!(first.wait().expect("it ends").success());
    assert_eq!(results(&out)["seed"], results(&alone)["seed"]);
    let csv = |folder: &Path| std::fs::read(folder.join("sets.csv")).expect("a table");
    assert_eq!(csv(&out), csv(&alone));
    assert!(!out.join(UNFINISHED).exists());
}

/// Kills a run after each of some delays that cover it, and looks at what it left.
fn killed(command: &mut dyn FnMut() -> Command, times: u32, look: &mut dyn FnMut()) {
    let started = Instant::now();
    succeed(&mut command());
    let length = started.elapsed();
    for number in 0..times {
        let mut killed = command();
        killed.stdout(Stdio::null()).stderr(Stdio::null());
        let mut killed = killed.spawn().expect("the program starts");
        std::thread::sleep(length * number / times);
        killed.kill().ok();
        killed.wait().expect("it ends");
        look();
    }
}

/// `convert`, killed 24 times: under final names there are whole files only, old or new.
#[test]
fn killed_conversions_leave_whole_files_only() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = simulate(folder.path(), &["--pixels", "256", "--scans", "4"]);
    let out = folder.path().join("out");
    let convert = |out: &Path, format: &str| {
        let mut command = program();
        command.arg("convert").arg(&scans).arg(out);
        command.args(["--to", format, "--force"]);
        command
    };
    for format in ["gwy", "zarr"] {
        let whole = folder.path().join(format!("whole-{format}"));
        succeed(&mut convert(&whole, format));
        let whole = contents(&whole);
        killed(&mut || convert(&out, format), 12, &mut || {
            for (name, bytes) in contents(&out) {
                assert!(whole.get(&name) == Some(&bytes), "{}", name.display());
            }
        });
        // The next run sweeps up.
        succeed(&mut convert(&out, format));
        assert!(contents(&out) == whole);
        assert!(!names(&out).iter().any(|n| n.starts_with(UNFINISHED)));
        std::fs::remove_dir_all(&out).expect("removed");
    }
}

/// `analyze`, killed at 12 moments: the results are the old ones, the new ones, or none, each as a whole.
#[test]
fn killed_analyses_leave_whole_results_only() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = simulate(folder.path(), &["--pixels", "128", "--scans", "2"]);
    let out = folder.path().join("out");
    let analysis = |out: &Path, options: &[&str]| {
        let mut command = analyze(&scans, out);
        command.args(["--drift-draws", "0", "--strain-draws", "0"]);
        command.args(options);
        command
    };
    let [old, new] = [("old", "gwy"), ("new", "npz")].map(|(name, format)| {
        let folder = folder.path().join(name);
        succeed(&mut analysis(
            &folder,
            &["--export", &format!("{name}.{format}")],
        ));
        contents(&folder)
    });
    assert!(old.len() > 5 && old != new);
    succeed(&mut analysis(&out, &["--export", "old.gwy"]));
    let forced = || analysis(&out, &["--export", "new.npz", "--force"]);
    killed(&mut || forced(), 12, &mut || {
        // What stopped while files were moved is completed by any run, here by one that is refused.
        refused(&mut analysis(&out, &[]), &["already holds results"]);
        let now = contents(&out);
        assert!(now == old || now == new, "{:?}", now.keys());
        assert!(!out.join(UNFINISHED).exists());
        if now == new {
            succeed(&mut analysis(&out, &["--export", "old.gwy", "--force"]));
        }
    });
}

/// A disk that is full, as far as a test can have one: no file may be larger than 10 kB.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_the_old_files_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let limited = |arguments: &[&std::ffi::OsStr]| {
        let mut command = Command::new("sh");
        command.args(["-c", "trap '' XFSZ; ulimit -f 10; exec \"$@\"", "sh"]);
        command
            .arg(env!("CARGO_BIN_EXE_moiregauge"))
            .args(arguments);
        command
    };
    let out = folder.path().join("out");
    succeed(analyze(&scans, &out).args(["--drift-draws", "0", "--strain-draws", "0"]));
    let before = contents(&out);
    let arguments = [
        "analyze".as_ref(),
        scans.as_os_str(),
        "--out".as_ref(),
        out.as_os_str(),
    ];
    let options = ["--no-report", "--seed", "2", "--force"].map(std::ffi::OsStr::new);
    refused(
        &mut limited(&[&arguments[..], &options].concat()),
        &["cannot write"],
    );
    assert!(contents(&out) == before);
    assert_eq!(names(&out).len(), before.len());

    let raw = folder.path().join("raw.gwy");
    let one = scans.join("scan.000.spm");
    succeed(program().arg("convert").arg(&one).arg(&raw));
    let bytes = std::fs::read(&raw).expect("a file");
    let other = scans.join("scan.001.spm");
    for input in [&other, &raw] {
        let arguments = [
            "convert".as_ref(),
            input.as_os_str(),
            raw.as_os_str(),
            "--force".as_ref(),
        ];
        let run = run(&mut limited(&arguments));
        assert_eq!(run.code, Some(1), "{}", run.stderr);
        assert!(std::fs::read(&raw).expect("a file") == bytes);
    }
}
