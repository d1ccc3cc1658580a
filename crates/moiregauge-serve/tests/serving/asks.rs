//! Questions without a work: the answers of the pipeline, to the last byte where the program prints them.

use moiregauge::settings::Settings;
use moiregauge_pipeline::moire::{Given, MoireQuestion};
use moiregauge_pipeline::samples::{Samples, analyse_samples, samples_in};
use moiregauge_report::results::UserSpecified;
use serde_json::json;

use super::common::{Server, options, scans, scans_of};

#[test]
fn moires_and_plans_are_answered() {
    let server = Server::start(options(&[]));
    let given = json!({"layers": {"twist_deg": 1.1, "strain_percent": 0.2}});
    let body = json!({"given": given, "settings": {"layers": "graphene/hBN"}});
    let answer = server.post("/api/moire", &body);
    let given: Given = serde_json::from_value(given).unwrap();
    let usual = MoireQuestion::new(given);
    let named = serde_json::from_str(r#"{"layers": "graphene/hBN"}"#).unwrap();
    let question = MoireQuestion {
        settings: moiregauge_pipeline::settings_on(usual.settings.clone(), named).unwrap(),
        ..usual
    };
    let document = moiregauge_pipeline::moire(&question).unwrap().document;
    assert_eq!(answer.body, document.to_json().unwrap().into_bytes());
    let figure = server.post("/api/moire.svg", &body);
    assert_eq!(figure.header("content-type"), Some("image/svg+xml"));
    let wrong = json!({"given": {"layers": {"twist_deg": 1e99}}});
    assert_eq!(server.post("/api/moire", &wrong).status, 422);
    let wish = json!({"wishes": {"twist_deg": 0.05}, "conditions": {"sample": {"twist_deg": 1.2}}});
    let plans = server.post("/api/plan", &wish).good();
    assert_eq!(plans["plans"][0]["met"], true);
    assert_eq!(plans["conditions"]["sample"]["twist_deg"], 1.2);
    assert_eq!(
        server
            .post("/api/plan", &json!({"wishes": {"twist": 1}}))
            .status,
        400
    );
}

#[test]
fn what_is_known_is_told() {
    let server = Server::start(options(&[]));
    let caveats = server.get("/api/caveats").good();
    let count = moiregauge::caveat::explained().count();
    assert_eq!(caveats.as_array().unwrap().len(), count);
    assert!(caveats[0]["what_to_do"].is_string());
    let materials = server.get("/api/materials").good();
    let is_named = |name: &str| {
        materials
            .as_array()
            .unwrap()
            .iter()
            .any(|m| m["name"] == name)
    };
    assert!(is_named("graphene") && is_named("hBN"));
    let usual: Settings = serde_json::from_value(server.get("/api/defaults").good()).unwrap();
    assert_eq!(usual, Settings::default());
}

#[test]
fn tables_of_many_samples_are_shown() {
    let folder = tempfile::tempdir().unwrap();
    let all = folder.path().join("all");
    scans(&all.join("one"), 2);
    scans(&all.join("two"), 2);
    let out = folder.path().join("results");
    let found = samples_in(&all, &out).unwrap();
    let samples = Samples::new(&all, found, Settings::default(), UserSpecified::default()).unwrap();
    let job = moiregauge_pipeline::Job::quiet(Some(2)).unwrap();
    analyse_samples(&samples, &out, &job).unwrap();
    let server = Server::start(options(&[folder.path()]));
    let shown = server.get("/api/samples?root=0&under=results").good();
    assert_eq!(shown["columns"][0], "sample");
    assert_eq!(shown["rows"].as_array().unwrap().len(), 2);
    assert_eq!(shown["rows"][1]["sample"], "two");
    let picture = shown["pictures"][0].as_str().unwrap();
    let address = |name: &str| format!("/api/samples/picture?root=0&under=results&name={name}");
    assert_eq!(
        server.get(&address(picture)).header("content-type"),
        Some("image/png")
    );
    for name in [
        "parts/..%2f..%2fall",
        "parts/list-1-of-1.json",
        "..%2fsamples.csv",
        "parts/.png",
        "",
    ] {
        assert_eq!(server.get(&address(name)).status, 404, "{name}");
    }
    assert_eq!(server.get("/api/samples?root=0&under=all").status, 422);
    assert_eq!(server.get("/api/samples?root=0&under=..").status, 403);
}

/// Zero frequency in the middle, steps in headers; the fit leaves an image of the same size, and a cell.
#[test]
fn spectra_residuals_and_cells_are_images() {
    let folder = tempfile::tempdir().unwrap();
    scans(folder.path(), 1);
    let server = Server::start(options(&[folder.path()]));
    let file = server.files("").remove(0);
    let size = |answer: &super::common::Answer| {
        assert_eq!(answer.status, 200);
        let side = |name: &str| answer.header(name).unwrap().parse::<usize>().unwrap();
        let size = [side("x-width"), side("x-height")];
        assert_eq!(answer.body.len(), 4 * size[0] * size[1]);
        size
    };
    let spectrum = server.get(&format!("/api/spectrum?file={file}&channel=0"));
    let [width, height] = size(&spectrum);
    assert!(width % 2 == 1 && height % 2 == 1);
    for name in ["x-step-per-px", "x-step-per-nm"] {
        assert_eq!(spectrum.header(name).unwrap().split(' ').count(), 2);
    }
    let work = server
        .post("/api/works", &json!({"files": [file], "run": true}))
        .good();
    let path = format!("/api/works/{}", work["work"].as_str().unwrap());
    assert_eq!(server.wait(&path)["state"], "done");
    for line in ["trace", "retrace"] {
        let residual = server.get(&format!("{path}/residual?file={file}&line={line}"));
        assert_eq!(size(&residual), [128, 128]);
    }
    size(&server.get(&format!("{path}/cell?file={file}")));
    assert_eq!(server.get(&format!("{path}/cell?file=0")).status, 404);
}

/// What is asked of a map along a line is what the program writes into `profiles.csv`.
#[test]
fn profiles_of_maps_are_answered() {
    let folder = tempfile::tempdir().unwrap();
    scans_of(folder.path(), 1, |set| {
        set.raster.pixels = [192; 2];
        set.raster.nominal_size_nm = [160.0; 2];
    });
    let server = Server::start(options(&[folder.path()]));
    let questions =
        json!({"profiles": [{"name": "cut", "ends_nm": [[-30.0, -20.0], [30.0, 20.0]]}]});
    let wanted = json!({"files": server.files(""), "request": {"questions": questions}});
    let map = server.post("/api/maps", &wanted).good();
    let path = format!("/api/maps/{}", map["map"].as_str().unwrap());
    assert_eq!(server.wait(&path)["state"], "done");
    let answer = server.post(&format!("{path}/ask"), &questions).good();
    let line = &answer["profiles"][0];
    assert_eq!(
        (&line["name"], &line["ends_nm"]),
        (&json!("cut"), &questions["profiles"][0]["ends_nm"])
    );
    let points = line["points"].as_array().unwrap();
    let table = server.get(&format!("{path}/outputs/profiles.csv")).body;
    let table = String::from_utf8(table).unwrap();
    let mut rows = table.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let head = rows.next().unwrap();
    let rows: Vec<_> = rows.collect();
    assert_eq!(rows.len(), points.len());
    let mut good = 0;
    for (row, point) in rows.iter().zip(points) {
        let cell = |name: &str| row[head.iter().position(|h| h.ends_with(name)).unwrap()];
        assert_eq!(cell("mask"), point["mask"].as_str().unwrap());
        for (name, number) in [
            ("distance_nm", &point["distance_nm"]),
            ("twist_deg", &point["twist_deg"]["value"]),
            ("twist_sigma_deg", &point["twist_deg"]["sigma"]),
            ("wavelength_nm", &point["wavelength_nm"]["value"]),
        ] {
            let (told, written) = (number.as_f64(), cell(name).parse::<f64>().ok());
            assert_eq!(told.is_some(), written.is_some(), "{name}");
            if let Some((told, written)) = told.zip(written) {
                assert!(
                    (told - written).abs() <= 1e-6 * written.abs(),
                    "{name}: {told} {written}"
                );
            }
        }
        good += usize::from(point["mask"] == "good");
    }
    assert!(good > 3, "{line}");
}

/// The samples below a folder become the table of a campaign, which lies with what was dropped; the folder stays as it is.
#[test]
fn samples_below_a_folder_are_analysed() {
    let folder = tempfile::tempdir().unwrap();
    for sample in ["a", "b"] {
        let here = folder.path().join("all").join(sample);
        std::fs::create_dir_all(&here).unwrap();
        scans(&here, 1);
    }
    let server = Server::start(options(&[folder.path()]));
    let wanted = json!({"root": "0", "under": "all", "settings": {"seed": 7}});
    let campaign = server.post("/api/campaigns", &wanted).good();
    let path = format!("/api/campaigns/{}", campaign["campaign"].as_str().unwrap());
    let done = server.wait(&path);
    assert_eq!(
        (&done["state"], &done["failed"]),
        (&json!("done"), &json!(0))
    );
    let of = |done: &serde_json::Value| {
        format!(
            "root={}&under={}",
            done["root"].as_str().unwrap(),
            done["under"].as_str().unwrap()
        )
    };
    let table = server.get(&format!("/api/samples?{}", of(&done))).good();
    let names: Vec<_> = table["rows"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| row["sample"].clone())
        .collect();
    assert_eq!(names, ["a", "b"]);
    let zip = server.get(&format!("/api/samples/archive.zip?{}", of(&done)));
    assert_eq!(zip.status, 200);
    let text = String::from_utf8_lossy(&zip.body);
    assert!(
        text.contains("samples.csv") && text.contains("campaign.html") && text.contains("parts/")
    );
    assert_eq!(
        std::fs::read_dir(folder.path().join("all"))
            .unwrap()
            .count(),
        2
    );
    for (wrong, status) in [
        (json!({"root": "0", "under": "../x"}), 403),
        (json!({"root": "0", "under": "none"}), 404),
        (json!({"root": "dropped"}), 422),
    ] {
        assert_eq!(
            server.post("/api/campaigns", &wrong).status,
            status,
            "{wrong}"
        );
    }
}
