//! The same data twice, two samples, headers that contradict the images, layers that cannot be: from outside.

use std::path::Path;

use serde_json::Value;

use crate::common::{
    analyze, caveats, number, program, results, run, small_set, succeed, testdata,
};

/// Twist, strain and drift of the first set, with errors.
fn numbers(found: &Value) -> Vec<f64> {
    let of = |pointer: &str| ["value", "sigma"].map(|p| number(found, &format!("{pointer}/{p}")));
    [
        of("/sets/0/mean/twist_deg"),
        of("/sets/0/mean/heterostrain_percent"),
        of("/sets/0/drift/x_nm_per_min"),
        of("/sets/0/drift/y_nm_per_min"),
    ]
    .concat()
}

fn quick(inputs: &[&Path], out: &Path) -> Value {
    let mut command = program();
    command.arg("analyze").args(inputs).arg("--out").arg(out);
    succeed(command.args(["--no-report", "--drift-draws", "0", "--strain-draws", "0"]));
    results(out)
}

/// A folder twice, by wildcards, copies under other names, and converted files beside the originals: the numbers are those
/// of the originals alone, and what was left out is named.
#[test]
fn data_given_twice_count_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let scans = small_set(folder.path());
    let once = quick(&[&scans], &at("once"));
    assert!(!caveats(&once).contains(&"same-scan-twice"));
    let stars = scans.join("*.spm");
    let around = at(".").join("simulated");
    let again = quick(&[&scans, &stars, &around], &at("again"));
    let copies = at("copies");
    std::fs::create_dir(&copies).unwrap();
    for (i, entry) in std::fs::read_dir(&scans).unwrap().enumerate() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "spm") {
            std::fs::copy(&path, copies.join(format!("copy {i}.spm"))).unwrap();
        }
    }
    let copied = quick(&[&copies, &scans], &at("copied"));
    for found in [&again, &copied] {
        assert_eq!(numbers(found), numbers(&once));
        let told = caveats(found)
            .iter()
            .filter(|c| **c == "same-scan-twice")
            .count();
        assert!(told >= 4, "{told}");
    }
    for format in ["gwy", "npz", "tiff"] {
        let mut convert = program();
        succeed(
            convert
                .arg("convert")
                .arg(&stars)
                .arg(&scans)
                .args(["--to", format]),
        );
    }
    let beside = quick(&[&scans.join("scan.*")], &at("beside"));
    // The container of a scan comes first by name: its values are those of the scan, rounded once more on their way through metres.
    for (found, expected) in numbers(&beside).into_iter().zip(numbers(&once)) {
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    }
    let scans = beside["sets"][0]["scans"].as_array().unwrap();
    let left_out = scans.iter().filter(|s| {
        s["excluded"]
            .as_str()
            .is_some_and(|e| e.starts_with("it repeats"))
    });
    assert_eq!((scans.len(), left_out.count()), (16, 12));
}

/// Every scan excluded, and layers whose longest moiré is 8.5 nm where 12.5 nm were measured: no success without a reason.
#[test]
fn refusals_have_reasons() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let with =
        |out: &str, options: &[&str]| run(analyze(&scans, &folder.path().join(out)).args(options));
    let nothing = with("a", &["--exclude", "*"]);
    assert_eq!(nothing.code, Some(1));
    assert!(
        nothing.stderr.contains("excluded all 4 scans"),
        "{}",
        nothing.stderr
    );
    let impossible = with("b", &["--layers", "MoS2/WSe2"]);
    assert_eq!(impossible.code, Some(1));
    assert!(
        impossible.stderr.contains("at most"),
        "{}",
        impossible.stderr
    );
    assert!(
        impossible.stdout.starts_with("Layers: MoS2"),
        "{}",
        impossible.stdout
    );
    assert!(!impossible.stdout.contains("assumed"));
    let assumed = with("c", &[]);
    assert!(
        assumed
            .stdout
            .lines()
            .next()
            .is_some_and(|l| l.ends_with("(assumed)")),
        "{}",
        assumed.stdout
    );
    let named = with("d", &["--material", "graphene"]);
    assert!(!named.stdout.contains("(assumed)"));
}

/// Frames as headers tell them and as the images show them, by an independent generator and writer.
#[test]
fn headers_of_another_generator() {
    let Some(data) = testdata("headers_of_another_generator") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    for (case, words) in [
        (
            "flags_swapped",
            "but they do with all slow directions the other way",
        ),
        ("rate_doubled", "but they do with half the line rate"),
    ] {
        let found = quick(&[&data.join("hard").join(case)], &folder.path().join(case));
        let all = found["caveats"].as_array().unwrap();
        let mut told = all
            .iter()
            .filter(|c| c["code"] == "headers-contradict-images");
        let named = |c: &Value| c["message"].as_str().is_some_and(|m| m.contains(words));
        assert!(told.any(named), "{case}: {all:?}");
    }
    let good = data.join("sets/slow_y");
    let found = quick(&[&good], &folder.path().join("good"));
    for code in [
        "headers-contradict-images",
        "frames-do-not-link",
        "dates-contradict-line-rate",
        "samples-separated",
    ] {
        assert!(!caveats(&found).contains(&code), "{code}");
    }
}
