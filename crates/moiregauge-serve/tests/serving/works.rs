//! Works: asked, changed, taken back, kept.

use serde_json::json;

use super::common::{Server, options, scans};

#[test]
fn works_are_changed_undone_and_analysed() {
    let folder = tempfile::tempdir().unwrap();
    scans(folder.path(), 4);
    let server = Server::start(options(&[folder.path()]));
    let files = server.files("");
    let work = server.post("/api/works", &json!({"files": files})).good();
    assert_eq!(
        (&work["state"], &work["can_undo"]),
        (&json!("idle"), &json!(false))
    );
    let path = format!("/api/works/{}", work["work"].as_str().unwrap());
    assert_eq!(server.get(&format!("{path}/results.json")).status, 409);
    server.post(&format!("{path}/run"), &json!({})).good();
    assert_eq!(server.wait(&path)["state"], "done");
    let first = server.get(&format!("{path}/results.json"));
    // A scan is excluded: measured scans are kept, the result follows at once.
    let begun = std::time::Instant::now();
    let change = json!({"excluded": [files[1]], "settings": {"layers": "graphene"}, "run": true});
    let changed = server
        .asks("PATCH", &path, change.to_string().as_bytes())
        .good();
    assert_eq!(changed["excluded"], json!([files[1]]));
    let done = server.wait(&path);
    assert!(begun.elapsed().as_secs_f64() < 2.0, "{:?}", begun.elapsed());
    assert_eq!(
        (
            &done["state"],
            &done["can_undo"],
            &done["result"]["current"]
        ),
        (&json!("done"), &json!(true), &json!(true))
    );
    let second = server.get(&format!("{path}/results.json")).good();
    let excluded = second["settings"]["exclude"][0].as_str().unwrap();
    assert!(excluded.ends_with(done["names"][&files[1]].as_str().unwrap()));
    let command = server.get(&format!("{path}/command")).good();
    assert!(
        command["command"]
            .as_str()
            .unwrap()
            .contains("--config settings.toml"),
        "{command}"
    );
    let settings = server.get(&format!("{path}/settings.toml"));
    assert!(String::from_utf8_lossy(&settings.body).contains("exclude"));
    // Undone, the first result comes again, to the last byte.
    server.post(&format!("{path}/undo"), &json!({})).good();
    let undone = server.wait(&path);
    assert_eq!(
        (&undone["excluded"], &undone["can_redo"]),
        (&json!([]), &json!(true))
    );
    assert_eq!(server.get(&format!("{path}/results.json")).body, first.body);
    assert_eq!(server.post(&format!("{path}/undo"), &json!({})).status, 409);
    server.post(&format!("{path}/redo"), &json!({})).good();
    server.wait(&path);
    assert_eq!(server.get(&format!("{path}/results.json")).good(), second);
}

#[test]
fn nonsense_is_refused_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    scans(folder.path(), 1);
    let server = Server::start(options(&[folder.path()]));
    let files = server.files("");
    for (body, place) in [
        (json!({}), "files"),
        (
            json!({"files": files, "settings": {"metod": 1}}),
            "settings",
        ),
        (
            json!({"files": files, "settings": {"scanner": "/etc/passwd"}}),
            "settings",
        ),
        (
            json!({"files": files, "settings": {"settings": "/etc/passwd"}}),
            "settings",
        ),
        (
            json!({"files": files, "settings": {"moires": 99}}),
            "settings",
        ),
        (
            json!({"files": files, "known": {"size_nm": [-1, 1]}}),
            "size_nm",
        ),
        (
            json!({"files": files, "known": {"sensors": "/etc/passwd"}}),
            "known.sensors",
        ),
    ] {
        let answer = server.post("/api/works", &body);
        assert_eq!(
            (answer.status, answer.json()["where"].as_str()),
            (400, Some(place)),
            "{body}"
        );
    }
    assert_eq!(
        server.post("/api/works", &json!({"files": ["no"]})).status,
        404
    );
    assert_eq!(server.get("/api/works/w9").status, 404);
    assert_eq!(server.get("/api/state").good()["works"], json!([]));
}

