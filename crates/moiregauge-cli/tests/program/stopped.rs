//! Ctrl-C: the run ends soon, says how to go on, and the next one goes on.

#![cfg(unix)]

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{program, simulate, succeed};
use crate::outputs::{UNFINISHED, contents};

/// A command that takes longer than this to end was not stopped.
const SOON: Duration = Duration::from_secs(10);

/// What a run says that gets Ctrl-C after a while; `None` where it had ended before.
fn stopped(command: &mut Command, after: Duration) -> Option<String> {
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    let running = command.spawn().expect("the program starts");
    std::thread::sleep(after);
    let number = running.id().to_string();
    let signal = Instant::now();
    // It may have ended by itself.
    Command::new("kill")
        .args(["-INT", &number])
        .stderr(Stdio::null())
        .status()
        .expect("kill");
    let output = running.wait_with_output().expect("it ends");
    assert!(signal.elapsed() < SOON, "{:?}", signal.elapsed());
    let words = String::from_utf8(output.stderr).expect("UTF-8");
    match output.status.code() {
        Some(130) => Some(words),
        // The signal came before anybody listened to it.
        None => Some(String::new()),
        Some(code) => {
            assert!(code < 2, "{words}");
            None
        }
    }
}

fn command(name: &str, scans: &Path, out: &Path, options: &[&str]) -> Command {
    let mut command = program();
    command.arg(name).arg(scans).arg("--out").arg(out);
    command.args([
        "--drift-draws",
        "100",
        "--strain-draws",
        "100",
        "--threads",
        "1",
    ]);
    command.args(options);
    command
}

/// Stops runs at moments all over them; whatever they leave, the next run makes the bytes of one that was left alone.
fn at_many_moments(name: &str, scans: &Path, folder: &Path, options: &[&str]) -> Vec<String> {
    let (alone, out) = (folder.join("alone"), folder.join("out"));
    let started = Instant::now();
    succeed(&mut command(name, scans, &alone, options));
    let length = started.elapsed();
    let alone = contents(&alone);
    let mut said = Vec::new();
    for moment in 0..8 {
        let words = stopped(
            &mut command(name, scans, &out, options),
            length * moment / 8,
        );
        if let Some(words) = words {
            said.push(words);
            assert!(contents(&out).is_empty() || name == "campaign");
            succeed(&mut command(name, scans, &out, options));
        }
        assert!(contents(&out) == alone, "moment {moment}");
        assert!(!out.join(UNFINISHED).exists());
        std::fs::remove_dir_all(&out).expect("removed");
    }
    said
}

#[test]
fn analyses_go_on_with_what_is_measured() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = simulate(folder.path(), &["--pixels", "256", "--scans", "6"]);
    let said = at_many_moments("analyze", &scans, folder.path(), &[]);
    let kept = said
        .iter()
        .filter(|words| words.contains("measured and kept; run the same command again"));
    assert!(kept.count() > 1, "{said:?}");
}

#[test]
fn maps_are_stopped() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = simulate(folder.path(), &["--pixels", "256", "--scans", "2"]);
    let said = at_many_moments("map", &scans, folder.path(), &["--no-report"]);
    assert!(said.iter().any(|words| words.contains("stop")), "{said:?}");
}

#[test]
fn campaigns_are_stopped() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().join("root");
    for seed in ["1", "2", "3"] {
        simulate(
            &root.join(seed),
            &["--pixels", "128", "--scans", "2", "--seed", seed],
        );
    }
    let said = at_many_moments("campaign", &root, folder.path(), &[]);
    let kept = said
        .iter()
        .filter(|words| words.contains("finished samples are kept"));
    assert!(kept.count() > 0, "{said:?}");
}

/// What takes long and writes nothing.
#[test]
fn validations_are_stopped() {
    let mut command = program();
    command.args(["validate", "--sets", "100000"]);
    let words = stopped(&mut command, Duration::from_secs(1));
    assert!(words.expect("it takes longer").contains("stopping"));
}
