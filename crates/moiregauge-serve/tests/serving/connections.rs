//! Many connections, slow ones, streams, and the end.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use super::common::{Server, options};

/// A thousand connections that say little or nothing: the page is answered all the same.
#[test]
fn slow_connections_do_not_keep_others_out() {
    let server = Server::start(options(&[]));
    let mut slow = Vec::new();
    for number in 0..1000 {
        // This process has an end of each, too, and the number of open files is limited.
        if slow.len() >= 300 {
            slow.remove(0);
        }
        let Ok(mut stream) = TcpStream::connect(("127.0.0.1", server.port)) else {
            continue;
        };
        match number % 3 {
            0 => {}
            1 => drop(stream.write_all(b"GET / HT")),
            _ => drop(stream.write_all(b"POST /api/session HTTP/1.1\r\nhost: x\r\ncontent-le")),
        }
        slow.push(stream);
        if number % 100 == 99 {
            let begun = Instant::now();
            assert_eq!(server.get("/api/state").status, 200);
            assert!(
                begun.elapsed() < Duration::from_secs(2),
                "{:?}",
                begun.elapsed()
            );
        }
    }
    assert!(slow.len() >= 250);
}

/// A connection of the page stays while strangers come and go.
#[test]
fn the_page_is_not_closed_for_strangers() {
    let server = Server::start(options(&[]));
    let mut page = server.connect();
    let ask = format!(
        "GET /api/state HTTP/1.1\r\nhost: {}\r\n{}\r\n\r\n",
        server.host(),
        server.cookie()
    );
    let mut answer = [0; 4096];
    page.write_all(ask.as_bytes()).unwrap();
    assert!(page.read(&mut answer).unwrap() > 0);
    let strangers: Vec<TcpStream> = (0..250)
        .map(|_| TcpStream::connect(("127.0.0.1", server.port)).unwrap())
        .collect();
    std::thread::sleep(Duration::from_millis(200));
    page.write_all(ask.as_bytes()).unwrap();
    assert!(page.read(&mut answer).unwrap() > 0);
    assert_eq!(strangers.len(), 250);
}

#[test]
fn heads_that_are_too_long_are_refused() {
    let server = Server::start(options(&[]));
    let long = format!("x-long: {}", "x".repeat(100_000));
    let mut stream = server.connect();
    let _ = stream.write_all(
        format!(
            "GET / HTTP/1.1\r\nhost: {}\r\n{long}\r\n\r\n",
            server.host()
        )
        .as_bytes(),
    );
    let mut said = Vec::new();
    let _ = stream.read_to_end(&mut said);
    assert!(
        said.is_empty() || said.starts_with(b"HTTP/1.1 431"),
        "{:?}",
        String::from_utf8_lossy(&said)
    );
}

fn stream(server: &Server, last: Option<&str>) -> TcpStream {
    let mut stream = server.connect();
    let last = last.map_or_else(String::new, |id| format!("last-event-id: {id}\r\n"));
    let ask = format!(
        "GET /api/events HTTP/1.1\r\nhost: {}\r\n{}\r\n{last}\r\n",
        server.host(),
        server.cookie()
    );
    stream.write_all(ask.as_bytes()).unwrap();
    stream
}

/// Reads until some text has come.
fn until(stream: &mut TcpStream, text: &str) -> String {
    let (mut all, mut piece) = (String::new(), [0; 4096]);
    while !all.contains(text) {
        let count = stream.read(&mut piece).unwrap();
        assert!(count > 0, "ended before {text:?}: {all}");
        all += &String::from_utf8_lossy(&piece[..count]);
    }
    all
}

/// Streams of events tell what a page has missed, or that it has to ask anew; and they end with the server, at once.
#[test]
fn events_go_on_where_they_were_and_end_with_the_server() {
    let folder = tempfile::tempdir().unwrap();
    super::common::scans(folder.path(), 1);
    let mut server = Server::start(options(&[folder.path()]));
    let mut first = stream(&server, None);
    until(&mut first, "text/event-stream");
    let work = serde_json::json!({"files": server.files(""), "run": true});
    let work = server.post("/api/works", &work).good();
    let path = format!("/api/works/{}", work["work"].as_str().unwrap());
    assert_eq!(server.wait(&path)["state"], "done");
    let said = until(&mut first, r#""state":"done""#);
    assert!(
        said.contains("event: work") && said.contains("measuring scans"),
        "{said}"
    );
    let id = said
        .lines()
        .find_map(|l| l.strip_prefix("id: "))
        .unwrap()
        .trim()
        .to_owned();
    // What came after the first event comes again.
    let mut again = stream(&server, Some(&id));
    let said = until(&mut again, r#""state":"done""#);
    assert!(
        !said.contains(&format!("id: {id}\n")) && !said.contains("event: reset"),
        "{said}"
    );
    let mut of_another = stream(&server, Some("00000000-3"));
    until(&mut of_another, "event: reset");
    let took = server.end();
    assert!(took < Duration::from_secs(2), "{took:?}");
    for mut stream in [first, again, of_another] {
        let mut rest = Vec::new();
        // Ended, not waiting.
        let _ = stream.read_to_end(&mut rest);
    }
}

/// A server that nobody asks does next to nothing: less than 1 % of a processor.
#[cfg(target_os = "linux")]
#[test]
fn idle_servers_cost_nothing() {
    // The threads of a server alone; other tests run in this process.
    let ticks = || {
        let mut sum = 0;
        for task in std::fs::read_dir("/proc/self/task").unwrap().flatten() {
            let stat = std::fs::read_to_string(task.path().join("stat")).unwrap_or_default();
            let comm = stat.split_once(") ").map_or("", |(comm, _)| comm);
            if comm.contains("(idle-server") {
                let fields: Vec<&str> = stat.rsplit_once(") ").unwrap().1.split(' ').collect();
                sum += fields[11].parse::<u64>().unwrap() + fields[12].parse::<u64>().unwrap();
            }
        }
        sum
    };
    let cancel = moiregauge_pipeline::Cancel::new();
    let stop = cancel.clone();
    let (send, receive) = std::sync::mpsc::channel();
    let thread = std::thread::Builder::new().name("idle-server".to_owned());
    // The thread that waits for the wish to stop; the others sleep until somebody asks.
    let thread = thread.spawn(move || {
        moiregauge_serve::serve(&options(&[]), &stop, &mut |_| send.send(()).unwrap()).unwrap();
    });
    receive.recv().unwrap();
    let before = ticks();
    std::thread::sleep(Duration::from_secs(3));
    let used = ticks() - before;
    cancel.cancel();
    thread.unwrap().join().unwrap();
    // Ticks of 10 ms.
    assert!(used <= 3, "{used} ticks in 3 s");
}
