//! What a browser may open.

use std::path::Path;

use super::common::{Server, options, scans};

/// Percent-encoded, as browsers do.
fn encoded(text: &str) -> String {
    let all: Vec<String> = text.bytes().map(|b| format!("%{b:02X}")).collect();
    all.concat()
}

#[test]
fn nothing_beyond_the_folders_is_opened() {
    let all = tempfile::tempdir().unwrap();
    let inside = all.path().join("inside");
    scans(&inside.join("sub"), 1);
    scans(&all.path().join("secret"), 1);
    let server = Server::start(options(&[&inside]));
    assert_eq!(server.files("sub").len(), 1);
    let secret = all.path().join("secret");
    let status = |under: &str| {
        server
            .get(&format!("/api/folder?root=0&under={under}"))
            .status
    };
    let plain = [
        "..",
        "../secret",
        "sub/../../secret",
        "sub/..",
        "./sub",
        "/",
        "//",
        "sub/",
        "/etc",
        secret.to_str().unwrap(),
        "\\\\?\\C:\\",
        "\\\\host\\share",
        "C:\\",
        "C:/",
        "C:",
        "CON",
        "con",
        "NUL.txt",
        "COM1",
        "sub/AUX",
        "sub:stream",
        "sub::$DATA",
        "sub\0",
        "\0",
        "sub\n",
        "sub.",
        "sub ",
        "~",
        "%2e%2e",
        "..%2fsecret",
        "..\\secret",
        "*",
    ];
    for path in plain {
        let once = status(&encoded(path));
        assert!([403, 404].contains(&once), "{path:?}: {once}");
        let twice = status(&encoded(&encoded(path)));
        assert!([403, 404].contains(&twice), "{path:?} twice: {twice}");
    }
    for raw in [
        "%2e%2e",
        "%2e%2e%2fsecret",
        "..%2fsecret",
        "sub%2f%2e%2e%2f%2e%2e%2fsecret",
        "%252e%252e",
        "%c0%ae%c0%ae",
        "sub%00",
    ] {
        let found = status(raw);
        assert!([400, 403, 404].contains(&found), "{raw}: {found}");
    }
    for root in ["1", "-1", "", "dropped/..", "..", "0/.."] {
        assert_eq!(
            server
                .get(&format!("/api/folder?root={}", encoded(root)))
                .status,
            404,
            "{root}"
        );
    }
    // Files have ids; names of files are not ids.
    for id in [
        "0",
        "..",
        "/etc/passwd",
        &"0".repeat(32),
        secret.to_str().unwrap(),
    ] {
        let answer = server.get(&format!("/api/inspect?file={}", encoded(id)));
        assert_eq!(answer.status, 404, "{id}");
    }
}

#[test]
fn pages_are_only_files_of_the_page() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("secret.txt"), "secret").unwrap();
    let page = folder.path().join("page");
    std::fs::create_dir(&page).unwrap();
    std::fs::write(page.join("index.html"), "<!doctype html>mine").unwrap();
    std::fs::write(page.join("key.pem"), "secret").unwrap();
    let own = moiregauge_serve::Options {
        page: Some(page),
        ..options(&[])
    };
    for server in [Server::start(options(&[])), Server::start(own)] {
        for path in [
            "/page/../secret.txt",
            "/page/%2e%2e/secret.txt",
            "/page/..%2fsecret.txt",
            "/page//etc/hostname.txt",
            "/page/%2fetc%2fhostname.txt",
            "/page/key.pem",
            "/page/",
            "/page/none.js",
            "/secret.txt",
            "/../secret.txt",
        ] {
            let answer = server.get(path);
            assert!(
                [400, 403, 404].contains(&answer.status),
                "{path}: {}",
                answer.status
            );
            assert!(!String::from_utf8_lossy(&answer.body).contains("secret\n"));
        }
        assert_eq!(server.get("/page/index.html").body, server.get("/").body);
    }
}

#[cfg(unix)]
#[test]
fn links_do_not_lead_out() {
    let all = tempfile::tempdir().unwrap();
    let [inside, secret] = ["inside", "secret"].map(|name| all.path().join(name));
    scans(&inside, 1);
    scans(&secret, 1);
    let scan = |folder: &Path| {
        let found = moiregauge_pipeline::find(&[folder.to_owned()]);
        found.frames().0.remove(0)
    };
    let own = scan(&inside);
    let link = |to: &Path, name: &str| std::os::unix::fs::symlink(to, inside.join(name)).unwrap();
    link(&scan(&secret), "linked.spm");
    link(&secret, "folder");
    link(&own, "own.spm");
    let server = Server::start(options(&[&inside]));
    let shown = server.get("/api/folder?root=0").good();
    let names: Vec<&str> = shown["files"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f["name"].as_str().unwrap())
        .collect();
    assert!(
        !names.contains(&"linked.spm") && names.contains(&"own.spm"),
        "{names:?}"
    );
    assert_eq!(server.get("/api/folder?root=0&under=folder").status, 403);
    // A file that was shown and has become a link since.
    let place = names.iter().position(|name| *name != "own.spm").unwrap();
    let id = shown["files"][place]["file"].as_str().unwrap();
    assert_eq!(server.get(&format!("/api/inspect?file={id}")).status, 200);
    std::fs::remove_file(&own).unwrap();
    std::os::unix::fs::symlink(scan(&secret), &own).unwrap();
    for path in [
        format!("/api/inspect?file={id}"),
        format!("/api/image?file={id}&channel=0"),
    ] {
        assert_eq!(server.get(&path).status, 403, "{path}");
    }
    let work = serde_json::json!({"files": [id], "run": true});
    assert_eq!(server.post("/api/works", &work).status, 403);
}

/// Names are data: they come as JSON that no browser takes for a page.
#[cfg(unix)]
#[test]
fn script_in_names_stays_text() {
    let folder = tempfile::tempdir().unwrap();
    scans(folder.path(), 1);
    let found = moiregauge_pipeline::find(&[folder.path().to_owned()]);
    let scan = found.frames().0.remove(0);
    let name = "<img src=x onerror=alert(1)>\"'.spm";
    std::fs::rename(scan, folder.path().join(name)).unwrap();
    let server = Server::start(options(&[folder.path()]));
    let answer = server.get("/api/folder?root=0");
    assert_eq!(answer.header("content-type"), Some("application/json"));
    assert_eq!(answer.header("x-content-type-options"), Some("nosniff"));
    let shown = answer.good();
    assert_eq!(shown["files"][0]["name"], name);
    let id = shown["files"][0]["file"].as_str().unwrap();
    let info = server.get(&format!("/api/inspect?file={id}"));
    assert_eq!(info.header("content-type"), Some("application/json"));
    let work = server
        .post(
            "/api/works",
            &serde_json::json!({"files": [id], "run": true}),
        )
        .good();
    let path = format!("/api/works/{}", work["work"].as_str().unwrap());
    let done = server.wait(&path);
    assert_eq!(done["state"], "done", "{done}");
    // The page of results shows it as text, and may run nothing.
    let page = server.get(&format!("{path}/outputs/report.html"));
    let text = String::from_utf8_lossy(&page.body);
    assert!(!text.contains("<img src=x"), "the name is a tag");
    let policy = page.header("content-security-policy").unwrap();
    assert!(
        policy.contains("sandbox")
            && policy.contains("default-src 'none'")
            && !policy.contains("script-src"),
        "{policy}"
    );
}
