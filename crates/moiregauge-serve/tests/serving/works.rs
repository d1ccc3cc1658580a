//! Works: asked, changed, taken back, kept.

use serde_json::json;

use super::common::{Server, options, scans, scans_of};

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

/// A server that keeps works.
fn keeping(folder: &std::path::Path, keep: &std::path::Path) -> moiregauge_serve::Options {
    moiregauge_serve::Options {
        keep: Some(keep.to_owned()),
        ..options(&[folder])
    }
}

/// The path of a new work of all files that runs with a seed of 3.
fn seeded(server: &Server) -> String {
    let work = json!({"files": server.files(""), "settings": {"seed": 3}, "run": true});
    let work = server.post("/api/works", &work).good();
    format!("/api/works/{}", work["work"].as_str().unwrap())
}

/// A result that is shown as saved is there after the next start, whatever ended the server.
#[test]
fn works_are_kept_where_the_user_wants_it() {
    let folder = tempfile::tempdir().unwrap();
    let keep = tempfile::tempdir().unwrap();
    scans(folder.path(), 2);
    let keeping = || keeping(folder.path(), keep.path());
    let (path, results) = {
        let server = Server::start(keeping());
        assert_eq!(server.get("/api/state").good()["saves"], true);
        let path = seeded(&server);
        let done = server.wait(&path);
        assert_eq!(done["result"]["saved"], true);
        // What a server that is killed leaves behind beside it does no harm.
        let here = keep
            .path()
            .join("works")
            .join(path.rsplit('/').next().unwrap());
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
    assert!(
        second
            .unwrap_err()
            .to_string()
            .contains("another running server")
    );
    let again = server.get(&path).good();
    assert_eq!(
        (&again["settings"]["seed"], &again["result"]["current"]),
        (&json!(3), &json!(true))
    );
    assert_eq!(server.get(&format!("{path}/results.json")).body, results);
    // The lattice is drawn on the scans, the fit is seen and words are said without a run: of what was measured.
    let file = again["files"][0].as_str().unwrap();
    let overlay = server.get(&format!("{path}/overlay?file={file}")).good();
    assert!(overlay["lines"][0]["lattice_px"][0][0].is_number());
    assert_eq!(
        server
            .get(&format!("{path}/residual?file={file}&line=trace"))
            .status,
        200
    );
    assert_eq!(server.get(&format!("{path}/summary")).status, 200);
    server.post(&format!("{path}/run"), &json!({})).good();
    assert_eq!(server.wait(&path)["state"], "done");
    assert_eq!(server.get(&format!("{path}/results.json")).body, results);
    // Without a folder nothing is said to be saved.
    let plain = Server::start(options(&[folder.path()]));
    assert_eq!(plain.get("/api/state").good()["saves"], false);
}

/// As on a full disk: it is said, the result is shown all the same, and what was saved before counts until there is room.
#[test]
fn what_cannot_be_saved_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let keep = tempfile::tempdir().unwrap();
    scans(folder.path(), 2);
    let keeping = || keeping(folder.path(), keep.path());
    let (path, first, second) = {
        let server = Server::start(keeping());
        let path = seeded(&server);
        assert_eq!(server.wait(&path)["result"]["saved"], true);
        let first = server.get(&format!("{path}/results.json")).body;
        let here = keep
            .path()
            .join("works")
            .join(path.rsplit('/').next().unwrap());
        let in_the_way = here.join("measured-2.json");
        std::fs::create_dir(&in_the_way).unwrap();
        let change = json!({"settings": {"seed": 4}, "run": true}).to_string();
        server.asks("PATCH", &path, change.as_bytes()).good();
        let done = server.wait(&path);
        assert_eq!(
            (&done["state"], &done["result"]["saved"]),
            (&json!("done"), &json!(false))
        );
        let words = done["result"]["unsaved"].as_str().unwrap();
        assert!(words.starts_with("not saved: "), "{words}");
        let second = server.get(&format!("{path}/results.json")).body;
        assert_ne!(first, second);
        (path, first, second)
    };
    // What was saved before is there, with what is asked now.
    let server = Server::start(keeping());
    let again = server.get(&path).good();
    assert_eq!(
        (
            &again["settings"]["seed"],
            &again["result"]["saved"],
            &again["result"]["current"]
        ),
        (&json!(4), &json!(true), &json!(false))
    );
    assert_eq!(server.get(&format!("{path}/results.json")).body, first);
    // With room again the next result is saved.
    let id = path.rsplit('/').next().unwrap();
    std::fs::remove_dir(keep.path().join("works").join(id).join("measured-2.json")).unwrap();
    server.post(&format!("{path}/run"), &json!({})).good();
    assert_eq!(server.wait(&path)["result"]["saved"], true);
    assert_eq!(server.get(&format!("{path}/results.json")).body, second);
}

