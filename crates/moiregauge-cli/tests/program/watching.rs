//! `moiregauge watch`: what comes out while files come in, and how it ends.

#![cfg(unix)]

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::common::{analyze, number, program, results, simulate, succeed};
use crate::outputs::{contents, refused};
use crate::schema::problems;

/// What is waited for comes long before.
const LIMIT: Duration = Duration::from_secs(120);
const QUICK: [&str; 6] = [
    "--poll",
    "100ms",
    "--drift-draws",
    "10",
    "--strain-draws",
    "10",
];

/// A watch under way, and its lines.
struct Watching {
    child: Child,
    lines: Receiver<String>,
    /// What is said beside them, once nobody has the pipe any more.
    words: Receiver<String>,
}

impl Watching {
    fn start(folder: &Path, options: &[&str]) -> Self {
        Self::by(program(), folder, options)
    }

    /// By the program, or by what starts it.
    fn by(mut command: Command, folder: &Path, options: &[&str]) -> Self {
        command.arg("watch").arg(folder).args(QUICK).args(options);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the program starts");
        let (to, lines) = channel();
        let out = BufReader::new(child.stdout.take().expect("a pipe"));
        std::thread::spawn(move || {
            for line in out.lines().map_while(Result::ok) {
                if to.send(line).is_err() {
                    break;
                }
            }
        });
        let (to, words) = channel();
        let err = child.stderr.take().expect("a pipe");
        std::thread::spawn(move || to.send(std::io::read_to_string(err).expect("UTF-8")));
        Self {
            child,
            lines,
            words,
        }
    }

    fn json(folder: &Path, options: &[&str]) -> Self {
        Self::start(folder, &[&["--json"], options].concat())
    }

    /// The next line.
    fn next(&self) -> Value {
        let line = self.lines.recv_timeout(LIMIT).expect("a line");
        let value = serde_json::from_str(&line).unwrap_or_else(|why| panic!("{why}: {line}"));
        follows_schema(&value);
        value
    }

    /// The first line with this number of frames.
    fn of(&self, frames: u64) -> Value {
        loop {
            let line = self.next();
            if line["frames"] == frames {
                return line;
            }
        }
    }

    fn signal(&self, name: &str) {
        let number = self.child.id().to_string();
        let sent = Command::new("kill").args([name, &number]).status();
        assert!(sent.expect("kill").success());
    }

