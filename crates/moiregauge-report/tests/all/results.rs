//! The document and the tables: schema, paths, units, nothing that is not a number.

use moiregauge::campaign::Analysis;
use moiregauge_report::{Choice, Results, map_schema, schema, write_report};
use serde_json::Value;

use crate::common;
use crate::schema::problems;

const NUMBERS_ONLY: Choice = Choice {
    figures: false,
    png: false,
    html: false,
    colormap: moiregauge_report::ColorMap::Viridis,
};

fn document(analysis: &Analysis) -> Value {
    let results = Results::new(analysis, &common::provenance());
    let bytes = results.to_json().expect("JSON");
    serde_json::from_slice(&bytes).expect("what was written can be read")
}

fn file(analysis: &Analysis, name: &str) -> String {
    let files = write_report(analysis, &common::provenance(), &NUMBERS_ONLY).expect("a report");
    let found = files
        .into_iter()
        .find(|(n, _)| n == name)
        .expect("the file is there");
    String::from_utf8(found.1).expect("UTF-8")
}

#[test]
fn the_published_schemas_are_up_to_date() {
    for (name, now) in [("results", schema()), ("map", map_schema())] {
        let path = format!("{}/schema/{name}-1.schema.json", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let published: Value = serde_json::from_str(&text).unwrap_or_default();
        assert_eq!(
            published, now,
            "renew it: cargo run -p moiregauge-pipeline --example schema {name} > \
             crates/moiregauge-report/schema/{name}-1.schema.json"
        );
    }
}

#[test]
fn documents_follow_the_schema() {
    let mut hopeless = common::analysis();
    common::spoil(&mut hopeless);
    let mut empty = common::analysis();
    empty.sets.clear();
    empty.combined = None;
    for analysis in [
        Box::new(common::analysis()),
        Box::new(hopeless),
        Box::new(empty),
    ] {
        let document = document(&analysis);
        let errors = problems(&schema(), &document);
        assert!(errors.is_empty(), "{errors:?}");
    }
}

/// Each rule of the schemas refuses what breaks it.
#[test]
fn documents_that_break_a_schema_are_refused() {
    let good = document(&common::analysis());
    let broken = |pointer: &str, value: Value| {
        let mut document = good.clone();
        *document.pointer_mut(pointer).expect(pointer) = value;
        problems(&schema(), &document)
    };
    let stated = serde_json::json!({"schema": "moiregauge/results/1"});
    assert!(problems(&schema(), &stated).len() > 1);
    for (pointer, value, part) in [
        ("/schema", "another".into(), "/schema"),
        ("/sets", 1.into(), "/sets: 1 is not of type"),
        ("/sets/0/mean", serde_json::json!({}), "/sets/0/mean"),
        ("/provenance/seed", (-1).into(), "is outside minimum"),
        ("/caveats/0/code", 7.into(), "/caveats/0/code"),
    ] {
        let found = broken(pointer, value);
        assert!(
            found.iter().any(|p| p.contains(part)),
            "{pointer}: {found:?}"
        );
    }
    let rules = serde_json::json!({
        "type": "object", "additionalProperties": false,
        "properties": {
            "id": {"pattern": "^([0-9a-f]{16})*$"},
            "pair": {"prefixItems": [{"type": "integer"}, {"enum": ["a", "b"]}], "minItems": 2, "maxItems": 2},
            "one": {"oneOf": [{"type": "number", "maximum": 1}, {"type": "integer"}]},
            "any": {"anyOf": [{"const": 1}, {"$ref": "#/$defs/text"}]},
        },
        "$defs": {"text": {"type": ["string", "null"]}},
    });
    let right =
        serde_json::json!({"id": "0123456789abcdef", "pair": [1, "a"], "one": 2, "any": null});
    assert_eq!(problems(&rules, &right), Vec::<String>::new());
    for wrong in [
        serde_json::json!({"id": "0123456789abcdeF"}),
        serde_json::json!({"pair": [1]}),
        serde_json::json!({"pair": [1, "a", 2]}),
        serde_json::json!({"pair": [1.5, "a"]}),
        serde_json::json!({"pair": [1, "c"]}),
        serde_json::json!({"one": 1}),
        serde_json::json!({"one": 1.5}),
        serde_json::json!({"any": 2}),
        serde_json::json!({"another": 2}),
    ] {
        assert_eq!(problems(&rules, &wrong).len(), 1, "{wrong}");
    }
}

/// The paths that other programs rely on.
#[test]
fn promised_paths_are_there() {
    let document = document(&common::analysis());
    let numbers = [
        "/sets/0/line_rate_hz",
        "/sets/0/drift/x_nm_per_min/value",
        "/sets/0/drift/y_nm_per_min/sigma",
        "/sets/0/drift/correlation",
        "/sets/0/mean/twist_deg/value",
        "/sets/0/mean/heterostrain_percent/sigma",
        "/sets/0/mean/strain_axis_lab_deg/value",
        "/sets/0/mean/strain_vector_percent/1",
        "/sets/0/mean/strain_vector_covariance/1/1",
        "/sets/0/scans/9/window/centre_nm/1",
        "/sets/0/scans/9/window/extent_nm/0",
        "/sets/0/scans/9/tip_velocity_nm_per_s/fast/value",
        "/sets/0/scans/9/tip_velocity_nm_per_s/slow/value",
        "/sets/0/scans/9/vectors/2/polar_angle_deg",
        "/sets/0/scans/9/vectors/2/nominal/x_nm",
        "/sets/0/scans/9/vectors/2/sensor/y_nm",
        "/sets/0/scans/9/vectors/2/drift_corrected/wavelength_nm/value",
        "/sets/0/scans/9/vectors/2/drift_corrected/naive_twist_deg/sigma",
        "/sets/0/scans/9/twist_strain/sensor/twist_deg/value",
        "/sets/0/scans/9/twist_strain/drift_corrected/heterostrain_percent/value",
        "/sets/0/scans/9/twist_strain/drift_corrected/lattice_angle_deg/value",
        "/sets/0/scans/9/twist_strain/drift_corrected/strain_axis_lab_deg/value",
        "/sets/0/scans/9/twist_strain/drift_corrected/strain_axis_lattice_deg/value",
        "/sets/0/mean/twist_deg/sigma_total",
        "/sets/0/mean/heterostrain_percent/sigma_total",
        "/sets/0/mean/strain_axis_lab_deg/sigma_total",
        "/sets/0/mean/strain_axis_lattice_deg/sigma_total",
        "/sets/0/mean/strain_vector_sigma_total_percent/1",
        "/sets/0/mean/vectors/2/wavelength_nm/sigma_total",
        "/sets/0/drift/x_nm_per_min/sigma_total",
        "/combined/twist_deg/sigma_total",
        "/combined/strain_vector_sigma_total_percent/0",
        "/combined/twist_deg/value",
        "/combined/heterostrain_percent/sigma",
        "/combined/vectors/2/x_nm",
        "/combined/budget/twist_deg/total",
        "/sets/0/mean/strain_interval_95_percent/0",
        "/sets/0/mean/budget/twist_deg/calibration_gain",
        "/sets/0/mean/budget/strain_e2_percent/image",
        "/sets/0/mean/budget/wavelengths_nm/2/sensor",
        "/sets/0/mean/budget/strain_interval_95_percent/1",
        "/sets/2/uncorrected/budget/twist_deg/lattice_constant",
    ];
    for path in numbers {
        assert!(
            document.pointer(path).is_some_and(Value::is_number),
            "{path}"
        );
    }
    let texts = [
        ("/schema", "moiregauge/results/1"),
        ("/sets/0/name", "slow y, 8 Hz"),
        ("/sets/0/slow_axis", "y"),
        ("/sets/1/slow_axis", "x"),
        ("/sets/0/scans/0/frame_direction", "up"),
        ("/sets/0/scans/1/frame_direction", "down"),
        ("/caveats/0/code", "few-periods"),
        ("/caveats/0/where", "slow y, 8 Hz"),
        ("/failed/0/file", "Messung 3 ü/tbg µ-scan_1.011"),
    ];
    for (path, text) in texts {
        assert_eq!(
            document.pointer(path).and_then(Value::as_str),
            Some(text),
            "{path}"
        );
    }
    for path in [
        "/sets/2/drift",
        "/sets/2/mean",
        "/sets/2/uncorrected/budget/twist_deg/drift",
        "/sets/2/uncorrected/budget/twist_deg/total",
        "/sets/2/uncorrected/budget/wavelengths_nm/0/drift",
        "/sets/2/uncorrected/budget/wavelengths_nm/0/total",
        "/sets/2/scans/0/vectors/0/nominal",
    ] {
        assert!(document.pointer(path).is_some_and(Value::is_null), "{path}");
    }
}

/// The made-up sample has round numbers in the units of the surface.
#[test]
fn units_are_those_of_the_surface() {
    let document = document(&common::analysis());
    let close = |path: &str, truth: f64, tolerance: f64| {
        let value = document
            .pointer(path)
            .and_then(Value::as_f64)
            .expect("a number");
        assert!(
            (value - truth).abs() < tolerance,
            "{path}: {value}, not {truth}"
        );
    };
    // Tolerances: five σ of the made-up measurement, as the document states it.
    close("/combined/twist_deg/value", common::TWIST_DEG, 0.0011);
    close(
        "/combined/heterostrain_percent/value",
        common::STRAIN_PERCENT,
        0.0032,
    );
    close(
        "/combined/strain_axis_lab_deg/value",
        common::AXIS_LAB_DEG,
        1.9,
    );
    let [x, y] = common::DRIFT_NM_PER_MIN;
    close("/sets/0/drift/x_nm_per_min/value", x, 0.07);
    close("/sets/0/drift/y_nm_per_min/value", y, 0.07);
    // The side nearer to x comes first, whichever axis is the slow one.
    close("/sets/0/scans/0/window/extent_nm/0", 54.2, 1e-9);
    close("/sets/1/scans/0/window/extent_nm/1", 54.2, 1e-9);
}

/// The paths of the strain hang together: E₁, E₂ have the length and the axis that are stated.
#[test]
fn strain_vector_and_axis_agree() {
    let document = document(&common::analysis());
    let at = |path: &str| {
        document
            .pointer(path)
            .and_then(Value::as_f64)
            .expect("a number")
    };
    let (e1, e2) = (
        at("/sets/0/mean/strain_vector_percent/0"),
        at("/sets/0/mean/strain_vector_percent/1"),
    );
    let axis = (e2.atan2(e1) / 2.0).to_degrees();
    assert!((axis - at("/sets/0/mean/strain_axis_lab_deg/value")).abs() < 1e-9);
    let p = at("/sets/0/mean/strain_p_value");
    assert!(
        (0.0..0.01).contains(&p),
        "an axis is stated, so p is below 0.01: {p}"
    );
}

/// The budget hangs together: image, drift and sensor make up σ, all rows the total; the calibration has
/// the size that physics gives it (1 % of gain is 1 % of the twist and of every wavelength).
#[test]
fn the_budget_adds_up() {
    let document = document(&common::analysis());
    let mean = &document["sets"][0]["mean"];
    let budget = &mean["budget"];
    let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-9, "{a}, {b}");
    let square_sum = |column: &Value, rows: &[&str]| {
        let squares = rows.iter().map(|row| {
            let sigma = column[row].as_f64().expect("a number");
            sigma * sigma
        });
        squares.sum::<f64>().sqrt()
    };
    let sigma = |path: &str| {
        let found = mean.pointer(path).and_then(Value::as_f64);
        found.expect("a number")
    };
    let columns = [
        ("twist_deg", sigma("/twist_deg/sigma")),
        ("heterostrain_percent", sigma("/heterostrain_percent/sigma")),
        (
            "strain_e1_percent",
            sigma("/strain_vector_covariance/0/0").sqrt(),
        ),
        ("strain_axis_lab_deg", sigma("/strain_axis_lab_deg/sigma")),
        ("lattice_angle_deg", sigma("/lattice_angle_deg/sigma")),
    ];
    for (name, sigma) in columns {
        let column = &budget[name];
        close(square_sum(column, &["image", "drift", "sensor"]), sigma);
        let all: Vec<&str> = column
            .as_object()
            .expect("a column")
            .keys()
            .map(String::as_str)
            .filter(|key| *key != "total")
            .collect();
        assert_eq!(all.len(), 10, "{all:?}");
        close(square_sum(column, &all), sigma_of(&column["total"]));
    }
    let gain = sigma_of(&budget["twist_deg"]["calibration_gain"]);
    assert!(
        (gain / (0.01 * common::TWIST_DEG) - 1.0).abs() < 0.01,
        "{gain}"
    );
    let length = sigma("/vectors/1/wavelength_nm/value");
    close(
        sigma_of(&budget["wavelengths_nm"][1]["calibration_gain"]),
        0.01 * length,
    );
    // The table holds the same.
    let rows = parse(&file(&common::analysis(), "budget.csv"));
    let total = rows
        .iter()
        .find(|row| row[0] == "slow y, 8 Hz" && row[1] == "drift_corrected" && row[2] == "total");
    let number: f64 = total.expect("the row")[3].parse().expect("a number");
    assert_eq!(Some(number), budget["twist_deg"]["total"].as_f64());
}

