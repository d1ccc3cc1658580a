//! Who may ask.

use super::common::{Server, options};

const JSON: &str = "content-type: application/json";

#[test]
fn names_of_others_are_refused() {
    let server = Server::start(options(&[]));
    let cookie = server.cookie();
    let status = |host: &str, path: &str| {
        let host = format!("host: {host}");
        server.raw("GET", path, &[&host, &cookie], b"").status
    };
    let port = server.port;
    for good in [
        format!("127.0.0.1:{port}"),
        format!("localhost:{port}"),
        format!("LOCALHOST:{port}"),
    ] {
        assert_eq!(status(&good, "/api/state"), 200, "{good}");
        assert_eq!(status(&good, "/"), 200, "{good}");
    }
    for bad in [
        format!("evil.example:{port}"),
        format!("127.0.0.1.nip.io:{port}"),
        format!("127.0.0.1:{}", port ^ 1),
        format!("192.168.1.5:{port}"),
        format!("localhost.evil.example:{port}"),
        format!("evil@localhost:{port}"),
        "127.0.0.1".to_owned(),
        "localhost".to_owned(),
        String::new(),
    ] {
        assert_eq!(status(&bad, "/api/state"), 421, "{bad}");
        assert_eq!(status(&bad, "/"), 421, "{bad}");
    }
    let two = [
        format!("host: 127.0.0.1:{port}"),
        "host: evil.example".to_owned(),
        cookie.clone(),
    ];
    let two: Vec<&str> = two.iter().map(String::as_str).collect();
    assert!(server.raw("GET", "/api/state", &two, b"").status >= 400);
}

#[test]
fn pages_of_others_may_not_ask() {
    let server = Server::start(options(&[]));
    let (cookie, port) = (server.cookie(), server.port);
    let asks = |method: &str, path: &str, header: &str| {
        server
            .raw(method, path, &[header, &cookie, JSON], b"{}")
            .status
    };
    // What makes no sense is refused otherwise: the request came through.
    let own = format!("origin: http://127.0.0.1:{port}");
    assert_eq!(asks("POST", "/api/works", &own), 400);
    for origin in [
        "null".to_owned(),
        "http://evil.example".to_owned(),
        format!("https://127.0.0.1:{port}"),
        format!("http://127.0.0.1:{}", port ^ 1),
        format!("http://localhost:{port}"),
        format!("http://127.0.0.1:{port}.evil.example"),
    ] {
        for (method, path) in [
            ("POST", "/api/works"),
            ("PATCH", "/api/works/w1"),
            ("DELETE", "/api/watches/x1"),
            ("POST", "/api/session"),
        ] {
            assert_eq!(
                asks(method, path, &format!("origin: {origin}")),
                403,
                "{method} {origin}"
            );
        }
    }
    for site in ["cross-site", "same-site", "odd"] {
        let header = format!("sec-fetch-site: {site}");
        assert_eq!(asks("GET", "/api/state", &header), 403);
        assert_eq!(asks("POST", "/api/works", &header), 403);
        assert_eq!(asks("GET", "/page/index.html", &header), 403);
        // A link may lead to the page itself.
        assert_eq!(asks("GET", "/", &header), 200);
    }
    for site in ["same-origin", "none"] {
        assert_eq!(
            asks("GET", "/api/state", &format!("sec-fetch-site: {site}")),
            200
        );
    }
}

/// What a form of another page can send without asking first: no JSON.
#[test]
fn forms_are_no_documents() {
    let server = Server::start(options(&[]));
    let cookie = server.cookie();
    let body = br#"{"token": "x"}"#;
    for kind in [
        "text/plain",
        "application/x-www-form-urlencoded",
        "multipart/form-data; boundary=b",
        "text/json",
    ] {
        let kind = format!("content-type: {kind}");
        for path in [
            "/api/works",
            "/api/session",
            "/api/maps",
            "/api/moire",
            "/api/plan",
            "/api/watches",
        ] {
            assert_eq!(
                server.raw("POST", path, &[&kind, &cookie], body).status,
                415,
                "{path}"
            );
        }
    }
    let origin = [
        "origin: http://evil.example",
        "content-type: text/plain",
        cookie.as_str(),
    ];
    assert_eq!(
        server
            .raw("POST", "/api/upload?drop=d&name=a", &origin, body)
            .status,
        403
    );
}

