//! `moiregauge serve`: one line with the address, the bytes of `analyze`, and its end.

#![cfg(unix)]

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::common::{program, small_set};

/// What is waited for comes long before.
const LIMIT: Duration = Duration::from_secs(120);

/// A server under way, and a page that asks it.
struct Serving {
    child: Child,
    out: BufReader<ChildStdout>,
    host: String,
    token: String,
    cookie: String,
}

/// No server stays behind, whatever became of the test.
impl Drop for Serving {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Serving {
    fn start(command: &mut Command) -> Self {
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let begun = Instant::now();
        let mut child = command.spawn().expect("the program starts");
        let mut out = BufReader::new(child.stdout.take().expect("a pipe"));
        let mut line = String::new();
        out.read_line(&mut line).expect("a line");
        let (address, token) = line
            .trim()
            .split_once("/#token=")
            .expect("an address with a token");
        assert!(
            begun.elapsed() < Duration::from_secs(5),
            "{:?}",
            begun.elapsed()
        );
        let mut serving = Self {
            host: address.strip_prefix("http://").expect("http").to_owned(),
            token: token.to_owned(),
            cookie: String::new(),
            child,
            out,
        };
        let (head, _) = serving.ask("POST", "/api/session", &json!({"token": token}).to_string());
        let cookie = head
            .lines()
            .find_map(|line| line.strip_prefix("set-cookie: "));
        let cookie = cookie.and_then(|c| c.split(';').next());
        serving.cookie = cookie.expect("a cookie").into();
        serving
    }

    fn connect(&self, method: &str, path: &str, body: &str) -> TcpStream {
        let mut stream = TcpStream::connect(&self.host).expect("a connection");
        let request = format!(
            "{method} {path} HTTP/1.1\r\nhost: {}\r\ncookie: {}\r\ncontent-type: application/json\r\n\
             content-length: {}\r\nconnection: close\r\n\r\n{body}",
            self.host,
            self.cookie,
            body.len()
        );
        stream.write_all(request.as_bytes()).expect("it is sent");
        stream
    }

    /// Head and body of an answer.
    fn ask(&self, method: &str, path: &str, body: &str) -> (String, Vec<u8>) {
        let mut all = Vec::new();
        self.connect(method, path, body)
            .read_to_end(&mut all)
            .expect("an answer");
        let end = all
            .windows(4)
            .position(|w| w == b"\r\n\r\n")
            .expect("a head");
        let head = String::from_utf8_lossy(&all[..end]).into_owned();
        (head, all.split_off(end + 4))
    }

    fn json(&self, method: &str, path: &str, body: &Value) -> Value {
        let (head, body) = self.ask(method, path, &body.to_string());
        assert!(
            head.starts_with("HTTP/1.1 200"),
            "{head}\n{}",
            String::from_utf8_lossy(&body)
        );
        serde_json::from_slice(&body).expect("JSON")
    }

    fn get(&self, path: &str) -> Value {
        self.json("GET", path, &Value::Null)
    }