fn sigma_of(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
fn the_document_reads_back() {
    let results = Results::new(&common::analysis(), &common::provenance());
    let bytes = results.to_json().expect("JSON");
    let again: Results = serde_json::from_slice(&bytes).expect("the types read what they write");
    assert_eq!(again.to_json().expect("JSON"), bytes);
}

/// A reader of RFC 4180, written apart from the writer.
fn parse(text: &str) -> Vec<Vec<String>> {
    let (mut rows, mut row, mut field, mut quoted) = (Vec::new(), Vec::new(), String::new(), false);
    let mut characters = text.chars().peekable();
    while let Some(c) = characters.next() {
        match (c, quoted) {
            ('"', true) if characters.peek() == Some(&'"') => field.extend(characters.next()),
            ('"', _) => quoted = !quoted,
            (',', false) => row.push(std::mem::take(&mut field)),
            ('\r', false) => {}
            ('\n', false) => {
                row.push(std::mem::take(&mut field));
                rows.push(std::mem::take(&mut row));
            }
            (c, _) => field.push(c),
        }
    }
    assert!(field.is_empty() && row.is_empty(), "the last line ends");
    rows
}

#[test]
fn tables_survive_hostile_names() {
    let name = "a \"quoted\", ünïcode\r\nname, 深い.001";
    let mut analysis = common::analysis();
    analysis.sets[0].scans[0].file = name.to_owned();
    for (table, lines) in [
        ("vectors.csv", 16 * 9 + 3),
        ("scans.csv", 17 * 2),
        ("sets.csv", 3),
        ("budget.csv", 6 * 11),
    ] {
        let rows = parse(&file(&analysis, table));
        assert_eq!(rows.len(), lines + 1, "{table}");
        assert!(
            rows.iter().all(|row| row.len() == rows[0].len()),
            "{table}: ragged"
        );
        assert!(
            rows[0].iter().all(|n| n.is_ascii() && !n.is_empty()),
            "{table}: names"
        );
        if let Some(column) = rows[0].iter().position(|n| n == "file") {
            assert_eq!(rows[1][column], name);
        }
    }
}

/// A name that a spreadsheet would run has an apostrophe before it, everywhere it stands; numbers keep their signs.
#[test]
fn tables_hold_nothing_that_runs() {
    let name = "=cmd|' /C calc'!A0.spm";
    let mut analysis = common::analysis();
    analysis.sets[0].scans[0].file = name.to_owned();
    analysis.sets[0].scans[0].excluded = Some("@excluded, by hand".to_owned());
    analysis.sets[0].name = "-set".to_owned();
    let (mut marked, mut negative) = (0, 0);
    for table in ["vectors.csv", "scans.csv", "sets.csv", "budget.csv"] {
        for cell in parse(&file(&analysis, table)).concat() {
            let number = cell.parse::<f64>();
            assert!(
                number.is_ok() || !cell.starts_with(['=', '+', '-', '@', '\t', '\r']),
                "{table}: {cell:?}"
            );
            negative += usize::from(number.is_ok_and(|n| n < 0.0));
            marked += usize::from(["'-set", "'@excluded, by hand"].contains(&cell.as_str()));
            marked += usize::from(cell == format!("'{name}"));
        }
    }
    assert!(marked > 3 && negative > 100, "{marked} {negative}");
    let about = file(&analysis, "columns.md");
    assert!(about.contains("gets an apostrophe in front"));
}

#[test]
fn vectors_have_the_length_they_state() {
    let rows = parse(&file(&common::analysis(), "vectors.csv"));
    let column = |name: &str| rows[0].iter().position(|n| n == name).expect("the column");
    let (x, y, length) = (column("x_nm"), column("y_nm"), column("wavelength_nm"));
    for row in &rows[1..] {
        let number = |i: usize| row[i].parse::<f64>().expect("a number");
        assert!((number(x).hypot(number(y)) - number(length)).abs() < 1e-9);
    }
}

#[test]
fn every_column_is_explained() {
    let about = file(&common::analysis(), "columns.md");
    for table in ["vectors.csv", "scans.csv", "sets.csv", "budget.csv"] {
        for name in parse(&file(&common::analysis(), table)).swap_remove(0) {
            assert!(about.contains(&format!("| `{name}` |")), "{table}: {name}");
        }
    }
}

/// The total is what stands first on the screen and in large type on the page, and what a reader finds beside σ.
#[test]
fn totals_come_first() {
    let analysis = common::analysis();
    let document = document(&analysis);
    let mean = &document["sets"][0]["mean"];
    let number = |value: &Value| value.as_f64().expect("a number");
    let twist = &mean["twist_deg"];
    let total = number(&twist["sigma_total"]);
    assert!(total > 5.0 * number(&twist["sigma"]));
    // 1 % of gain and 0.04 % of the lattice constant at 1.126°; the rest is small.
    assert!(
        (total / (0.01 * common::TWIST_DEG) - 1.0).abs() < 0.03,
        "{total}"
    );
    assert_eq!(twist["sigma_total"], mean["budget"]["twist_deg"]["total"]);
    assert!(
        document["sets"][2]["uncorrected"]["twist_deg"]
            .get("sigma_total")
            .is_none()
    );

    let screen = moiregauge_report::screen::summary(&analysis, |_| None);
    let line = screen
        .lines()
        .find(|l| l.starts_with("  twist"))
        .expect("a twist");
    let (first, rest) = line.split_once('(').expect("a statistical part");
    assert!(first.contains("± 0.011°"), "{line}");
    assert!(rest.starts_with("statistical ± 0.00"), "{line}");

    let files =
        write_report(&analysis, &common::provenance(), &Choice::default()).expect("a report");
    let (_, page) = files
        .iter()
        .find(|(name, _)| name == "report.html")
        .expect("the page");
    let page = String::from_utf8_lossy(page);
    let large = page.split("class=\"value\">").nth(1).expect("a headline");
    assert!(large.contains("± 0.011)°"), "{}", &large[..60]);
    let sets = file(&analysis, "sets.csv");
    for column in [
        "twist_total_sigma_deg",
        "drift_x_total_sigma_nm_per_min",
        "lattice_angle_total_sigma_deg",
    ] {
        assert!(
            sets.lines()
                .next()
                .is_some_and(|head| head.contains(column)),
            "{column}"
        );
    }
}
