//! Maps of stripes from the command line.

use std::path::Path;

use moiregauge::simulate::FieldScene;
use serde_json::Value;

use crate::common::{between_axes, caveats, json, number, program, run, succeed, testdata};
use crate::maps::{follows_schema, quantity, written};

/// Stripes 14 pixels of 0.5 nm apart, running at 17.2° + 90°, walls in pairs.
fn stripes(folder: &Path) -> String {
    let mut scene = FieldScene::hexagonal([280, 260], 14.0, 0.3);
    // The period of a hexagonal scene is from spot to spot.
    scene.pair *= 0.75f64.sqrt();
    scene.harmonics = vec![([1, 0], 1.0), ([2, 0], 0.9)];
    (scene.white, scene.line) = (0.8, 0.2);
    written(folder, &scene.image())
}

fn pattern(results: &Value, number: usize) -> &Value {
    &results["stripes"]["patterns"][number]
}

/// Wavelength and direction of the simulation within the stated errors, by the map and by the fit; no twist.
#[test]
fn stripes_are_mapped() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = stripes(folder.path());
    let out = folder.path().join("out");
    let size = ["--size", "140nm×130nm"];
    let mut command = program();
    command.args(["map", &file, "--quiet", "--no-png", "--out"]);
    succeed(command.arg(&out).args(size));
    let results = json(&out.join("map.json"));
    follows_schema(&results);
    assert_eq!(results["method"], "stripes");
    let found = pattern(&results, 0);
    assert!(results["stripes"]["patterns"][1].is_null());
    let truth = [7.0, 0.3f64.to_degrees() + 90.0];
    for (name, truth) in ["wavelength", "direction"].into_iter().zip(truth) {
        let mean = quantity(&results, &format!("{name} 1"));
        let (value, sigma) = (number(mean, "/mean"), number(mean, "/mean_sigma"));
        assert!(
            (value - truth).abs() < 4.0 * sigma,
            "{name}: {value} ± {sigma}"
        );
        assert!(sigma < 0.01 * truth);
        // Nothing varies.
        let ratio = number(mean, "/spread") / number(mean, "/noise");
        assert!((0.6..1.4).contains(&ratio), "{name}: {ratio}");
    }
    for (name, truth) in ["wavelength_nm", "direction_deg"].into_iter().zip(truth) {
        let value = number(found, &format!("/{name}/value"));
        let sigma = number(found, &format!("/{name}/sigma"));
        assert!(
            (value - truth).abs() < 4.0 * sigma,
            "{name}: {value} ± {sigma}"
        );
    }
    assert!(number(found, "/coherence_percent") > 80.0);
    assert!(number(found, "/log10_chance") < -5.0);
    for code in ["stripes-only", "stripes-of-one-direction"] {
        assert!(caveats(&results).contains(&code), "{code}");
    }
    for there in [
        "map.zarr/wavelength/zarr.json",
        "map.zarr/direction_sigma/zarr.json",
        "map.gwy",
        "figures/map-wavelength.svg",
        "figures/map-direction.svg",
        "figures/map-mask.svg",
    ] {
        assert!(out.join(there).exists(), "{there}");
    }
    assert!(!out.join("map.zarr/twist").exists());
    let page = std::fs::read_to_string(out.join("report.html")).expect("a page");
    assert!(page.contains("<h3>Stripes</h3>") && !page.contains("graphene ·"));
}

/// What needs two wave vectors is refused by name, and `analyze` says what there is.
#[test]
fn stripes_have_no_twist() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = stripes(folder.path());
    let out = folder.path().join("out");
    let size = ["--size", "140nm×130nm", "--quiet", "--out"];
    for options in [
        &["--device", "20nm×10nm"][..],
        &["--wanted", "1.1±0.1"],
        &["--region", "a=-5,-5,10,10"],
        &["--map-method", "tiles"],
    ] {
        let mut command = program();
        command.args(["map", &file]).args(size);
        let refused = run(command.arg(&out).args(options));
        assert_ne!(refused.code, Some(0), "{options:?}");
        assert!(
            refused.stderr.contains("shows stripes and no lattice"),
            "{}",
            refused.stderr
        );
        assert!(!out.join("map.json").exists());
    }
    let mut command = program();
    let refused = run(command.args(["analyze", &file]).args(size).arg(&out));
    assert_ne!(refused.code, Some(0));
    assert!(
        refused.stderr.contains("shows stripes in") && refused.stderr.contains("7.0"),
        "{}",
        refused.stderr
    );
}

/// The herringbone of Au(111): two of its three domains, 60° apart on a crystal, about 22 atoms of 0.288 nm (6.34 nm) apart.
/// The scanner is not calibrated: lengths along x and y differ by 7 %, which also turns directions by up to 2°.
#[test]
fn herringbone() {
    let Some(data) = testdata("herringbone") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let file = data.join("real/nanonis/au111_herringbone_40nm.sxm");
    let mut all = Vec::new();
    for channel in ["Z", "Current"] {
        let out = folder.path().join(channel);
        let mut command = program();
        command.arg("map").arg(&file).arg("--out").arg(&out);
        command.args(["--channel", channel, "--margin", "1"]);
        succeed(command.args(["--no-report", "--quiet"]));
        let results = json(&out.join("map.json"));
        follows_schema(&results);
        for code in ["stripes-only", "stripe-domains", "map-noise-guessed"] {
            assert!(caveats(&results).contains(&code), "{code}");
        }
        let patterns = results["stripes"]["patterns"].as_array().expect("patterns");
        assert_eq!(patterns.len(), 2);
        for (n, p) in patterns.iter().enumerate() {
            let fit = |key: &str| number(p, &format!("/{key}"));
            let wavelength = quantity(&results, &format!("wavelength {}", n + 1));
            let off = number(wavelength, "/mean") - fit("wavelength_nm/value");
            let sigma = number(wavelength, "/mean_sigma").hypot(fit("wavelength_nm/sigma"));
            assert!(off.abs() < 3.0 * sigma, "{channel} {n}: {off} ± {sigma}");
            assert!((fit("wavelength_nm/value") / 6.34 - 1.0).abs() < 0.1, "{p}");
            assert!(fit("log10_chance") < -10.0);
            assert!(fit("share_percent") > 25.0 && fit("good_nodes") > 50.0);
        }
        let direction = |n: usize| number(&patterns[n], "/direction_deg/value");
        let between = between_axes(direction(0), direction(1)).abs();
        assert!((between - 60.0).abs() < 2.0, "{between}");
        let mut sorted: Vec<Value> = patterns.clone();
        sorted.sort_by(|a, b| {
            number(a, "/direction_deg/value").total_cmp(&number(b, "/direction_deg/value"))
        });
        all.push(sorted);
    }
    // Topography and current show the same walls, with noise that is not quite the same.
    for (a, b) in all[0].iter().zip(&all[1]) {
        for key in ["wavelength_nm", "direction_deg"] {
            let of = |p: &Value, what: &str| number(p, &format!("/{key}/{what}"));
            let off = of(a, "value") - of(b, "value");
            let sigma = of(a, "sigma").hypot(of(b, "sigma"));
            assert!(off.abs() < 3.0 * sigma, "{key}: {off} ± {sigma}");
        }
    }
}