    /// The exit code, and what was said beside the lines.
    fn end(mut self) -> (Option<i32>, String) {
        let begun = Instant::now();
        while begun.elapsed() < LIMIT {
            if let Some(status) = self.child.try_wait().expect("a status") {
                // Whatever a command has started would have it, too.
                let words = self.words.recv_timeout(LIMIT).expect("all have ended");
                return (status.code(), words);
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        self.child.kill().expect("killed");
        panic!("it does not end");
    }
}

/// Every line is what the published schema says.
fn follows_schema(line: &Value) {
    let schema = include_str!("../../../moiregauge-report/schema/watch-1.schema.json");
    let schema = serde_json::from_str(schema).expect("JSON");
    let wrong = problems(&schema, line);
    assert!(wrong.is_empty(), "{wrong:?} in {line}");
}

/// Scans, and an empty folder beside them.
fn scene(folder: &Path, scans: &str) -> (PathBuf, PathBuf) {
    let made = simulate(folder, &["--pixels", "128", "--scans", scans]);
    let watched = folder.join("watched");
    std::fs::create_dir(&watched).expect("a folder");
    (made, watched)
}

fn name(number: usize) -> String {
    format!("scan.{number:03}.spm")
}

fn arrive(made: &Path, watched: &Path, number: usize) {
    std::fs::copy(made.join(name(number)), watched.join(name(number))).expect("copied");
}

/// The wanted numbers of a line and of a document are equal.
fn is_same(line: &Value, results: &Value) {
    for (here, there) in [
        ("/twist_deg", "/sets/0/mean/twist_deg"),
        ("/heterostrain_percent", "/sets/0/mean/heterostrain_percent"),
        ("/drift/x_nm_per_min", "/sets/0/drift/x_nm_per_min"),
        ("/drift/y_nm_per_min", "/sets/0/drift/y_nm_per_min"),
    ] {
        for part in ["value", "sigma", "sigma_total"] {
            let [a, b] =
                [(line, here), (results, there)].map(|(v, p)| number(v, &format!("{p}/{part}")));
            assert_eq!(a, b, "{here}/{part}");
        }
    }
    assert_eq!(line["caveats"], results["caveats"]);
    assert_eq!(line["set"], results["sets"][0]["name"]);
}

/// Late, in pieces, in the wrong order; SIGTERM ends it well; the numbers are those of `analyze`, and nothing is written.
#[test]
fn the_numbers_are_those_of_an_analysis() {
    let folder = tempfile::tempdir().expect("a folder");
    let (made, watched) = scene(folder.path(), "5");
    arrive(&made, &watched, 3);
    let watching = Watching::json(&watched, &[]);
    let first = watching.next();
    assert_eq!(
        (&first["event"], &first["frames"]),
        (&Value::from("start"), &Value::from(1))
    );
    assert!(first["twist_deg"]["value"].is_null() && !first["caveats"][0]["code"].is_null());
    arrive(&made, &watched, 0);
    watching.of(2);
    // In pieces: whatever is there at a look is not whole.
    let bytes = std::fs::read(made.join(name(2))).expect("a scan");
    let mut file = std::fs::File::create(watched.join(name(2))).expect("a file");
    for piece in bytes.chunks(bytes.len() / 3) {
        file.write_all(piece).expect("written");
        file.flush().expect("written");
        std::thread::sleep(Duration::from_millis(300));
    }
    drop(file);
    let line = watching.next();
    assert_eq!(
        (&line["frames"], &line["error"]),
        (&Value::from(3), &Value::Null)
    );
    std::fs::write(watched.join("notes.txt"), "not a scan").expect("written");
    arrive(&made, &watched, 4);
    arrive(&made, &watched, 1);
    let last = watching.of(5);
    let before = contents(&watched);
    watching.signal("-TERM");
    assert_eq!(watching.end().0, Some(0));
    assert!(contents(&watched) == before);
    let out = folder.path().join("out");
    succeed(analyze(&watched, &out).args(&QUICK[2..]));
    is_same(&last, &results(&out));
}

/// A file is written anew, one is bad, one goes: each is told, and nothing ends the watch but Ctrl-C.
#[test]
fn files_change_and_the_watch_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let (made, watched) = scene(folder.path(), "4");
    (0..3).for_each(|number| arrive(&made, &watched, number));
    let watching = Watching::json(&watched, &["--patience", "500ms"]);
    assert_eq!(watching.next()["frames"], 3);
    // Results beside the scans are not scans.
    let out = watched.join("results");
    succeed(analyze(&watched, &out).args(["--export", "corrected.gwy"]));
    // Truncated, then written again with another frame.
    let place = watched.join(name(2));
    std::fs::write(&place, "").expect("written");
    std::thread::sleep(Duration::from_millis(150));
    std::fs::copy(made.join(name(3)), &place).expect("copied");
    let again = watching.next();
    assert_eq!(again["event"], "again");
    assert_eq!(again["frames"], 3);
    std::fs::write(watched.join("bad.spm"), "x").expect("written");
    let bad = watching.next();
    assert_eq!(bad["event"], "unreadable");
    assert!(
        bad["error"]
            .as_str()
            .expect("words")
            .contains("the name is that of a scan")
    );
    assert_eq!(bad["twist_deg"], again["twist_deg"]);
    std::fs::remove_file(&place).expect("removed");
    let gone = watching.next();
    assert_eq!(
        (&gone["event"], &gone["frames"]),
        (&Value::from("gone"), &Value::from(2))
    );
    watching.signal("-INT");
    assert_eq!(watching.end().0, Some(0));
}

/// The wished error ends it, and a table for people has a row for each result.
#[test]
fn a_wish_ends_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let (made, watched) = scene(folder.path(), "2");
    arrive(&made, &watched, 0);
    let watching = Watching::start(&watched, &["--until", "twist=0.05,strain=1"]);
    let mut said = vec![watching.lines.recv_timeout(LIMIT).expect("a line")];
    arrive(&made, &watched, 1);
    said.extend(watching.lines.iter());
    assert_eq!(watching.end().0, Some(0));
    let all = said.join("\n");
    for words in [
        "slow y",
        "twist °",
        "drift-undetermined",
        "scan.001.spm",
        "stop now",
    ] {
        assert!(all.contains(words), "{words}: {all}");
    }
    assert!(all.contains("1.13") && !all.contains("NaN"), "{all}");
}

