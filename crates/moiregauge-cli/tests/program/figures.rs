//! What the figures and words of the program agree on, and how its options are sorted.

use std::path::Path;

use crate::common::{analyze, json, number, program, results, run, simulate, succeed};

/// A set whose three wavelengths differ by more than a per cent.
fn strained(folder: &Path) -> std::path::PathBuf {
    let options = [
        "--pixels",
        "128",
        "--scans",
        "2",
        "--strain",
        "0.4",
        "--no-retrace",
    ];
    simulate(folder, &options)
}

/// L₁, L₂ and L₃ are the same vectors in `analyze` and in `map`.
#[test]
fn maps_number_the_vectors_as_the_analysis_does() {
    let folder = tempfile::tempdir().unwrap();
    let scans = strained(folder.path());
    let out = folder.path().join("out");
    succeed(&mut analyze(&scans, &out));
    let analysed = results(&out);
    let maps = folder.path().join("maps");
    let mut command = program();
    command
        .arg("map")
        .arg(&scans)
        .arg("--out")
        .arg(&maps)
        .arg("--no-report");
    succeed(&mut command);
    let map = json(&maps.join("map.json"));
    let mean = |name: &str| {
        let all = map["quantities"].as_array().expect("a list");
        let found = all
            .iter()
            .find(|q| q["name"] == name)
            .expect("the quantity");
        number(found, "/mean")
    };
    let lengths = [0, 1, 2].map(|i| {
        number(
            &analysed,
            &format!("/sets/0/mean/vectors/{i}/wavelength_nm/value"),
        )
    });
    for (i, length) in lengths.iter().enumerate() {
        let found = mean(&format!("wavelength {}", i + 1));
        assert!(
            (found / length - 1.0).abs() < 0.004,
            "{i}: {found}, {length}"
        );
        let others = lengths.iter().filter(|other| *other != length);
        assert!(
            others.into_iter().all(|o| (found / o - 1.0).abs() > 0.008),
            "{lengths:?}"
        );
    }
    let direction = number(&analysed, "/sets/0/mean/vectors/0/polar_angle_deg");
    assert!((mean("orientation") - direction).abs() < 0.5);
}

/// Every heading of the help holds what belongs to it, and not the rest of the options.
#[test]
fn options_stand_under_headings_that_fit() {
    for command in ["analyze", "map"] {
        let help = succeed(program().args([command, "--help"])).stdout;
        let (mut heading, mut counts) = (String::new(), Vec::<(String, usize)>::new());
        for line in help.lines() {
            if line.ends_with(':') && !line.starts_with(' ') {
                line.clone_into(&mut heading);
                counts.push((heading.clone(), 0));
            }
            if line.trim_start().starts_with('-') && line.starts_with("  ") && line.contains("--") {
                if let Some(last) = counts.last_mut() {
                    last.1 += 1;
                }
                if heading.starts_with("Orientation") {
                    let option = line.trim_start();
                    let fits = ["--lattice-angle", "--atomic", "--twist-sense"];
                    assert!(
                        fits.iter().any(|f| option.starts_with(f)),
                        "{command}: {option}"
                    );
                }
            }
        }
        let all: usize = counts.iter().map(|c| c.1).sum();
        assert!(all > 50, "{counts:?}");
        assert!(counts.iter().all(|c| c.1 <= 16), "{command}: {counts:?}");
    }
}

/// An image of a larger area is a figure, and one of the inputs; one that cannot be read ends the run at once.
#[test]
fn a_survey_image_shows_where_the_scans_are() {
    let folder = tempfile::tempdir().unwrap();
    let scans = strained(folder.path());
    let options = [
        "--pixels", "64", "--scans", "1", "--size", "200", "200", "--twist", "0.6",
    ];
    let survey = simulate(&folder.path().join("large"), &options);
    let survey = std::fs::read_dir(survey)
        .unwrap()
        .filter_map(|e| Some(e.ok()?.path()))
        .find(|p| p.extension().is_some_and(|e| e == "spm"))
        .expect("a scan");
    let out = folder.path().join("out");
    let mut command = program();
    command.arg("analyze").arg(&scans).arg("--out").arg(&out);
    command.arg("--no-png").arg("--survey-image").arg(&survey);
    succeed(&mut command);
    let figure = std::fs::read_to_string(out.join("figures/survey.svg")).expect("the figure");
    assert!(figure.contains("<image") && figure.contains("slow y"));
    // What the paper shows, and simulated files hold: both sensors, amplitude beside phase.
    for name in ["set1-residuals", "set1-amplitude", "set1-twist-wavelength"] {
        assert!(out.join(format!("figures/{name}.svg")).is_file(), "{name}");
    }
    let inputs = results(&out)["provenance"]["inputs"]
        .as_array()
        .expect("a list")
        .len();
    assert_eq!(inputs, 3);

    let mut command = analyze(&scans, &folder.path().join("none"));
    let refused = run(command.args(["--survey-image", "nowhere.spm"]));
    assert_eq!(refused.code, Some(1));
    assert!(
        refused.stderr.contains("--survey-image nowhere.spm"),
        "{}",
        refused.stderr
    );
    assert!(!folder.path().join("none").exists());
}
