//! A server in this process, and hand-written requests to it.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::Duration;

use moiregauge_pipeline::Cancel;
use moiregauge_pipeline::sink::MemorySink;
use moiregauge_serve::{Options, serve};
use serde_json::Value;

/// A server that ends with the test.
pub(crate) struct Server {
    pub(crate) port: u16,
    pub(crate) token: String,
    cookie: String,
    cancel: Cancel,
    thread: Option<JoinHandle<()>>,
}

/// An answer.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) headers: Vec<(String, String)>,
    pub(crate) body: Vec<u8>,
}

impl Answer {
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let found = self.headers.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_str())
    }

    pub(crate) fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&self.body)))
    }

    /// The document of an answer that must be good.
    pub(crate) fn good(&self) -> Value {
        assert_eq!(self.status, 200, "{}", String::from_utf8_lossy(&self.body));
        self.json()
    }
}

/// Options with these folders.
pub(crate) fn options(roots: &[&Path]) -> Options {
    Options {
        roots: roots.iter().map(|p| PathBuf::from(*p)).collect(),
        ..Options::default()
    }
}

impl Server {
    pub(crate) fn start(options: Options) -> Self {
        let (cancel, (send, receive)) = (Cancel::new(), channel());
        let stop = cancel.clone();
        let thread = std::thread::spawn(move || {
            let mut ready = |shown: &str| send.send(shown.to_owned()).unwrap();
            serve(&options, &stop, &mut ready).unwrap();
        });
        let shown = receive.recv_timeout(Duration::from_secs(20)).unwrap();
        let (address, token) = shown.split_once("/#token=").unwrap();
        let port = address.rsplit_once(':').unwrap().1.parse().unwrap();
        let mut server = Self {
            port,
            token: token.to_owned(),
            cookie: String::new(),
            cancel,
            thread: Some(thread),
        };
        let body = format!(r#"{{"token": "{token}"}}"#);
        let answer = server.raw(
            "POST",
            "/api/session",
            &["content-type: application/json"],
            body.as_bytes(),
        );
        assert_eq!(answer.status, 204, "{answer:?}");
        let cookie = answer.header("set-cookie").unwrap();
        server.cookie = cookie.split(';').next().unwrap_or_default().into();
        server
    }

    pub(crate) fn host(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(60)))
            .unwrap();
        stream
    }

    /// A request with these headers and no others but the host (if none of them is one) and the length.
    pub(crate) fn raw(&self, method: &str, path: &str, headers: &[&str], body: &[u8]) -> Answer {
        let mut stream = self.connect();
        let has = |name: &str| headers.iter().any(|h| h.to_lowercase().starts_with(name));
        let mut lines = vec![
            format!("{method} {path} HTTP/1.1"),
            "connection: close".to_owned(),
        ];
        if !has("host:") {
            lines.push(format!("host: {}", self.host()));
        }
        if !has("content-length:") && !body.is_empty() {
            lines.push(format!("content-length: {}", body.len()));
        }
        lines.extend(headers.iter().map(|h| (*h).to_owned()));
        let head = lines.join("\r\n") + "\r\n\r\n";
        stream.write_all(head.as_bytes()).unwrap();
        // A server that refuses a body may close before all of it is there.
        let _ = stream.write_all(body);
        read(stream)
    }

    /// A request of the page.
    pub(crate) fn asks(&self, method: &str, path: &str, body: &[u8]) -> Answer {
        let cookie = format!("cookie: {}", self.cookie);
        let origin = format!("origin: http://{}", self.host());
        let headers = [
            cookie.as_str(),
            origin.as_str(),
            "sec-fetch-site: same-origin",
            "content-type: application/json",
        ];
        self.raw(method, path, &headers, body)
    }

    pub(crate) fn get(&self, path: &str) -> Answer {
        self.asks("GET", path, b"")
    }

    pub(crate) fn post(&self, path: &str, body: &Value) -> Answer {
        self.asks("POST", path, body.to_string().as_bytes())
    }

    pub(crate) fn cookie(&self) -> String {
        format!("cookie: {}", self.cookie)
    }

    /// The ids of the files of a folder.
    pub(crate) fn files(&self, under: &str) -> Vec<String> {
        let shown = self
            .get(&format!("/api/folder?root=0&under={under}"))
            .good();
        let files = shown["files"].as_array().unwrap().iter();
        files
            .map(|f| f["file"].as_str().unwrap().to_owned())
            .collect()
    }

    /// Waits until a thing is no longer running.
    pub(crate) fn wait(&self, path: &str) -> Value {
        for _ in 0..2400 {
            let shown = self.get(path).good();
            if shown["state"] != "running" {
                return shown;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        panic!("{path} does not end");
    }

    /// Ends the server; how long that took.
    pub(crate) fn end(&mut self) -> Duration {
        let begun = std::time::Instant::now();
        self.cancel.cancel();
        if let Some(thread) = self.thread.take() {
            let ended = thread.join();
            if !std::thread::panicking() {
                ended.unwrap();
            }
        }
        begun.elapsed()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.end();
    }
}

/// Reads an answer to its end.
pub(crate) fn read(stream: TcpStream) -> Answer {
    let mut reader = BufReader::new(stream);
    let mut line = String::new();
    reader.read_line(&mut line).unwrap();
    let status = line.split(' ').nth(1).and_then(|s| s.parse().ok());
    let mut headers = Vec::new();
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line).unwrap() == 0 || line.trim().is_empty() {
            break;
        }
        if let Some((name, value)) = line.trim().split_once(": ") {
            headers.push((name.to_lowercase(), value.to_owned()));
        }
    }
    let mut body = Vec::new();
    let _ = reader.read_to_end(&mut body);
    Answer {
        status: status.unwrap_or_else(|| panic!("no answer: {line:?}")),
        headers,
        body,
    }
}

/// A few small scans in a folder.
pub(crate) fn scans(folder: &Path, count: usize) {
    scans_of(folder, count, |_| ());
}

/// The same under other conditions.
pub(crate) fn scans_of(
    folder: &Path,
    count: usize,
    change: impl FnOnce(&mut moiregauge::simulate::Simulation),
) {
    let mut set = moiregauge::simulate::Simulation::default();
    set.raster.pixels = [128; 2];
    set.raster.scans = count;
    change(&mut set);
    let job = moiregauge_pipeline::Job::quiet(Some(2)).unwrap();
    let sink = MemorySink::new();
    moiregauge_pipeline::simulate(&set, &sink, &job).unwrap();
    std::fs::create_dir_all(folder).unwrap();
    for (name, bytes) in sink.commit("simulate").unwrap() {
        std::fs::write(folder.join(name), bytes).unwrap();
    }
}