/// A work of one scan of such a sample, analysed.
fn of_sample(
    change: impl FnOnce(&mut moiregauge::simulate::Simulation),
) -> (tempfile::TempDir, Server, String) {
    let folder = tempfile::tempdir().unwrap();
    scans_of(folder.path(), 1, change);
    let server = Server::start(options(&[folder.path()]));
    let asked = json!({"files": server.files(""), "run": true});
    let work = server.post("/api/works", &asked).good();
    let path = format!("/api/works/{}", work["work"].as_str().unwrap());
    assert_eq!(server.wait(&path)["state"], "done");
    (folder, server, path)
}

/// Asks a work with these settings.
fn with_settings(server: &Server, path: &str, settings: &serde_json::Value) {
    let change = json!({"settings": settings, "run": true}).to_string();
    server.asks("PATCH", path, change.as_bytes()).good();
    assert_eq!(server.wait(path)["state"], "done");
}

/// The server tells of the grains beside the one that was measured.
#[test]
fn grains_are_told() {
    let (_folder, server, path) = of_sample(|set| {
        set.raster.pixels = [256; 2];
        set.raster.nominal_size_nm = [160.0; 2];
        let grains = json!({"class": "grains", "share": 0.6, "turn": 8.0});
        set.features = vec![serde_json::from_value(grains).unwrap()];
    });
    let file = server.files("").remove(0);
    let overlay = || server.get(&format!("{path}/overlay?file={file}")).good();
    let before = overlay();
    let grains = before["grains"].as_array().unwrap();
    assert_eq!(grains.len(), 1, "{before}");
    let share = grains[0]["share"].as_f64().unwrap();
    assert!((0.1..0.5).contains(&share), "{before}");
    let angle = |lattice: &serde_json::Value| {
        let [x, y] = [0, 1].map(|i| lattice[0][i].as_f64().unwrap());
        y.atan2(x).to_degrees()
    };
    let turned = |a: f64, b: f64| ((a - b + 30.0).rem_euclid(60.0) - 30.0).abs();
    let (here, there) = (
        angle(&before["lines"][0]["lattice_nm"]),
        angle(&grains[0]["lattice_nm"]),
    );
    assert!((turned(here, there) - 8.0).abs() < 1.0, "{before}");
    // The other one alone: it is the result, it is drawn, and it stands in what repeats it.
    with_settings(&server, &path, &json!({"grain": 2}));
    let results = server.get(&format!("{path}/results.json")).good();
    let names: Vec<&str> = (results["sets"].as_array().unwrap().iter())
        .map(|set| set["name"].as_str().unwrap())
        .collect();
    assert!(
        names.len() == 1 && names[0].ends_with("grain 2"),
        "{names:?}"
    );
    assert_eq!(results["settings"]["grain"], 2);
    let drawn = angle(&overlay()["lines"][0]["lattice_nm"]);
    assert!((turned(here, drawn) - 8.0).abs() < 1.0);
    let command = server.get(&format!("{path}/command")).good();
    assert!(
        command["settings"].as_str().unwrap().contains("grain = 2"),
        "{command}"
    );
    // One that is not there is named.
    let change = json!({"settings": {"grain": 3}, "run": true}).to_string();
    server.asks("PATCH", &path, change.as_bytes()).good();
    let failed = server.wait(&path);
    assert_eq!(failed["state"], "failed");
    assert!(
        failed["error"].as_str().unwrap().contains("grain 3"),
        "{failed}"
    );
}

/// Another name of the lattice is chosen by its description from the server; it stands in the results, and in the settings that repeat them.
#[test]
fn readings_can_be_chosen() {
    let (_folder, server, path) = of_sample(|set| {
        set.raster.pixels = [192; 2];
        set.raster.nominal_size_nm = [200.0; 2];
        set.sample.twist_deg = 0.5;
        set.sample.strain_percent = 0.9;
    });
    let names = server.get(&format!("{path}/names")).good();
    let names = names.as_array().unwrap();
    assert!(names.len() > 1 && names[0]["standing"] == "reported");
    with_settings(
        &server,
        &path,
        &json!({"moire_waves": names[1]["moire_waves"]}),
    );
    let results = server.get(&format!("{path}/results.json")).good();
    let set = &results["sets"][0];
    let mean = if set["mean"].is_null() {
        &set["uncorrected"]
    } else {
        &set["mean"]
    };
    let chosen = &mean["readings"]["names"];
    assert_eq!(chosen["chosen_by"], "user");
    let twist = |name: &serde_json::Value| name["twist_deg"].as_f64().unwrap();
    assert!((twist(&chosen["names"][0]) - twist(&names[1])).abs() < 1e-3);
    let settings = server.get(&format!("{path}/settings.toml")).body;
    assert!(String::from_utf8_lossy(&settings).contains("moire_waves"));
}
