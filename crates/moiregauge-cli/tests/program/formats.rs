//! `convert`, `analyze --export` and `--parquet`, and the options for what files do not tell.

use std::path::{Path, PathBuf};

use crate::common::{
    analyze, caveats, estimate, number, program, results, run, small_set, succeed,
};

/// The scans of a folder, by name.
fn scans(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut files: Vec<PathBuf> = entries
        .map(|e| e.expect("an entry").path())
        .filter(|p| p.extension().is_some_and(|e| e == "spm"))
        .collect();
    files.sort();
    files
}

fn read(path: &Path) -> spmfile::Scan {
    let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    spmfile::read(&bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn convert(paths: &[&Path], options: &[&str]) -> std::process::Command {
    let mut command = program();
    command.arg("convert").args(paths).args(options);
    command
}

/// Every format that is read again holds the same numbers, pitches, directions and times.
#[test]
fn conversions_keep_everything() {
    let work = tempfile::tempdir().expect("a folder");
    let file = &scans(&small_set(work.path()))[0];
    let original = read(file);
    for (name, relative) in [
        ("a.gwy", 1e-14),
        ("b/a.npz", 0.0),
        ("a.tif", 1e-6),
        ("phase.csv", 0.0),
        ("phase.gsf", 1e-6),
    ] {
        let out = work.path().join(name);
        let single = name.starts_with("phase");
        let options: &[&str] = if single {
            &["--channel", "TR Phase"]
        } else {
            &[]
        };
        succeed(&mut convert(&[file, &out], options));
        let files = if single {
            let extension = out.extension().expect("one").to_string_lossy();
            let line = |line: &str| {
                work.path()
                    .join(format!("phase-TR_Phase_{line}.{extension}"))
            };
            vec![line("trace"), line("retrace")]
        } else {
            vec![out]
        };
        let converted: Vec<spmfile::Scan> = files.iter().map(|f| read(f)).collect();
        let count: usize = converted.iter().map(|s| s.channels.len()).sum();
        let expected = if single { 2 } else { original.channels.len() };
        assert_eq!(count, expected, "{name}");
        for scan in &converted {
            assert_eq!(scan.acquired, original.acquired, "{name}");
            assert_eq!(scan.frame_direction, original.frame_direction, "{name}");
            assert_eq!(scan.line_rate_hz, original.line_rate_hz, "{name}");
            assert_eq!(scan.rounding, original.rounding, "{name}");
            assert_eq!(scan.rotation_rad, original.rotation_rad, "{name}");
            assert_eq!(scan.offset_nm, original.offset_nm, "{name}");
            assert!(!scan.metadata.is_empty(), "{name}");
            for channel in &scan.channels {
                let same = |c: &&spmfile::Channel| {
                    c.name == channel.name && c.line_direction == channel.line_direction
                };
                let before = original.channels.iter().find(same).expect("the channel");
                let [a, b] = [channel, before].map(|c| c.pitch_nm().expect("a pitch"));
                assert!((a[0] / b[0] - 1.0).abs() < 1e-12, "{name}: {a:?} for {b:?}");
                assert!((a[1] / b[1] - 1.0).abs() < 1e-12, "{name}: {a:?} for {b:?}");
                // Gwyddion's files are in units without prefixes.
                let factor = match (channel.unit.as_str(), before.unit.as_str()) {
                    ("m", "nm") => 1e9,
                    ("V", "mV") => 1e3,
                    ("deg", "°") => 1.0,
                    (a, b) => {
                        assert_eq!(a, b, "{name}");
                        1.0
                    }
                };
                let largest = before.values().iter().fold(0.0, |m: f64, v| m.max(v.abs()));
                for (a, b) in channel.values().iter().zip(before.values()) {
                    assert!(
                        (a * factor - b).abs() <= relative * largest,
                        "{name}: {a} for {b}"
                    );
                }
            }
        }
    }
}

/// The lattice does not care in which format the scans are.
#[test]
fn converted_sets_give_the_same_results() {
    let work = tempfile::tempdir().expect("a folder");
    let folder = small_set(work.path());
    let out = work.path().join("converted");
    succeed(&mut convert(&[&folder, &out], &["--to", "gwy"]));
    let (first, second) = (work.path().join("first"), work.path().join("second"));
    let few = ["--drift-draws", "0", "--strain-draws", "0"];
    succeed(analyze(&folder, &first).args(few));
    succeed(analyze(&out, &second).args(few));
    let (first, second) = (results(&first), results(&second));
    for pointer in [
        "/sets/0/mean/twist_deg",
        "/sets/0/drift/x_nm_per_min",
        "/sets/0/drift/y_nm_per_min",
    ] {
        let (a, sigma) = estimate(&first, pointer);
        let (b, _) = estimate(&second, pointer);
        assert!(
            (a - b).abs() < 1e-6 * sigma,
            "{pointer}: {a} and {b} ± {sigma}"
        );
    }
}

/// Bad files are told and skipped; nothing is written over; two inputs never become one file.
#[test]
fn batches_survive_bad_files() {
    let work = tempfile::tempdir().expect("a folder");
    let files = scans(&small_set(work.path()));
    let (bad, twin) = (work.path().join("bad.spm"), work.path().join("twin"));
    std::fs::write(&bad, "no scan at all").expect("written");
    std::fs::create_dir(&twin).expect("a folder");
    let twin = twin.join(files[0].file_name().expect("a name"));
    std::fs::copy(&files[0], &twin).expect("copied");
    let out = work.path().join("out");
    let paths: [&Path; 5] = [&files[0], &bad, &twin, &files[1], &out];
    let first = run(&mut convert(&paths, &["--to", "npz"]));
    assert_eq!(first.code, Some(1));
    assert!(first.stderr.contains("bad.spm"), "{}", first.stderr);
    assert!(first.stderr.contains("another file"), "{}", first.stderr);
    assert_eq!(std::fs::read_dir(&out).expect("a folder").count(), 2);
    let again = run(&mut convert(&[&files[0], &out], &["--to", "npz"]));
    assert!(again.stderr.contains("--force"), "{}", again.stderr);
    assert_eq!(again.code, Some(1));
    succeed(&mut convert(
        &[&files[0], &out],
        &["--to", "npz", "--force"],
    ));
    let unknown = run(&mut convert(&[&files[0], &work.path().join("a.xyz")], &[]));
    assert!(unknown.stderr.contains("gwy"), "{}", unknown.stderr);
    let several = run(&mut convert(
        &[&files[0], &files[1], &work.path().join("a.gwy")],
        &[],
    ));
    assert!(several.stderr.contains("--to"), "{}", several.stderr);
    let channel = run(&mut convert(
        &[&files[0], &work.path().join("a.gwy")],
        &["--channel", "Nix"],
    ));
    assert!(channel.stderr.contains("Nix"), "{}", channel.stderr);
}

/// A corrected image, analysed by itself, shows the drift-corrected lattice of its scan.
#[test]
fn corrected_images_show_the_corrected_lattice() {
    let work = tempfile::tempdir().expect("a folder");
    let folder = small_set(work.path());
    let out = work.path().join("out");
    succeed(analyze(&folder, &out).args([
        "--export",
        "corrected.gwy,corrected.zarr",
        "--strain-draws",
        "0",
    ]));
    let whole = results(&out);
    let images = out.join("corrected");
    let mut names: Vec<String> = std::fs::read_dir(&images)
        .expect("images")
        .map(|e| {
            e.expect("an entry")
                .file_name()
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    names.sort();
    assert_eq!(names.len(), 16, "{names:?}");
    let scan = read(&images.join(&names[0]));
    assert_eq!(
        (scan.frame_direction, scan.line_rate_hz, scan.rotation_rad),
        (None, None, 0.0)
    );
    let [fast, slow] = scan.channels[0].pitch_nm().expect("a pitch");
    assert!((fast - slow).abs() < 1e-12 * fast);
    assert!(
        scan.metadata
            .iter()
            .any(|(key, _)| key == "moiregauge drift (nm/min)")
    );

    let again = work.path().join("again");
    let gwy = format!("{}/*-trace.gwy", images.display());
    succeed(analyze(Path::new(&gwy), &again).args(["--strain-draws", "0", "--line", "trace"]));
    let again = results(&again);
    assert!(caveats(&again).contains(&"no-position-sensors"));
    for index in 0..4 {
        let vector = |results: &serde_json::Value, kind: &str, name: &str| {
            number(
                results,
                &format!("/sets/0/scans/{index}/vectors/0/{kind}/{name}"),
            )
        };
        let variance = number(
            &whole,
            &format!("/sets/0/scans/{index}/vectors/0/drift_corrected/covariance_nm2/0/0"),
        );
        for name in ["x_nm", "y_nm"] {
            let found = vector(&again, "sensor", name);
            let expected = vector(&whole, "drift_corrected", name);
            // One line direction against both: their own noise, three standard deviations.
            let off = (found - expected).abs();
            assert!(
                off < 4.0 * (2.0 * variance).sqrt(),
                "{index} {name}: {found} for {expected}"
            );
        }
    }
}

/// Arrays know nothing: with what the user says they give the results of the scans they come from.
#[test]
fn arrays_with_options_give_the_results_of_their_scans() {
    let work = tempfile::tempdir().expect("a folder");
    let folder = small_set(work.path());
    let plain = work.path().join("plain");
    std::fs::create_dir(&plain).expect("a folder");
    let mut edges = [0.0; 2];
    let mut rate = 0.0;
    let mut first = spmfile::FrameDirection::Up;
    for (number, file) in scans(&folder).iter().enumerate() {
        let scan = read(file);
        let trace = |c: &&spmfile::Channel| {
            c.name == "TR Phase" && c.line_direction == Some(spmfile::LineDirection::Trace)
        };
        let channel = scan.channels.iter().find(trace).expect("a channel");
        edges = channel.edges_nm().expect("a size");
        rate = scan.line_rate_hz.expect("a rate");
        if number == 0 {
            first = scan.frame_direction.expect("a direction");
        }
        // Numbers and nothing else, so that options are all there is.
        let text: String = channel
            .values()
            .rchunks_exact(channel.columns)
            .map(|row| {
                let numbers: Vec<String> = row.iter().map(|v| format!("{v:?}")).collect();
                numbers.join(" ") + "\n"
            })
            .collect();
        std::fs::write(plain.join(format!("s{}.txt", number + 8)), text).expect("written");
    }
    let size = format!("{}nm×{}nm", edges[0], edges[1]);
    let rate = rate.to_string();
    let alternating = match first {
        spmfile::FrameDirection::Up => "alternating-up",
        spmfile::FrameDirection::Down => "alternating-down",
    };
    let files: Vec<PathBuf> = (8..12).map(|n| plain.join(format!("s{n}.txt"))).collect();
    let out = work.path().join("arrays");
    let mut command = program();
    command.arg("analyze").args(&files).arg("--out").arg(&out);
    command.args(["--no-report", "--drift-draws", "0", "--strain-draws", "0"]);
    command.args(["--method", "autocorrelation"]);
    command.args([
        "--size",
        &size,
        "--line-rate",
        &rate,
        "--frame-direction",
        alternating,
    ]);
    succeed(&mut command);
    let arrays = results(&out);

    // The same scans without their sensors.
    let bare = work.path().join("bare");
    succeed(&mut convert(
        &[&folder, &bare],
        &["--to", "gwy", "--channel", "TR Phase"],
    ));
    let out = work.path().join("scans");
    succeed(analyze(&bare, &out).args([
        "--method",
        "autocorrelation",
        "--line",
        "trace",
        "--drift-draws",
        "0",
        "--strain-draws",
        "0",
    ]));
    let expected = results(&out);
    // The rounding of NanoScope lines has no option: time enters as if there were none.
    for pointer in [
        "/sets/0/drift/x_nm_per_min",
        "/sets/0/drift/y_nm_per_min",
        "/sets/0/mean/twist_deg",
    ] {
        let (a, sigma) = estimate(&expected, pointer);
        let (b, _) = estimate(&arrays, pointer);
        assert!(
            (a - b).abs() < 0.05 * sigma,
            "{pointer}: {a} and {b} ± {sigma}"
        );
    }

    // A single array of which nothing but the size is known works, and says what is missing.
    let out = work.path().join("single");
    let mut command = analyze(&files[0], &out);
    let said = succeed(command.args(["--size", &size, "--strain-draws", "0"]));
    assert!(
        said.stdout
            .contains("not determined; assumed: 0 ± 1.0 nm/min"),
        "{}",
        said.stdout
    );
    assert!(
        said.stdout.contains("no-position-sensors"),
        "{}",
        said.stdout
    );
    let nothing = run(&mut analyze(&files[0], &work.path().join("nothing")));
    assert_eq!(nothing.code, Some(1));
    assert!(nothing.stderr.contains("size"), "{}", nothing.stderr);
}

/// Sensors by name and from a second file are those that the file itself would have had.
#[test]
fn sensors_by_name_and_from_a_second_file() {
    let work = tempfile::tempdir().expect("a folder");
    let folder = small_set(work.path());
    let file = &scans(&folder)[0];
    let mut scan = read(file);
    scan.channels
        .retain(|c| c.line_direction == Some(spmfile::LineDirection::Trace));
    let own = work.path().join("own.gwy");
    std::fs::write(&own, spmfile::gwy::write(&scan, &[]).expect("bytes")).expect("written");
    for channel in &mut scan.channels {
        match spmfile::sensor_axis(&channel.name, &channel.internal_name) {
            Some('X') => "Input 1".clone_into(&mut channel.name),
            Some(_) => "Input 2".clone_into(&mut channel.name),
            None => {}
        }
        channel.internal_name.clear();
    }
    let named = work.path().join("named.gwy");
    std::fs::write(&named, spmfile::gwy::write(&scan, &[]).expect("bytes")).expect("written");
    let bare = work.path().join("bare.gwy");
    succeed(&mut convert(&[&own, &bare], &["--channel", "TR Phase"]));
    let names = ["--x-sensor", "input 1", "--y-sensor", "Input_2"];
    let second = own.to_string_lossy();
    let cases: [(&Path, &[&str]); 4] = [
        (&own, &[]),
        (&named, &names),
        (&bare, &["--sensors", &second]),
        (&bare, &[]),
    ];
    let vectors: Vec<f64> = cases
        .iter()
        .enumerate()
        .map(|(index, (file, options))| {
            let out = work.path().join(index.to_string());
            succeed(
                analyze(file, &out)
                    .args(*options)
                    .args(["--strain-draws", "0"]),
            );
            number(&results(&out), "/sets/0/scans/0/vectors/0/sensor/x_nm")
        })
        .collect();
    assert_eq!(vectors[0], vectors[1]);
    assert_eq!(vectors[0], vectors[2]);
    assert_ne!(vectors[0], vectors[3]);
    let wrong = run(analyze(&bare, &work.path().join("x")).args(names));
    assert!(wrong.stderr.contains("input 1"), "{}", wrong.stderr);
}

/// Rows are counted from the top: the upper half of the frame lies at larger y.
#[test]
fn blocks_are_those_of_the_screen() {
    let work = tempfile::tempdir().expect("a folder");
    let file = &scans(&small_set(work.path()))[0];
    let out = work.path().join("top.npz");
    succeed(&mut convert(&[file, &out], &["--crop", "16,0,100,40"]));
    let (whole, part) = (read(file), read(&out));
    for (a, b) in whole.channels.iter().zip(&part.channels) {
        assert_eq!((b.rows, b.columns), (40, 100));
        let row = |c: &spmfile::Channel, row: usize| {
            c.values()[row * c.columns..(row + 1) * c.columns].to_vec()
        };
        assert_eq!(row(a, 127)[16..116], row(b, 39));
        assert_eq!(row(a, 88)[16..116], row(b, 0));
    }
    assert!(part.offset_nm[1] > whole.offset_nm[1]);
    let outside = run(&mut convert(
        &[file, &work.path().join("x.npz")],
        &["--crop", "0,100,9,29"],
    ));
    assert!(outside.stderr.contains("--crop"), "{}", outside.stderr);
}

/// What the user says instead of the file is said in the results.
#[test]
fn replaced_numbers_are_caveats() {
    let work = tempfile::tempdir().expect("a folder");
    let file = &scans(&small_set(work.path()))[0];
    let out = work.path().join("out");
    succeed(analyze(file, &out).args(["--line-rate", "0.123", "--strain-draws", "0"]));
    let found = results(&out);
    assert!(caveats(&found).contains(&"given-by-user"));
    assert_eq!(number(&found, "/sets/0/line_rate_hz"), 0.123);
}

/// A turned frame in laboratory axes: its corners are missing, its centre stays.
#[test]
fn frames_are_turned_into_laboratory_axes() {
    let work = tempfile::tempdir().expect("a folder");
    let file = &scans(&small_set(work.path()))[0];
    let out = work.path().join("turned.gwy");
    let options = [
        "--rotation",
        "30",
        "--rotate-to-lab",
        "--channel",
        "TR Phase",
    ];
    succeed(&mut convert(&[file, &out], &options));
    let (whole, turned) = (read(file), read(&out));
    assert_eq!(turned.rotation_rad, 0.0);
    for (a, b) in turned.offset_nm.iter().zip(whole.offset_nm) {
        assert!((a - b).abs() < 1e-6, "{a} for {b}");
    }
    let values = turned.channels[0].values();
    let missing = values.iter().filter(|v| v.is_nan()).count() as f64 / values.len() as f64;
    // A square turned by 30° fills 1/(cos 30° + sin 30°)² of its bounding box.
    assert!((missing - (1.0 - 0.5359)).abs() < 0.02, "{missing}");
}
