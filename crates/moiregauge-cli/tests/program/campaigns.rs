//! Many samples: one table, whatever fails, however often it is stopped, and however it is divided.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{program, run, simulate, succeed};
use crate::outputs::{UNFINISHED, contents, names, refused};

/// Five good samples and one without scans.
fn samples(folder: &Path) -> PathBuf {
    let root = folder.join("root");
    for seed in ["1", "2", "3", "4", "5"] {
        let sample = root.join(format!("device {seed}"));
        let options = ["--pixels", "64", "--scans", "2", "--seed", seed];
        simulate(&sample, &options);
    }
    std::fs::create_dir_all(root.join("broken")).expect("a folder");
    std::fs::write(root.join("broken/scan.000"), "junk").expect("written");
    root
}

fn campaign(root: &Path, out: &Path, options: &[&str]) -> Command {
    let mut command = program();
    command.arg("campaign").arg(root).arg("--out").arg(out);
    command.args(["--drift-draws", "10", "--strain-draws", "10"]);
    command.args(options);
    command
}

fn merge(folders: &[&Path], out: &Path, options: &[&str]) -> Command {
    let mut command = program();
    command.arg("merge").args(folders).arg("--out").arg(out);
    command.args(options);
    command
}

/// One sample failed, and the run came to its end.
fn ended(command: &mut Command) -> String {
    let run = run(command);
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    run.stdout
}

fn csv(out: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(out.join("samples.csv")).expect("a table");
    let lines = text.lines();
    lines
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect()
}

#[test]
fn a_campaign_is_one_table_and_goes_on_after_failures() {
    let folder = tempfile::tempdir().expect("a folder");
    let (root, out) = (samples(folder.path()), folder.path().join("out"));
    let words = ended(&mut campaign(&root, &out, &[]));
    assert!(
        words.contains("6 samples:") && words.contains("1 failed"),
        "{words}"
    );
    let table = csv(&out);
    let column = |name: &str| table[0].iter().position(|n| n == name).expect("a column");
    for name in [
        "sample",
        "status",
        "scans",
        "twist_deg",
        "twist_sigma_deg",
        "twist_sigma_total_deg",
        "heterostrain_percent",
        "heterostrain_sigma_total_percent",
        "drift_x_nm_per_min",
        "drift_y_nm_per_min",
        "caveats",
        "error",
    ] {
        column(name);
    }
    let of = |name: &str| -> Vec<&str> {
        let column = column(name);
        table[1..].iter().map(|row| row[column].as_str()).collect()
    };
    assert_eq!(of("sample")[..2], ["broken", "device 1/simulated"]);
    assert_eq!(of("status")[0], "failed");
    assert_eq!(of("scans")[1..], ["2"; 5]);
    for twist in &of("twist_deg")[1..] {
        let twist: f64 = twist.parse().expect("a number");
        assert!((twist - 1.13).abs() < 0.02, "{twist}");
    }
    let failed = std::fs::read_to_string(out.join("failed.csv")).expect("a table");
    assert!(failed.contains("broken,broken/scan.000,"), "{failed}");
    let page = std::fs::read_to_string(out.join("campaign.html")).expect("a page");
    assert_eq!(page.matches("<img src=\"parts/").count(), 5);
    // Nothing tells where and when it was made.
    let here = folder.path().to_string_lossy().into_owned();
    for (name, bytes) in contents(&out) {
        let text = String::from_utf8_lossy(&bytes);
        assert!(!text.contains(&here), "{}", name.display());
    }
    // A second run does nothing, and a new sample is the only one that is analysed.
    let before = contents(&out);
    let words = ended(&mut campaign(&root, &out, &["--threads", "1"]));
    assert!(words.contains("6 of them were done before"), "{words}");
    assert!(contents(&out) == before);
    simulate(
        &root.join("new"),
        &["--pixels", "64", "--scans", "2", "--seed", "9"],
    );
    let words = ended(&mut campaign(&root, &out, &[]));
    assert!(
        words.contains("7 samples:") && words.contains("6 of them"),
        "{words}"
    );
    // As if it had been there from the beginning, on any number of threads.
    let fresh = folder.path().join("fresh");
    ended(&mut campaign(&root, &fresh, &["--threads", "3"]));
    assert!(contents(&fresh) == contents(&out));
}