#[test]
fn without_the_cookie_there_is_nothing() {
    let server = Server::start(options(&[]));
    let all = [
        "/api/state",
        "/api/folder?root=0",
        "/api/inspect?file=a",
        "/api/thumb?file=a&channel=0",
        "/api/image?file=a&channel=0",
        "/api/works/w1",
        "/api/works/w1/results.json",
        "/api/maps/m1",
        "/api/watches/x1",
        "/api/events",
        "/api/caveats",
        "/api/samples?root=0",
        "/api/nothing",
    ];
    let wrong = [
        String::new(),
        format!("cookie: moiregauge-{}=", server.port),
        format!("cookie: moiregauge-{}={}", server.port, "0".repeat(32)),
        // The token is not what the cookie holds.
        format!("cookie: moiregauge-{}={}", server.port, server.token),
        server.cookie().replace(&format!("-{}", server.port), "-1"),
    ];
    for path in all {
        for cookie in &wrong {
            let headers: Vec<&str> = [cookie.as_str()]
                .into_iter()
                .filter(|c| !c.is_empty())
                .collect();
            let answer = server.raw("GET", path, &headers, b"");
            assert_eq!(answer.status, 401, "{path} {cookie}");
            assert!(answer.json()["error"].as_str().unwrap().contains("token"));
        }
    }
    for path in ["/api/works", "/api/maps", "/api/upload?drop=d&name=a"] {
        assert_eq!(server.raw("POST", path, &[JSON], b"{}").status, 401);
    }
    // Among other cookies it is found.
    let among = server
        .cookie()
        .replace("cookie: ", "cookie: a=b; moiregauge-1=x; ");
    assert_eq!(server.raw("GET", "/api/state", &[&among], b"").status, 200);
}

#[test]
fn a_wrong_token_gives_no_cookie() {
    let server = Server::start(options(&[]));
    let token = server.token.clone();
    assert_eq!(token.len(), 32);
    let flipped = if token.starts_with('0') { "1" } else { "0" };
    for wrong in [
        "",
        "x",
        &token[1..],
        &format!("{token}0"),
        &token.to_uppercase().replace(|c: char| c.is_numeric(), "A"),
        &format!("{flipped}{}", &token[1..]),
    ] {
        let body = serde_json::json!({"token": wrong}).to_string();
        let answer = server.raw("POST", "/api/session", &[JSON], body.as_bytes());
        assert_eq!(answer.status, 401, "{wrong}");
        assert_eq!(answer.header("set-cookie"), None);
    }
    assert_eq!(
        server
            .raw("POST", "/api/session", &[JSON], br#"{"token": 1}"#)
            .status,
        400
    );
}

/// The token stands in the fragment, which no browser sends; no answer and no address holds it, and the cookie is not it.
#[test]
fn secrets_go_nowhere() {
    let server = Server::start(options(&[]));
    let body = serde_json::json!({"token": server.token}).to_string();
    let session = server.raw("POST", "/api/session", &[JSON], body.as_bytes());
    let cookie = session.header("set-cookie").unwrap();
    assert!(
        cookie.contains("HttpOnly")
            && cookie.contains("SameSite=Strict")
            && cookie.contains("Path=/")
    );
    for answer in [server.get("/"), server.get("/api/state"), session] {
        let said = format!(
            "{:?} {}",
            answer.headers,
            String::from_utf8_lossy(&answer.body)
        );
        assert!(!said.contains(&server.token));
        assert_eq!(answer.header("referrer-policy"), Some("no-referrer"));
    }
}

#[test]
fn every_answer_says_what_browsers_may_do_with_it() {
    let server = Server::start(options(&[]));
    let cookie = server.cookie();
    let refused = server.raw("GET", "/api/state", &["host: evil.example", &cookie], b"");
    for answer in [
        server.get("/"),
        server.get("/api/state"),
        server.get("/api/nothing"),
        server.get("/page/none.js"),
        refused,
    ] {
        let policy = answer.header("content-security-policy").unwrap();
        assert!(
            policy.contains("default-src 'self'") && policy.contains("frame-ancestors 'none'"),
            "{policy}"
        );
        assert!(!policy.contains("unsafe"));
        assert_eq!(answer.header("x-content-type-options"), Some("nosniff"));
        assert_eq!(answer.header("cache-control"), Some("no-store"));
        assert_eq!(
            answer.header("cross-origin-resource-policy"),
            Some("same-origin")
        );
        assert!(answer.header("access-control-allow-origin").is_none());
    }
    assert!(
        server
            .get("/")
            .header("content-type")
            .unwrap()
            .starts_with("text/html")
    );
}

/// Nothing listens beyond this computer without a token of the user's own.
#[test]
fn other_addresses_need_a_file_with_a_token() {
    let cancel = moiregauge_pipeline::Cancel::new();
    cancel.cancel();
    let start = |options: &moiregauge_serve::Options| {
        moiregauge_serve::serve(options, &cancel, &mut |_| {}).map_err(|e| e.to_string())
    };
    for address in ["0.0.0.0", "192.168.1.5", "::"] {
        let open = moiregauge_serve::Options {
            address: address.parse().unwrap(),
            ..options(&[])
        };
        assert!(
            start(&open).unwrap_err().contains("a file with a token"),
            "{address}"
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("token");
    std::fs::write(&file, "0123456789abcdef0123456789abcdef\n").unwrap();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o600)).unwrap();
    }
    let with_file = moiregauge_serve::Options {
        address: "0.0.0.0".parse().unwrap(),
        token_file: Some(file),
        ..options(&[])
    };
    assert_eq!(start(&with_file), Ok(()));
}