#[test]
fn results_are_drawn_on_scans_and_taken_away() {
    let folder = tempfile::tempdir().unwrap();
    scans(folder.path(), 2);
    let server = Server::start(options(&[folder.path()]));
    let files = server.files("");
    let work = server
        .post("/api/works", &json!({"files": files, "run": true}))
        .good();
    let path = format!("/api/works/{}", work["work"].as_str().unwrap());
    assert_eq!(server.wait(&path)["state"], "done");
    let overlay = server
        .get(&format!("{path}/overlay?file={}", files[0]))
        .good();
    let line = &overlay["lines"][0];
    assert!(
        line["lattice_px"][0][0].is_number() && line["spots_per_nm"][1][1].is_number(),
        "{overlay}"
    );
    let outputs = server.get(&format!("{path}/outputs")).good();
    let names: Vec<&str> = outputs
        .as_array()
        .unwrap()
        .iter()
        .map(|o| o["name"].as_str().unwrap())
        .collect();
    for name in ["results.json", "report.html", "scans.csv", "command.txt"] {
        assert!(names.contains(&name), "{names:?}");
    }
    let results = server.get(&format!("{path}/results.json"));
    assert_eq!(
        server.get(&format!("{path}/outputs/results.json")).body,
        results.body
    );
    assert_eq!(
        server
            .get(&format!("{path}/outputs/..%2f..%2fetc%2fpasswd"))
            .status,
        404
    );
    let zip = server.get(&format!("{path}/archive.zip"));
    assert_eq!((zip.status, &zip.body[..2]), (200, &b"PK"[..]));
}

#[test]
fn work_is_cancelled() {
    let folder = tempfile::tempdir().unwrap();
    scans(folder.path(), 8);
    let server = Server::start(options(&[folder.path()]));
    let work = server
        .post(
            "/api/works",
            &json!({"files": server.files(""), "run": true}),
        )
        .good();
    let path = format!("/api/works/{}", work["work"].as_str().unwrap());
    server.post(&format!("{path}/cancel"), &json!({})).good();
    assert_eq!(server.wait(&path)["state"], "cancelled");
    server.post(&format!("{path}/run"), &json!({})).good();
    assert_eq!(server.wait(&path)["state"], "done");
}

/// A result that is shown as saved is there after the next start, whatever ended the server.
#[test]
fn works_are_kept_where_the_user_wants_it() {
    let folder = tempfile::tempdir().unwrap();
    let keep = tempfile::tempdir().unwrap();
    scans(folder.path(), 2);
    let keeping = || moiregauge_serve::Options {
        keep: Some(keep.path().to_owned()),
        ..options(&[folder.path()])
    };
    let (path, results) = {
        let server = Server::start(keeping());
        assert_eq!(server.get("/api/state").good()["saves"], true);
        let work = json!({"files": server.files(""), "settings": {"seed": 3}, "run": true});
        let work = server.post("/api/works", &work).good();
        let path = format!("/api/works/{}", work["work"].as_str().unwrap());
        let done = server.wait(&path);
        assert_eq!(done["result"]["saved"], true);
        // What a server that is killed leaves behind beside it does no harm.
        let here = keep
            .path()
            .join("works")
            .join(work["work"].as_str().unwrap());
        std::fs::write(here.join(".part-x"), "half").unwrap();
        (
            path.clone(),
            server.get(&format!("{path}/results.json")).body,
        )
    };
    let server = Server::start(keeping());
    // Two servers would write over each other's works.
    let second =
        moiregauge_serve::serve(&keeping(), &moiregauge_pipeline::Cancel::new(), &mut |_| {});
    assert!(second.unwrap_err().to_string().contains("another server"));
    let again = server.get(&path).good();
    assert_eq!(
        (&again["settings"]["seed"], &again["result"]["current"]),
        (&json!(3), &json!(true))
    );
    assert_eq!(server.get(&format!("{path}/results.json")).body, results);
    server.post(&format!("{path}/run"), &json!({})).good();
    assert_eq!(server.wait(&path)["state"], "done");
    assert_eq!(server.get(&format!("{path}/results.json")).body, results);
    // Without a folder nothing is said to be saved.
    let plain = Server::start(options(&[folder.path()]));
    assert_eq!(plain.get("/api/state").good()["saves"], false);
}