    /// Waits until a thing is done.
    fn done(&self, path: &str) -> Value {
        let begun = Instant::now();
        while begun.elapsed() < LIMIT {
            let shown = self.get(path);
            if shown["state"] != "running" {
                assert_eq!(shown["state"], "done", "{shown}");
                return shown;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        panic!("{path} does not end");
    }

    fn files(&self) -> Vec<String> {
        let shown = self.get("/api/folder?root=0");
        let files = shown["files"].as_array().expect("a list").iter();
        files
            .map(|f| f["file"].as_str().expect("an id").to_owned())
            .collect()
    }

    fn signal(&self, name: &str) {
        let number = self.child.id().to_string();
        let sent = Command::new("kill").args([name, &number]).status();
        assert!(sent.expect("kill").success());
    }

    /// What it said after its line, and its exit code.
    fn end(mut self) -> (Option<i32>, String) {
        let status = self.child.wait().expect("a status");
        let mut words = String::new();
        self.out.read_to_string(&mut words).expect("UTF-8");
        let mut stderr = self.child.stderr.take().expect("a pipe");
        stderr.read_to_string(&mut words).expect("UTF-8");
        (status.code(), words)
    }
}

fn serve(folder: &Path, options: &[&str]) -> Command {
    let mut command = program();
    command
        .arg("serve")
        .arg(folder)
        .arg("--no-browser")
        .args(options);
    command
}

/// The page shows what the program writes: the same bytes, for files and settings of all kinds.
#[test]
fn results_are_the_bytes_of_the_program() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let serving = Serving::start(&mut serve(&scans, &[]));
    let files = serving.files();
    let cases = [
        json!({"files": files, "run": true}),
        json!({"files": files, "excluded": [files[1]], "run": true, "settings": {
            "layers": "graphene/hBN", "seed": 5, "line": "trace", "strain_draws": 50, "frame_time_sigma_s": 0.1
        }}),
        json!({"files": [files[2], files[0]], "run": true, "known": {"line_rate_hz": 7.5, "rotation_deg": -3.0}}),
    ];
    for (number, case) in cases.iter().enumerate() {
        let work = serving.json("POST", "/api/works", case);
        let path = format!("/api/works/{}", work["work"].as_str().expect("an id"));
        serving.done(&path);
        let (_, shown) = serving.ask("GET", &format!("{path}/results.json"), "");
        let said = serving.get(&format!("{path}/command"));
        let here = folder.path().join(number.to_string());
        std::fs::create_dir(&here).expect("a folder");
        if let Some(settings) = said["settings"].as_str() {
            std::fs::write(here.join("settings.toml"), settings).expect("written");
        }
        let command = said["command"].as_str().expect("a command");
        let options = command.strip_prefix("moiregauge ").expect("the program");
        let line = format!("{} {options} --quiet", env!("CARGO_BIN_EXE_moiregauge"));
        let ran = Command::new("sh")
            .args(["-c", &line])
            .current_dir(&here)
            .output()
            .expect("a shell");
        assert!(
            ran.status.success(),
            "{line}\n{}",
            String::from_utf8_lossy(&ran.stderr)
        );
        let out = here.join("results");
        let written = std::fs::read(out.join("results.json")).expect("results");
        assert!(written == shown, "case {number}: other bytes");
        // So are all other files.
        for name in ["report.html", "scans.csv", "figures/budget.svg"] {
            let (_, bytes) = serving.ask("GET", &format!("{path}/outputs/{name}"), "");
            if let Ok(written) = std::fs::read(out.join(name)) {
                assert!(written == bytes, "case {number}: {name}");
            } else {
                assert_ne!(name, "report.html");
            }
        }
    }
}

#[test]
fn maps_are_the_bytes_of_the_program() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let serving = Serving::start(&mut serve(&scans, &[]));
    let files = serving.files();
    let wanted = json!({"files": [files[0]], "request": {"window_nm": 12.5, "questions": {
        "regions": [{"name": "bar", "corners_nm": [[10, 10], [40, 10], [40, 40]]}]
    }}});
    let map = serving.json("POST", "/api/maps", &wanted);
    let path = format!("/api/maps/{}", map["map"].as_str().expect("an id"));
    let done = serving.done(&path);
    assert!(
        done["quantities"].as_array().is_some_and(|q| q.len() > 3),
        "{done}"
    );
    let (_, shown) = serving.ask("GET", &format!("{path}/result.json"), "");
    let name = serving.get(&format!("/api/inspect?file={}", files[0]));
    let mut command = program();
    command
        .arg("map")
        .arg(name["name"].as_str().expect("a name"));
    command.args([
        "--window",
        "12.5",
        "--region",
        "bar=10,10 40,10 40,40",
        "--quiet",
        "--out",
    ]);
    let out = folder.path().join("map");
    assert!(command.arg(&out).status().expect("the program").success());
    let written = std::fs::read(out.join("map.json")).expect("a map");
    assert!(written == shown, "other bytes");
    let asked = json!({"regions": [{"name": "bar", "corners_nm": [[10, 10], [40, 10], [40, 40]]}]});
    let answer = serving.json("POST", &format!("{path}/ask"), &asked);
    let written: Value = serde_json::from_slice(&written).expect("JSON");
    assert_eq!(answer["regions"], written["details"]["regions"]);
    assert!(answer["regions"].is_array());
}

/// Ctrl-C and SIGTERM end it at once although streams of events are open; nothing that it says but the first line holds the
/// token.
#[test]
fn signals_end_it_at_once_and_the_token_is_in_no_log() {
    let folder = tempfile::tempdir().expect("a folder");
    for signal in ["-INT", "-TERM"] {
        let serving = Serving::start(&mut serve(folder.path(), &[]));
        let mut events = serving.connect("GET", "/api/events", "");
        let mut head = [0; 512];
        assert!(events.read(&mut head).expect("a head") > 0);
        serving.ask("GET", "/nothing", "");
        serving.ask("POST", "/api/session", r#"{"token": "wrong"}"#);
        let token = serving.token.clone();
        let begun = Instant::now();
        serving.signal(signal);
        let (code, words) = serving.end();
        assert!(
            begun.elapsed() < Duration::from_secs(2),
            "{:?}",
            begun.elapsed()
        );
        assert_eq!(code, Some(0), "{words}");
        assert!(!words.contains(&token), "{words}");
    }
}

/// The browser is started with a secret that lets it in once: command lines can be seen by others.
#[cfg(target_os = "linux")]
#[test]
fn browsers_are_let_in_once() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().expect("a folder");
    let browser = folder.path().join("xdg-open");
    let opened = folder.path().join("opened");
    let script = format!(
        "#!/bin/sh\necho \"$1\" > '{0}.part' && /bin/mv '{0}.part' '{0}'\n",
        opened.display()
    );
    std::fs::write(&browser, script).expect("written");
    std::fs::set_permissions(&browser, std::fs::Permissions::from_mode(0o755)).expect("set");
    let mut command = program();
    command
        .arg("serve")
        .arg(folder.path())
        .env("PATH", folder.path());
    let serving = Serving::start(&mut command);
    let begun = Instant::now();
    let address = loop {
        if let Ok(address) = std::fs::read_to_string(&opened) {
            break address;
        }
        assert!(begun.elapsed() < LIMIT, "no browser was started");
        std::thread::sleep(Duration::from_millis(20));
    };
    let (_, ticket) = address.trim().split_once("/#token=").expect("an address");
    assert_ne!(ticket, serving.token);
    let status = || {
        let (head, _) = serving.ask(
            "POST",
            "/api/session",
            &json!({"token": ticket}).to_string(),
        );
        head[9..12].to_owned()
    };
    assert_eq!(status(), "204");
    assert_eq!(status(), "401");
}

/// What was shown as saved is there after `kill -9`.
#[test]
fn killed_servers_lose_nothing_that_was_saved() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let keep = folder.path().join("works");
    let keep = ["--keep", keep.to_str().expect("UTF-8")];
    let serving = Serving::start(&mut serve(&scans, &keep));
    let work = serving.json(
        "POST",
        "/api/works",
        &json!({"files": serving.files(), "run": true}),
    );
    let path = format!("/api/works/{}", work["work"].as_str().expect("an id"));
    let done = serving.done(&path);
    assert_eq!(done["result"]["saved"], true);
    let (_, results) = serving.ask("GET", &format!("{path}/results.json"), "");
    // Another change is under way when it ends.
    serving.json(
        "PATCH",
        &path,
        &json!({"settings": {"seed": 9}, "run": true}),
    );
    serving.signal("-KILL");
    let (code, _) = serving.end();
    assert_eq!(code, None);
    let again = Serving::start(&mut serve(&scans, &keep));
    let shown = again.get(&path);
    assert_eq!(shown["settings"]["seed"], 9);
    assert!(shown["result"].is_object());
    if shown["result"]["current"] == false {
        let (_, bytes) = again.ask("GET", &format!("{path}/results.json"), "");
        assert!(bytes == results, "other bytes");
    }
}

