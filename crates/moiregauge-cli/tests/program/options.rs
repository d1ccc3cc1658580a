//! Options that do what they say, and cells of tables that do nothing.

use std::path::Path;

use moiregauge::frame::Image;
use moiregauge::simulate::FieldScene;
use serde_json::Value;

use crate::common::{analyze, json, number, program, results, run, simulate, succeed};
use crate::maps::{PITCH, quantity, written};
use crate::several::two_moires;

/// Two frames, and a third that is left out.
fn three(folder: &Path) -> std::path::PathBuf {
    simulate(folder, &["--pixels", "128", "--scans", "3"])
}

/// A set that gets no file is an error that names it; `./s/` is `s`.
#[test]
fn sets_that_fit_nothing_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let small = ["--pixels", "128", "--scans", "2"];
    simulate(folder.path(), &[&small[..], &["--name", "s"]].concat());
    simulate(
        folder.path(),
        &[&small[..], &["--name", "t", "--seed", "2"]].concat(),
    );
    let sets = |sets: [&str; 2]| {
        let mut command = program();
        command.current_dir(folder.path());
        command.args([
            "analyze",
            "s",
            "./t",
            "--out",
            "r",
            "--force",
            "--no-report",
        ]);
        run(command.args(["--drift-draws", "0", "--set", sets[0], "--set", sets[1]]))
    };
    let named = sets(["a=./s/", "b=t"]);
    assert_eq!(named.code, Some(0), "{}", named.stderr);
    let found = results(&folder.path().join("r"));
    let names: Vec<_> = found["sets"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| s["name"].as_str())
        .collect();
    assert_eq!(names.len(), 2, "{names:?}");
    assert!(
        names.contains(&Some("a")) && names.contains(&Some("b")),
        "{names:?}"
    );
    for (wrong, name) in [
        ("before=u", "before"),
        ("a=s/nothing.spm", "a"),
        ("b=.t", "b"),
    ] {
        let refused = sets(["c=s", wrong]);
        assert_eq!(refused.code, Some(1), "{wrong}");
        let said = &refused.stderr;
        assert!(
            said.contains("--set") && said.contains(&format!("{name:?}")),
            "{said}"
        );
    }
}

/// A scan that is left out has words in its column; the tables are written, and the images after them.
#[cfg(feature = "parquet")]
#[test]
fn excluded_scans_stop_neither_parquet_nor_export() {
    let folder = tempfile::tempdir().unwrap();
    let (scans, out) = (three(folder.path()), folder.path().join("r"));
    succeed(analyze(&scans, &out).args([
        "--exclude",
        "*2.spm",
        "--parquet",
        "--export",
        "corrected.gsf",
        "--drift-draws",
        "0",
    ]));
    let found = results(&out);
    let words = found["sets"][0]["scans"][2]["excluded"]
        .as_str()
        .expect("a reason");
    for name in ["vectors", "scans", "sets", "budget"] {
        let bytes = std::fs::read(out.join(format!("{name}.parquet"))).unwrap();
        assert!(
            bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"),
            "{name}"
        );
    }
    // The words are in the table of scans as they are: text is stored plainly.
    let bytes = std::fs::read(out.join("scans.parquet")).unwrap();
    assert!(
        bytes.windows(words.len()).any(|w| w == words.as_bytes()),
        "{words}"
    );
    assert!(std::fs::read_dir(out.join("corrected")).unwrap().count() >= 4);
}

/// One document of JSON: a list of those that are written.
#[test]
fn several_moires_are_one_document() {
    let folder = tempfile::tempdir().unwrap();
    let (scans, out) = (folder.path().join("scans"), folder.path().join("r"));
    two_moires(&scans);
    let said =
        succeed(analyze(&scans, &out).args(["--moires", "2", "--json", "--drift-draws", "0"]));
    let all: Value = serde_json::from_str(&said.stdout).expect("one JSON document");
    let all = all.as_array().expect("a list");
    assert_eq!(all.len(), 2);
    for (number, document) in all.iter().enumerate() {
        assert_eq!(
            *document,
            results(&out.join(format!("moire-{}", number + 1)))
        );
    }
}

/// 240 × 400 pixels, bottom line first: on top on the left a lattice of 16 pixels, elsewhere one of 20.
fn asymmetric() -> Image {
    let lattice = |period: f64, seed: u64| {
        let mut scene = FieldScene::hexagonal([400, 240], period, 0.3);
        scene.white = 0.5;
        scene.seed = seed;
        scene.image()
    };
    let (inner, outer) = (lattice(16.0, 1), lattice(20.0, 2));
    let (rows, columns) = (inner.rows, inner.columns);
    let values = (0..rows).flat_map(|row| {
        let (inner, outer) = (inner.row(row), outer.row(row));
        (0..columns).map(move |c| {
            if row >= rows / 2 && c < columns / 2 {
                inner[c]
            } else {
                outer[c]
            }
        })
    });
    Image::new(rows, columns, values.collect())
}

