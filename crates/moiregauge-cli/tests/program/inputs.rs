//! What is read and what is not: nothing of a folder vanishes, nothing is waited for, nothing too large is begun.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{Run, analyze, program, results, run, simulate};

/// Runs it, and insists that it ends soon.
fn soon(command: &mut Command) -> Run {
    let piped = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = piped.spawn().expect("the program starts");
    let begun = Instant::now();
    while child.try_wait().expect("a state").is_none() {
        if begun.elapsed() > Duration::from_secs(60) {
            child.kill().expect("it can be ended");
            panic!("{command:?} does not end");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let output = child.wait_with_output().expect("its output");
    Run {
        code: output.status.code(),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

fn set(folder: &Path) -> std::path::PathBuf {
    simulate(folder, &["--pixels", "128", "--scans", "2"])
}

/// An empty, a cut and a foreign file that should be scans, and three files that should not.
#[test]
fn what_looks_like_a_scan_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let scans = set(folder.path());
    let whole = std::fs::read(scans.join("scan.000.spm")).unwrap();
    std::fs::write(scans.join("scan.007.spm"), b"").unwrap();
    std::fs::write(scans.join("scan.008.spm"), &whole[..whole.len() / 2]).unwrap();
    std::fs::write(scans.join("scan.002"), b"Remember to buy milk.\n").unwrap();
    std::fs::write(scans.join("notes.txt"), b"A good day.\n").unwrap();
    std::fs::write(scans.join("empty.txt"), b"").unwrap();
    let out = folder.path().join("out");
    let ran = run(&mut analyze(&scans, &out));
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    // The third is the truth that the simulator writes.
    assert!(
        ran.stderr
            .contains("left alone: 3 other files (empty.txt, notes.txt, truth.json)"),
        "{}",
        ran.stderr
    );
    let results = results(&out);
    let failed = results["failed"].as_array().expect("a list");
    let of = |name: &str| {
        let entry = failed
            .iter()
            .find(|f| f["file"].as_str().unwrap().ends_with(name));
        entry.unwrap_or_else(|| panic!("no {name} in {failed:?}"))["error"]
            .as_str()
            .unwrap()
    };
    assert_eq!(failed.len(), 3, "{failed:?}");
    assert!(of("scan.007.spm").contains("empty"));
    assert!(of("scan.008.spm").contains("damaged"));
    assert!(of("scan.002").contains("Remember"));
    assert_eq!(results["provenance"]["inputs"].as_array().unwrap().len(), 2);
    let mut info = program();
    info.arg("info").arg(&scans);
    let mut convert = program();
    convert.arg("convert").arg(&scans);
    convert
        .arg(folder.path().join("converted"))
        .args(["--to", "gwy"]);
    for mut command in [info, convert] {
        let ran = run(&mut command);
        assert_eq!(ran.code, Some(1));
        for words in ["scan.007.spm", "scan.008.spm", "scan.002", "left alone: 3"] {
            assert!(
                ran.stderr.contains(words),
                "{command:?} {words}: {}",
                ran.stderr
            );
        }
    }
}

#[test]
fn subfolders_with_scans_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let scans = set(folder.path());
    let ran = run(&mut analyze(folder.path(), &folder.path().join("out")));
    assert_eq!(ran.code, Some(1));
    let words = format!(
        "subfolders are not searched, and there are some in {}",
        scans.display()
    );
    assert!(ran.stderr.contains(&words), "{}", ran.stderr);
}

/// `/dev/zero` never ends, and a pipe that nobody writes into never begins.
#[cfg(target_os = "linux")]
#[test]
fn devices_and_pipes_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::os::unix::fs::symlink("/dev/zero", path("zero.spm")).unwrap();
    let made = Command::new("mkfifo").arg(path("pipe.spm")).status();
    assert!(made.unwrap().success());
    let zero = Path::new("/dev/zero").to_owned();
    for (file, kind) in [
        (zero, "a device"),
        (path("zero.spm"), "a device"),
        (path("pipe.spm"), "a pipe"),
    ] {
        let words = format!("expected a file, found {kind}");
        let out = path("out");
        let given = |command: &str| {
            let mut started = program();
            started.arg(command).arg(&file);
            started
        };
        let mut commands = vec![analyze(&file, &out), given("info")];
        let mut map = given("map");
        map.args(["--out", "nowhere", "--size", "70nm×70nm"]);
        let mut convert = given("convert");
        convert.arg(path("out.gwy"));
        let mut calibrate = given("calibrate");
        calibrate.args(["--material", "graphite"]);
        let mut config = analyze(Path::new("nothing.spm"), &out);
        config.arg("--config").arg(&file);
        let mut sensors = analyze(Path::new("nothing.spm"), &out);
        sensors
            .arg("--materials")
            .arg(&file)
            .args(["--layers", "mine"]);
        commands.extend([map, convert, calibrate, config, sensors]);
        for mut command in commands {
            let ran = soon(&mut command);
            assert_ne!(ran.code, Some(0), "{command:?}");
            assert!(ran.stderr.contains(&words), "{command:?}: {}", ran.stderr);
        }
    }
    let ran = soon(&mut analyze(folder.path(), &path("out")));
    assert_eq!(ran.code, Some(1));
    assert!(
        ran.stderr.contains("found a device") && ran.stderr.contains("found a pipe"),
        "{}",
        ran.stderr
    );
}

/// 16384 × 16384 samples, none of them on the disk, and 4 GB of address space: the analysis would need 28 GB.
#[cfg(target_os = "linux")]
#[test]
fn images_beyond_memory_are_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.npy");
    let header = format!(
        "{:<117}\n",
        "{'descr': '|u1', 'fortran_order': False, 'shape': (16384, 16384), }"
    );
    let mut bytes = b"\x93NUMPY\x01\0\x76\0".to_vec();
    bytes.extend(header.bytes());
    std::fs::write(&path, &bytes).unwrap();
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.set_len(bytes.len() as u64 + 16384 * 16384).unwrap();
    let mut shell = Command::new("sh");
    shell.args(["-c", "ulimit -v 4000000; exec \"$0\" \"$@\""]);
    shell.arg(env!("CARGO_BIN_EXE_moiregauge"));
    shell
        .arg("analyze")
        .arg(&path)
        .arg("--out")
        .arg(folder.path().join("out"));
    shell.args(["--size", "1um×1um", "--threads", "1"]);
    let ran = soon(&mut shell);
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    assert!(
        ran.stderr
            .contains("16384 × 16384 samples needs 28.2 GB of memory"),
        "{}",
        ran.stderr
    );
}