#[test]
fn a_table_says_which_files_are_which_sample() {
    let folder = tempfile::tempdir().expect("a folder");
    let (root, out) = (samples(folder.path()), folder.path().join("out"));
    let table = folder.path().join("which.csv");
    let lines = "sample,path\nboth,device 1/simulated\nboth,device 2/simulated\none,device 3/simulated/*.spm\n";
    std::fs::write(&table, lines).expect("written");
    let option = table.to_string_lossy().into_owned();
    succeed(&mut campaign(&root, &out, &["--samples", &option]));
    let table = csv(&out);
    let of: Vec<[&str; 2]> = table[1..]
        .iter()
        .map(|r| [r[0].as_str(), r[3].as_str()])
        .collect();
    assert_eq!(of, [["both", "4"], ["one", "2"]]);
}

/// Kills a command after a share of the time that it takes.
fn killed(mut command: Command, after: Duration) {
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut running = command.spawn().expect("the program starts");
    std::thread::sleep(after);
    running.kill().ok();
    running.wait().expect("it ends");
}

/// Shares of a run, spread over it without a pattern: steps of the golden ratio.
fn moments() -> impl Iterator<Item = f64> {
    (1..).map(|n| (f64::from(n) * 0.618_033_988_749_895).fract())
}

/// Campaigns killed at 50 moments, whole and in shards, come to the bytes of the one that was left alone.
#[test]
fn killed_campaigns_come_to_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = samples(folder.path());
    let [alone, out, merged] = ["alone", "out", "merged"].map(|name| folder.path().join(name));
    let started = Instant::now();
    ended(&mut campaign(&root, &alone, &[]));
    let length = started.elapsed();
    let alone = contents(&alone);
    let mut moments = moments();
    let mut moment = move || length.mul_f64(moments.next().expect("no end"));
    for _ in 0..2 {
        for _ in 0..13 {
            killed(campaign(&root, &out, &[]), moment());
        }
        ended(&mut campaign(&root, &out, &[]));
        assert!(contents(&out) == alone);
        assert!(!out.join(UNFINISHED).exists());
        std::fs::remove_dir_all(&out).expect("removed");
    }
    // Two shards into folders of their own, then into one folder that is merged in place.
    for same in [false, true] {
        let shards = ["1/2", "2/2"].map(|shard| {
            let name = if same { "shared" } else { &shard[..1] };
            (shard, folder.path().join(name))
        });
        for (shard, into) in &shards {
            // A shard takes half of the time.
            for _ in 0..6 {
                let command = campaign(&root, into, &["--shard", shard]);
                killed(command, moment() / 2);
            }
            run(&mut campaign(&root, into, &["--shard", shard]));
            assert!(!into.join("samples.csv").exists());
        }
        let folders: Vec<&Path> = shards.iter().map(|(_, into)| into.as_path()).collect();
        let target = if same { folders[0] } else { &merged };
        ended(&mut merge(&folders, target, &[]));
        assert!(contents(target) == alone, "{:?}", names(target));
    }
}

#[test]
fn what_does_not_fit_is_not_merged() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = samples(folder.path());
    let [one, two, other, out] =
        ["one", "two", "other", "out"].map(|name| folder.path().join(name));
    run(&mut campaign(&root, &one, &["--shard", "1/2"]));
    run(&mut campaign(
        &root,
        &other,
        &["--shard", "2/2", "--seed", "7"],
    ));
    refused(
        &mut merge(&[&one], &out, &[]),
        &["shards 2 of 2", "--incomplete"],
    );
    refused(
        &mut merge(&[&one, &other], &out, &[]),
        &["different settings", "--mixed"],
    );
    refused(
        &mut merge(&[&two], &out, &[]),
        &["expected a folder of `campaign`"],
    );
    assert!(!out.join("samples.csv").exists());
    run(&mut merge(&[&one], &out, &["--incomplete"]));
    assert_eq!(csv(&out).len(), 4);
    // A list of another version.
    run(&mut campaign(&root, &two, &["--shard", "2/2"]));
    let list = two.join("parts/list-2-of-2.json");
    let text = std::fs::read_to_string(&list).expect("a list");
    let version = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(text.contains(&version), "{text}");
    std::fs::write(&list, text.replace(&version, "\"version\": \"0.0.1\"")).expect("written");
    refused(
        &mut merge(&[&one, &two], &out, &[]),
        &["made by version 0.0.1"],
    );
}

#[test]
fn what_goes_with_one_sample_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = samples(folder.path());
    let out = folder.path().join("out");
    for (options, words) in [
        (&["--export", "a.gwy"][..], "--export is for one sample"),
        (&["--shard", "3/2"], "expected a shard"),
        (&["--drift", "NaN", "0"], "--drift"),
    ] {
        let run = run(&mut campaign(&root, &out, options));
        assert_ne!(run.code, Some(0));
        assert!(run.stderr.contains(words), "{}", run.stderr);
    }
    let mut none = campaign(&folder.path().join("nowhere"), &out, &[]);
    refused(&mut none, &["expected a folder"]);
    assert!(!out.exists());
}