/// A block of a survey is the one that the screen shows: columns from the left, rows from the top.
#[test]
fn blocks_of_surveys_are_those_of_the_screen() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let image = asymmetric();
    let (rows, columns) = (image.rows, image.columns);
    let file = written(folder, &image);
    let [w, h] = [columns, rows].map(|n| n as f64 * PITCH);
    let map = |name: &str, options: &[&str]| {
        let mut command = program();
        command.args([
            "map",
            &file,
            "--size",
            &format!("{w}nm×{h}nm"),
            "--no-report",
        ]);
        command
            .args(["--quiet", "--window", "9", "--out"])
            .arg(folder.join(name));
        let done = run(command.args(options));
        assert_eq!(done.code, Some(0), "{name} {options:?}\n{}", done.stderr);
        json(&folder.join(name).join("map.json"))
    };
    let (half, above) = (columns / 2, rows / 2);
    for (name, left, top, period) in [
        ("left-top", 0, 0, 16.0),
        ("right-top", half, 0, 20.0),
        ("left-bottom", 0, above, 20.0),
    ] {
        let crop = format!("{left},{top},{half},{above}");
        let bands = map(&format!("{name}-bands"), &["--in-bands", "--crop", &crop]);
        let truth = 2.0 * (0.246 / (2.0 * period * PITCH)).asin().to_degrees();
        let found = number(quantity(&bands, "twist"), "/mean");
        // A tenth of what tells the two lattices apart.
        assert!(
            (found / truth - 1.0).abs() < 0.02,
            "{name}: {found} for {truth}"
        );
        // Where it lies: the block's middle from the middle of the frame, y up.
        let place = [
            left as f64 + 0.5 * half as f64 - 0.5 * columns as f64,
            0.5 * rows as f64 - top as f64 - 0.5 * above as f64,
        ];
        for axis in 0..2 {
            let end = |i: usize| number(&bands, &format!("/extent_nm/{axis}/{i}"));
            let middle = 0.5 * (end(0) + end(1));
            assert!(
                (middle - place[axis] * PITCH).abs() < 3.0,
                "{name}: {middle} for {place:?}"
            );
            assert!(
                end(1) - end(0) < 1.02 * [half, above][axis] as f64 * PITCH,
                "{name}: too wide"
            );
        }
    }
    // The way of small images has the same place.
    let crop = format!("0,0,{half},{above}");
    let whole = map("whole", &["--crop", &crop, "--strain-draws", "0"]);
    let bands = json(&folder.join("left-top-bands/map.json"));
    for pointer in [
        "/extent_nm/0/0",
        "/extent_nm/0/1",
        "/extent_nm/1/0",
        "/extent_nm/1/1",
    ] {
        assert!(
            (number(&whole, pointer) - number(&bands, pointer)).abs() < 5.0,
            "{pointer}"
        );
    }
    // What is refused is refused for what is true.
    for (options, words) in [
        (
            ["--crop", "0,200,50,60"],
            "rows 200 to 259 from the top of an image of 240",
        ),
        (["--sensors", &file], "nominal positions"),
    ] {
        let mut command = program();
        command.args([
            "map",
            &file,
            "--size",
            &format!("{w}nm×{h}nm"),
            "--in-bands",
            "--out",
        ]);
        let refused = run(command.arg(folder.join("refused")).args(options));
        assert_eq!(refused.code, Some(1));
        assert!(
            refused.stderr.contains(words) && refused.stderr.contains(options[0]),
            "{}",
            refused.stderr
        );
    }
}

/// Names that a spreadsheet would run stand behind an apostrophe in every table; results.json has them as they are.
#[test]
fn names_of_files_run_nowhere() {
    let folder = tempfile::tempdir().unwrap();
    let scans = simulate(folder.path(), &["--pixels", "128", "--scans", "1"]);
    let scan = std::fs::read_dir(&scans)
        .unwrap()
        .map(|e| e.unwrap().path());
    let scan = scan
        .filter(|p| p.extension().is_some_and(|e| e == "spm"))
        .min()
        .unwrap();
    let name = if cfg!(windows) {
        "=cmd.spm"
    } else {
        "=cmd|' C calc'!A0.spm"
    };
    std::fs::copy(scan, folder.path().join(name)).unwrap();
    let mut command = program();
    command.current_dir(folder.path());
    command.args([
        "analyze",
        name,
        "--out",
        "r",
        "--no-report",
        "--set",
        &format!("+a={name}"),
    ]);
    succeed(command.args(["--strain-draws", "0"]));
    let out = folder.path().join("r");
    let found = results(&out);
    assert_eq!(found["provenance"]["inputs"][0]["file"], name);
    let mut marked = 0;
    for table in ["vectors.csv", "scans.csv", "sets.csv", "budget.csv"] {
        let text = std::fs::read_to_string(out.join(table)).unwrap();
        for cell in text.split("\r\n").flat_map(|line| line.split(',')) {
            let cell = cell.trim_start_matches('"');
            let harmless =
                !cell.starts_with(['=', '+', '-', '@', '\t']) || cell.parse::<f64>().is_ok();
            assert!(harmless, "{table}: {cell}");
            marked += usize::from(cell.starts_with("'=cmd") || cell == "'+a");
        }
    }
    assert!(marked > 10, "{marked}");
    assert!(
        std::fs::read_to_string(out.join("columns.md"))
            .unwrap()
            .contains("apostrophe")
    );
}