/// Commands get each line; one that fails or hangs is told and stops nothing.
#[test]
fn commands_get_the_results() {
    let folder = tempfile::tempdir().expect("a folder");
    let (made, watched) = scene(folder.path(), "3");
    let log = folder.path().join("log.jsonl");
    arrive(&made, &watched, 0);
    let command = format!("echo noise; cat >> '{}'; sleep 1000 & wait", log.display());
    let options = [
        "--exec",
        &command,
        "--exec-timeout",
        "1s",
        "--until",
        "twist=0.05",
    ];
    let watching = Watching::json(&watched, &options);
    let mut lines = vec![watching.next()];
    arrive(&made, &watched, 1);
    lines.extend(
        watching
            .lines
            .iter()
            .map(|line| serde_json::from_str::<Value>(&line).expect("JSON")),
    );
    let (code, words) = watching.end();
    assert_eq!(code, Some(0), "{words}");
    assert_eq!(
        words.matches("was killed after 1.0 s").count(),
        2,
        "{words}"
    );
    assert!(words.contains("noise"), "{words}");
    let given = std::fs::read_to_string(&log).expect("a file");
    let given: Vec<Value> = given
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect();
    assert_eq!(given, lines);
    // One that fails, and one that hangs while the watch is stopped.
    let watching = Watching::json(&watched, &["--exec", "exit 3"]);
    watching.next();
    arrive(&made, &watched, 2);
    watching.of(3);
    watching.signal("-TERM");
    let (code, words) = watching.end();
    assert_eq!(code, Some(0));
    assert!(words.contains("the command failed"), "{words}");
    let watching = Watching::json(&watched, &["--exec", "sleep 1000"]);
    watching.next();
    watching.signal("-TERM");
    let begun = Instant::now();
    assert_eq!(watching.end().0, Some(0));
    assert!(begun.elapsed() < Duration::from_secs(30));
}

/// Started again it goes on: what was kept is not measured again, and the numbers are the same.
#[test]
fn it_goes_on_where_it_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let (made, watched) = scene(folder.path(), "3");
    let keep = folder.path().join("kept.json");
    let keep = keep.to_str().expect("a name");
    arrive(&made, &watched, 0);
    arrive(&made, &watched, 1);
    let watching = Watching::json(&watched, &["--keep", keep]);
    let first = watching.next();
    let begun = Instant::now();
    let two = loop {
        let two = std::fs::read(keep).expect("a file");
        if two.ends_with(b"\n") {
            break two;
        }
        assert!(begun.elapsed() < LIMIT, "nothing is kept");
        std::thread::sleep(Duration::from_millis(20));
    };
    arrive(&made, &watched, 2);
    watching.of(3);
    watching.signal("-TERM");
    assert_eq!(watching.end().0, Some(0));
    let kept = std::fs::read(keep).expect("a file");
    // What was written is not written again: the third frame is a line of its own.
    assert!(kept.starts_with(&two) && kept.len() < 2 * two.len());
    assert_eq!(kept.split_inclusive(|byte| *byte == b'\n').count(), 2);
    std::fs::remove_file(watched.join(name(2))).expect("removed");
    let watching = Watching::json(&watched, &["--keep", keep]);
    let again = watching.next();
    watching.signal("-TERM");
    assert_eq!(watching.end().0, Some(0));
    assert_eq!(again, first);
    assert!(std::fs::read(keep).expect("a file") == kept);
    // What was kept belongs to no folder of scans, and other files are not written over.
    let watch = |keep: &Path| {
        let mut command = program();
        command.arg("watch").arg(&watched).arg("--keep").arg(keep);
        command
    };
    refused(&mut watch(&watched.join("k.json")), &["--keep", "outside"]);
    refused(
        &mut watch(&made.join(name(0))),
        &["--keep", "earlier watch"],
    );
}

