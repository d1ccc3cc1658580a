//! What is dropped.

use super::common::{Server, options, read, scans};
use std::io::Write as _;

#[test]
fn files_are_dropped_looked_at_and_analysed_under_their_names() {
    let folder = tempfile::tempdir().unwrap();
    scans(folder.path(), 2);
    let server = Server::start(options(&[]));
    let found = moiregauge_pipeline::find(&[folder.path().to_owned()]);
    let mut ids = Vec::new();
    for path in found.frames().0 {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let bytes = std::fs::read(&path).unwrap();
        let answer = server
            .asks(
                "POST",
                &format!("/api/upload?drop=d-1&name=set%201/{name}"),
                &bytes,
            )
            .good();
        assert_eq!(answer["bytes"], bytes.len());
        ids.push(answer["file"].as_str().unwrap().to_owned());
    }
    let shown = server
        .get("/api/folder?root=dropped&under=d-1/set%201")
        .good();
    assert_eq!(shown["files"].as_array().unwrap().len(), 2);
    // The best of three: the processors may be busy.
    let timed = ids.iter().cycle().take(3).map(|id| {
        let begun = std::time::Instant::now();
        let image = server.get(&format!("/api/image?file={id}&channel=0"));
        (begun.elapsed().as_millis(), image)
    });
    let (took, image) = timed.min_by_key(|(took, _)| *took).unwrap();
    assert!(took < 300, "{took} ms");
    let [width, height] =
        ["x-width", "x-height"].map(|h| image.header(h).unwrap().parse::<usize>().unwrap());
    assert_eq!(image.body.len(), 4 * width * height);
    let thumb = server.get(&format!("/api/thumb?file={}&channel=0&size=64", ids[0]));
    assert_eq!(thumb.header("content-type"), Some("image/png"));
    let work = server
        .post(
            "/api/works",
            &serde_json::json!({"files": ids, "run": true}),
        )
        .good();
    let path = format!("/api/works/{}", work["work"].as_str().unwrap());
    let done = server.wait(&path);
    assert_eq!(done["state"], "done", "{done}");
    let results = server.get(&format!("{path}/results.json")).good();
    let file = results["provenance"]["inputs"][0]["file"].as_str().unwrap();
    assert!(file.starts_with("set 1/"), "{file}");
}

#[test]
fn names_that_lead_elsewhere_are_refused() {
    let server = Server::start(options(&[]));
    for name in [
        "..%2fa",
        "%2e%2e/a",
        "/etc/a",
        "a%00b",
        "C:%5Ca",
        "CON",
        "a:b",
        "a/../../b",
        "",
    ] {
        let answer = server.asks("POST", &format!("/api/upload?drop=d&name={name}"), b"x");
        assert_eq!(answer.status, 403, "{name}");
    }
    for drop in ["", "..", "a/b", "a%2fb", "a.b"] {
        let answer = server.asks("POST", &format!("/api/upload?drop={drop}&name=a"), b"x");
        assert_eq!(answer.status, 400, "{drop}");
    }
}

/// Too long is refused, announced or not, and leaves nothing on the disk; so does a body that breaks off.
#[test]
fn uploads_have_a_limit() {
    let keep = tempfile::tempdir().unwrap();
    let server = Server::start(moiregauge_serve::Options {
        upload_limit: 1000,
        keep: Some(keep.path().to_owned()),
        ..options(&[])
    });
    let upload = "/api/upload?drop=d&name=a";
    let left = || {
        let folder = std::fs::read_dir(keep.path().join("dropped")).unwrap();
        folder.flatten().map(|e| e.file_name()).collect::<Vec<_>>()
    };
    let answer = server.asks("POST", upload, &[0; 1001]);
    assert_eq!(answer.status, 413);
    assert!(answer.json()["what"].as_str().unwrap().contains("1000"));
    // In pieces, the length not announced.
    let mut stream = server.connect();
    let head = format!(
        "POST {upload} HTTP/1.1\r\nhost: {}\r\n{}\r\nconnection: close\r\ntransfer-encoding: chunked\r\n\r\n",
        server.host(),
        server.cookie()
    );
    stream.write_all(head.as_bytes()).unwrap();
    for _ in 0..4 {
        let _ = stream.write_all(format!("190\r\n{}\r\n", "x".repeat(400)).as_bytes());
    }
    assert_eq!(read(stream).status, 413);
    // It breaks off.
    let mut stream = server.connect();
    stream
        .write_all(
            head.replace("transfer-encoding: chunked", "content-length: 900")
                .as_bytes(),
        )
        .unwrap();
    stream.write_all(&[0; 100]).unwrap();
    drop(stream);
    for _ in 0..600 {
        if left().is_empty() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    assert!(left().is_empty(), "{:?}", left());
    assert_eq!(server.asks("POST", upload, &[0; 1000]).status, 200);
    assert_eq!(server.get("/api/state").good()["upload_limit_bytes"], 1000);
    // Documents have a limit, too.
    let long = format!(r#"{{"files": ["{}"]}}"#, "x".repeat(5 << 20));
    assert_eq!(
        server.asks("POST", "/api/works", long.as_bytes()).status,
        413
    );
}