/// Where nothing can be written, as on a full disk: the result is shown, and that it is not saved is said.
#[test]
fn a_full_disk_stops_no_server() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let keep = folder.path().join("works");
    let mut command = crate::common::with_files_up_to(16);
    command.arg("serve").arg(&scans).arg("--no-browser");
    let serving = Serving::start(command.arg("--keep").arg(&keep));
    let asked = json!({"files": serving.files(), "run": true});
    let work = serving.json("POST", "/api/works", &asked);
    let path = format!("/api/works/{}", work["work"].as_str().expect("an id"));
    let done = serving.done(&path);
    assert_eq!(
        (&done["state"], &done["result"]["saved"]),
        (&json!("done"), &json!(false))
    );
    let words = done["result"]["unsaved"].as_str().expect("words");
    assert!(
        words.contains("not saved") && words.contains("too large"),
        "{words}"
    );
    assert!(serving.get(&format!("{path}/results.json"))["sets"].is_array());
    serving.signal("-TERM");
    assert_eq!(serving.end().0, Some(0));
    // The next one knows what was asked, and saves what comes out.
    let again = Serving::start(&mut serve(
        &scans,
        &["--keep", keep.to_str().expect("UTF-8")],
    ));
    assert!(again.get(&path)["result"].is_null());
    again.json("POST", &format!("{path}/run"), &json!({}));
    assert_eq!(again.done(&path)["result"]["saved"], true);
}

