//! Files with several images: it is said which one is analysed, and another can be asked for.

use std::f64::consts::TAU;
use std::path::Path;

use serde_json::Value;
use spmfile::{Channel, Samples, Scan, Span, WritableFormat, write};

use crate::common::{analyze, caveats, number, program, results, run, succeed};

const PIXELS: usize = 128;
const SIZE_NM: f64 = 100.0;

/// A hexagonal lattice of this wavelength with some noise, turned by 7°.
fn image(name: &str, wavelength_nm: f64, pixels: usize) -> Channel {
    let pitch = SIZE_NM / pixels as f64;
    let wave = |i: usize| {
        let angle = 0.12 + i as f64 * TAU / 6.0;
        let k = TAU / (wavelength_nm * 0.75_f64.sqrt());
        [k * angle.cos(), k * angle.sin()]
    };
    let mut seed = 1_u64;
    let mut noise = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
    };
    let value = |n: usize, noise: f64| {
        let (x, y) = ((n % pixels) as f64 * pitch, (n / pixels) as f64 * pitch);
        let waves = (0..3).map(wave).map(|[kx, ky]| (kx * x + ky * y).cos());
        waves.sum::<f64>() + noise
    };
    Channel {
        name: name.to_owned(),
        internal_name: String::new(),
        unit: "V".to_owned(),
        line_direction: None,
        scan_line: None,
        rows: pixels,
        columns: pixels,
        width_nm: Some(SIZE_NM),
        height_nm: Some(SIZE_NM),
        span: Span::PixelEdges,
        scale: 1.0,
        offset: 0.0,
        scaling: String::new(),
        plane_fit: None,
        samples: Samples::F64((0..pixels * pixels).map(|n| value(n, noise())).collect()),
    }
}

fn file(folder: &Path, name: &str, channels: Vec<Channel>) -> std::path::PathBuf {
    let (stem, extension) = name.rsplit_once('.').unwrap();
    let scan = Scan {
        format: "made up".to_owned(),
        size_nm: Some([SIZE_NM; 2]),
        channels,
        ..Scan::default()
    };
    let format = WritableFormat::from_extension(extension).unwrap();
    let (_, bytes) = write(&scan, format, stem, &[]).unwrap().swap_remove(0);
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// The wavelength that was found, and the words about several images.
fn found(results: &Value) -> (f64, Option<String>) {
    let all = results["caveats"].as_array().unwrap();
    let about = all.iter().find(|c| c["code"] == "several-images");
    let vectors = "/sets/0/scans/0/lines/0/vectors/0/wavelength_nm/value";
    let words = about.map(|c| c["message"].as_str().unwrap().to_owned());
    (number(results, vectors), words)
}

#[test]
fn pages_of_one_name() {
    let folder = tempfile::tempdir().unwrap();
    let pages = [13.0, 10.0, 16.0].map(|wavelength| image("Phase", wavelength, PIXELS));
    let path = file(folder.path(), "pages.gwy", pages.to_vec());
    let out = folder.path().join("out");
    let measured = |options: &[&str]| {
        let said = succeed(analyze(&path, &out).arg("--force").args(options)).stdout;
        let (wavelength, words) = found(&results(&out));
        let told = said.contains("  try --channel NAME or --image N\n");
        assert_eq!(told, words.is_some(), "{said}");
        (wavelength, words)
    };
    let (wavelength, words) = measured(&[]);
    assert!((wavelength - 13.0).abs() < 0.05, "{wavelength}");
    let words = words.expect("a caveat");
    assert!(words.contains("3 images of \"Phase\""), "{words}");
    for (page, expected) in [("1", 13.0), ("2", 10.0), ("3", 16.0)] {
        let (wavelength, words) = measured(&["--image", page]);
        assert!((wavelength - expected).abs() < 0.05, "{page}: {wavelength}");
        assert_eq!(words, None);
    }
    let ran = run(analyze(&path, &out).args(["--force", "--image", "4"]));
    assert_eq!(ran.code, Some(1));
    assert!(
        ran.stderr
            .contains("expected image 4 of \"Phase\", found 3"),
        "{}",
        ran.stderr
    );
    let info = succeed(program().arg("info").arg(&path));
    assert!(
        info.stdout.contains("3 images of \"Phase\""),
        "{}",
        info.stdout
    );
}

/// The pages of a TIFF file without descriptions have numbers for names.
#[test]
fn pages_without_names() {
    let folder = tempfile::tempdir().unwrap();
    let pages = [13.0, 10.0].map(|wavelength| image("", wavelength, PIXELS));
    let path = file(folder.path(), "pages.tiff", pages.to_vec());
    // A description of another shape is not believed.
    let mut bytes = std::fs::read(&path).unwrap();
    let (from, to) = (b"spmfile shape = 128", b"spmfile shape = 127");
    for place in 0..bytes.len() - from.len() {
        if bytes[place..].starts_with(from) {
            bytes[place..place + to.len()].copy_from_slice(to);
        }
    }
    std::fs::write(&path, bytes).unwrap();
    let out = folder.path().join("out");
    let measured = |options: &[&str]| {
        let ran = succeed(
            analyze(&path, &out)
                .args(["--force", "--size", "100nm×100nm"])
                .args(options),
        );
        let (wavelength, words) = found(&results(&out));
        let told = ran.stdout.contains("  try --channel NAME or --image N\n");
        assert_eq!(told, words.is_some(), "{}", ran.stdout);
        (wavelength, words)
    };
    let (wavelength, words) = measured(&[]);
    assert!((wavelength - 13.0).abs() < 0.05, "{wavelength}");
    let words = words.expect("a caveat");
    assert!(
        words.contains("2 images (\"image 1\", \"image 2\")"),
        "{words}"
    );
    let (wavelength, words) = measured(&["--channel", "image 2"]);
    assert!((wavelength - 10.0).abs() < 0.05, "{wavelength}");
    assert_eq!(words, None);
}

/// One of the usual channels among others, or a single one: nothing to choose.
#[test]
fn channels_of_instruments_are_no_pages() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let channels = ["Height", "Phase", "Excitation"].map(|name| image(name, 13.0, PIXELS));
    for (name, channels) in [
        ("usual.gwy", channels.to_vec()),
        ("one.gwy", vec![image("", 13.0, PIXELS)]),
    ] {
        succeed(analyze(&file(folder.path(), name, channels), &out).arg("--force"));
        let results = results(&out);
        assert!(!caveats(&results).contains(&"several-images"), "{name}");
    }
}

#[test]
fn pixels_beyond_one_of_several_channels() {
    let folder = tempfile::tempdir().unwrap();
    let channels = vec![
        image("Phase", 13.0, PIXELS),
        image("Thumbnail", 13.0, PIXELS / 2),
    ];
    let path = file(folder.path(), "two.gwy", channels);
    let at = |pixel: &str| {
        run(program()
            .arg("info")
            .arg(&path)
            .args(["--json", "--at", pixel]))
    };
    let ran = at("0,100");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let info: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert!(number(&info, "/0/channels/0/samples/0/value").is_finite());
    assert_eq!(info[0]["channels"][1]["samples"][0]["value"], Value::Null);
    let ran = at("0,128");
    assert_eq!(ran.code, Some(1));
    assert!(
        ran.stderr.contains("outside all channels"),
        "{}",
        ran.stderr
    );
}