/// Where no more can be written, as on a full disk: the numbers come all the same, it is said, what was kept before stays,
/// and the next watch goes on from there.
#[test]
fn a_full_disk_stops_no_watch() {
    let folder = tempfile::tempdir().expect("a folder");
    let (made, watched) = scene(folder.path(), "2");
    let kept = folder.path().join("kept");
    std::fs::create_dir(&kept).expect("a folder");
    let keep = kept.join("kept.json");
    let options = ["--keep", keep.to_str().expect("a name")];
    arrive(&made, &watched, 0);
    // Room for the first frame and half of the second.
    let watching = Watching::json(&watched, &options);
    watching.of(1);
    watching.signal("-TERM");
    assert_eq!(watching.end().0, Some(0));
    let one = std::fs::metadata(&keep).expect("a file").len();
    std::fs::remove_file(&keep).expect("a file");
    let watching = Watching::by(
        crate::common::with_files_up_to(one as usize * 3 / 2 / 512),
        &watched,
        &[&["--json"], &options[..]].concat(),
    );
    watching.of(1);
    let begun = Instant::now();
    while !keep.exists() || std::fs::metadata(&keep).expect("a file").len() == 0 {
        assert!(begun.elapsed() < LIMIT, "nothing is kept");
        std::thread::sleep(Duration::from_millis(20));
    }
    let before = std::fs::read(&keep).expect("a file");
    arrive(&made, &watched, 1);
    let told = watching.of(2);
    assert!(number(&told, "/twist_deg/value").is_finite());
    watching.signal("-TERM");
    let (code, words) = watching.end();
    assert_eq!(code, Some(0));
    assert!(
        words.contains("--keep: ") && words.contains("too large"),
        "{words}"
    );
    assert!(std::fs::read(&keep).expect("a file") == before);
    let left = std::fs::read_dir(&kept).expect("a folder");
    assert_eq!(left.count(), 1, "something half-written is left");
    let watching = Watching::json(&watched, &options);
    assert_eq!(watching.of(2)["twist_deg"], told["twist_deg"]);
    watching.signal("-TERM");
    assert_eq!(watching.end().0, Some(0));
    assert!(std::fs::metadata(&keep).expect("a file").len() > before.len() as u64);
}

#[test]
fn what_cannot_be_watched_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().to_str().expect("a name");
    let watch = |arguments: &[&str]| {
        let mut command = program();
        command.arg("watch").args(arguments);
        command
    };
    refused(
        &mut watch(&[&format!("{path}/none")]),
        &["expected a folder"],
    );
    for (option, words) in [
        (["--until", "0.01"], "twist=0.01"),
        (["--poll", "0s"], "30ms"),
        (["--out", "x"], "--out is for `moiregauge analyze`"),
        (["--seed", "x"], "--seed"),
    ] {
        let mut command = watch(&[path]);
        let run = crate::common::run(command.args(option));
        assert!(
            run.code != Some(0) && run.stderr.contains(words),
            "{}",
            run.stderr
        );
    }
}