#[test]
fn other_addresses_are_refused_with_the_option() {
    let run = crate::common::run(program().args(["serve", "--address", "0.0.0.0", "--no-browser"]));
    assert_eq!(run.code, Some(1));
    assert!(run.stderr.contains("--token-file"), "{}", run.stderr);
    assert_eq!(run.stdout, "");
}

/// A watch in the terminal is on the page, too: the same lines.
#[test]
fn watches_are_shown_on_a_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let mut command = program();
    command
        .arg("watch")
        .arg(&scans)
        .args(["--serve", "--no-browser", "--poll", "100ms"]);
    let serving = Serving::start(&mut command);
    let begun = Instant::now();
    let shown = loop {
        let shown = serving.get("/api/watches/x1");
        if !shown["frames"].as_array().expect("a list").is_empty() {
            break shown;
        }
        assert!(begun.elapsed() < LIMIT, "no line");
        std::thread::sleep(Duration::from_millis(100));
    };
    assert_eq!(shown["frames"][0]["frames"], 4, "{shown}");
    assert!(shown["advice"].is_string());
    serving.signal("-INT");
    assert_eq!(serving.end().0, Some(0));
}

/// The page drives watches of its own, below the folders named at the start.
#[test]
fn pages_watch_folders() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = small_set(folder.path());
    let serving = Serving::start(&mut serve(folder.path(), &[]));
    let under = scans.file_name().and_then(|n| n.to_str()).expect("a name");
    let begun = serving.json(
        "POST",
        "/api/watches",
        &json!({"root": "0", "under": under, "until": {"twist_deg": 1.0}}),
    );
    let path = format!("/api/watches/{}", begun["watch"].as_str().expect("an id"));
    let done = serving.done(&path);
    assert_eq!(done["frames"][0]["until"]["reached"], true, "{done}");
    let (head, _) = serving.ask("DELETE", &path, "");
    assert!(head.starts_with("HTTP/1.1 204"), "{head}");
    let (head, _) = serving.ask("POST", "/api/watches", r#"{"root": "0", "under": ".."}"#);
    assert!(head.starts_with("HTTP/1.1 403"), "{head}");
}
