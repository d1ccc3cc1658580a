//! Real images of known lattices, through the whole chain.

use std::path::Path;

use heterostrain::lattice::Lattice;
use moiregauge::campaign::analyse;
use moiregauge::scan::measure_scan;
use moiregauge::settings::Settings;
use nalgebra::Vector2;
use serde_json::Value;
use spmfile::{LineDirection, read};

use crate::common::{analyze, caveats, json, results, succeed, testdata};

/// The lattice of each line direction of a channel, nm, all with the same names.
fn lattices(file: &Path, channel: &str) -> Vec<(LineDirection, Lattice)> {
    let settings = Settings {
        channel: Some(channel.to_owned()),
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    };
    let bytes = std::fs::read(file).expect("a file");
    let scan = read(&bytes).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let measured = measure_scan("scan", &scan, &settings, None);
    let measured = measured.unwrap_or_else(|e| panic!("{} {channel}: {e}", file.display()));
    let analysis = analyse(vec![measured], &settings);
    let lines = &analysis.sets[0].scans[0].lines;
    lines.iter().map(|l| (l.line, l.sensor)).collect()
}

/// The record of a file.
fn record(file: &Path) -> Value {
    json(Path::new(&format!("{}.truth.json", file.display())))
}

/// Lengths (nm) and directions (degrees) of the vectors in a record.
fn recorded(fit: &Value) -> Vec<[f64; 2]> {
    let list = |name: &str| -> Vec<f64> {
        let numbers = fit[name].as_array().expect("a list").iter();
        numbers.filter_map(Value::as_f64).collect()
    };
    let lengths = list("lengths").into_iter();
    lengths
        .zip(list("angles_deg"))
        .map(|(l, a)| [l, a])
        .collect()
}

/// Every vector of the record is one of the lattice, within the tolerance for lengths (nm) and directions (degrees).
fn agrees(lattice: &Lattice, recorded: &[[f64; 2]], tolerance: [f64; 2]) {
    for [length, angle] in recorded {
        let found = (0..3).any(|i| {
            let off = lattice.polar_angle(i).value.to_degrees() - angle;
            let off = (off + 90.0).rem_euclid(180.0) - 90.0;
            (lattice.wavelength(i).value - length).abs() < tolerance[0] && off.abs() < tolerance[1]
        });
        assert!(found, "{length} nm at {angle}°: {:?}", lattice.basis);
    }
}

/// χ² of the difference of trace and retrace, four degrees of freedom: 18.5 once in a thousand.
fn forward_and_backward_agree(lines: &[(LineDirection, Lattice)]) {
    let [(_, a), (_, b)] = lines else {
        panic!("expected trace and retrace, found {}", lines.len());
    };
    let difference = a.flat() - b.flat();
    let weight = (a.covariance + b.covariance).try_inverse().expect("errors");
    let chi_squared = difference.dot(&(weight * difference));
    assert!(
        chi_squared < 18.5,
        "{chi_squared}: {:?} {:?}",
        a.basis,
        b.basis
    );
}

/// Si(111)-7×7: the first shell is weaker than the noise, and mains pick-up makes a grid of its own.
#[test]
fn silicon_seven_by_seven() {
    let Some(data) = testdata("silicon_seven_by_seven") else {
        return;
    };
    let file = data.join("real/nanonis/si111_7x7_20nm.sxm");
    let record = record(&file);
    for channel in ["Z", "Current"] {
        let lines = lattices(&file, channel);
        forward_and_backward_agree(&lines);
        let fits = record["lattice"]["measured"]["fits"]
            .as_array()
            .expect("fits");
        for fit in fits {
            for (_, lattice) in &lines {
                agrees(lattice, &recorded(fit), [0.03, 0.5]);
            }
        }
    }
}

/// A moiré of 2.5 periods across the frame.
#[test]
fn nanomesh() {
    let Some(data) = testdata("nanomesh") else {
        return;
    };
    let file = data.join("real/nanonis/moire_nanomesh_10nm.sxm");
    let measured = record(&file)["lattice"]["measured"].clone();
    for channel in ["Z", "Current"] {
        let lines = lattices(&file, channel);
        forward_and_backward_agree(&lines);
        for order in ["first_order", "second_order"] {
            for fit in measured[order].as_array().expect("fits") {
                for (_, lattice) in &lines {
                    agrees(lattice, &recorded(fit), [0.06, 1.0]);
                }
            }
        }
    }
}

/// Where near `k` (cycles per nm) the Hann-windowed power of an image is largest: rows are lines of pixels
/// `pitch` nm apart, from the bottom up.
fn strongest_near(rows: &[Vec<f64>], pitch: f64, mut k: Vector2<f64>) -> Vector2<f64> {
    let turns = |n: usize, k: f64| -> Vec<(f64, f64)> {
        let angles = (0..n).map(|i| std::f64::consts::TAU * k * pitch * i as f64);
        angles.map(f64::sin_cos).collect()
    };
    let power = |k: Vector2<f64>| -> f64 {
        let (along, up) = (turns(rows[0].len(), k.x), turns(rows.len(), k.y));
        let (mut re, mut im) = (0.0, 0.0);
        for (row, (sin, cos)) in rows.iter().zip(up) {
            let (mut a, mut b) = (0.0, 0.0);
            for (value, (sin, cos)) in row.iter().zip(&along) {
                a += value * cos;
                b += value * sin;
            }
            re += a * cos - b * sin;
            im += a * sin + b * cos;
        }
        re * re + im * im
    };
    let mut best = power(k);
    let mut step = 0.02;
    while step > 1e-4 {
        let around = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
        let tried = around.map(|(x, y)| k + step * Vector2::new(x, y));
        let powers = tried.map(power);
        let first = (0..4).max_by(|&a, &b| powers[a].total_cmp(&powers[b]));
        match first {
            Some(i) if powers[i] > best => (k, best) = (tried[i], powers[i]),
            _ => step /= 2.0,
        }
    }
    k
}

/// The atoms of graphite beside a step, on a drifting scanner. The record has two wave vectors as they are published
/// (read off by eye, to 0.005/Å) and as the maximum of the windowed power gives them. The third one, the strongest of all,
/// is not their difference but three times the record's tolerance (0.001/Å) away from it, and without the window the first
/// moves by twice that: the image bends, and no lattice has all of them. Ours says so, and has errors to match.
#[test]
fn graphite() {
    let Some(data) = testdata("graphite") else {
        return;
    };
    let file = data.join("real/iso28632/graphite_terrace_11nm.spm");
    let record = record(&file);
    let lines = lattices(&file, "Z");
    let [(_, lattice)] = lines.as_slice() else {
        panic!("one image, found {}", lines.len());
    };
    let dual = lattice.basis.try_inverse().expect("an area").transpose();
    let (k1, k2) = (dual.column(0).into_owned(), dual.column(1).into_owned());
    let ours = [k1, k2, k1 + k2].map(|k| [k, -k]).concat();
    let off = |wanted: Vector2<f64>| -> f64 {
        let all = ours.iter().map(|k| (k - wanted).amax());
        all.fold(f64::INFINITY, f64::min)
    };
    // 1/Å in the record.
    let vectors = |of: &str| -> [Vector2<f64>; 2] {
        let list = &record["lattice"][of]["K"];
        let part = |k: &Value, i: usize| 10.0 * k[i].as_f64().expect("a number");
        [0, 1].map(|k| Vector2::new(part(&list[k], 0), part(&list[k], 1)))
    };
    for wanted in vectors("published") {
        assert!(off(wanted) < 0.05, "{wanted:?}: {} 1/nm", off(wanted));
    }

    let scan = read(&std::fs::read(&file).expect("a file")).expect("an image");
    let image = &scan.channels[0];
    let (columns, rows) = (image.columns, image.rows);
    let values = image.values();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let hann = |i: usize, n: usize| {
        (std::f64::consts::PI * i as f64 / (n - 1) as f64)
            .sin()
            .powi(2)
    };
    let weighted = |weight: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
        let lines = values.chunks_exact(columns).enumerate();
        let line = |(r, line): (usize, &[f64])| {
            let pixels = line.iter().enumerate();
            pixels.map(|(c, v)| (v - mean) * weight(c, r)).collect()
        };
        lines.map(line).collect()
    };
    let windowed = weighted(&|c, r| hann(c, columns) * hann(r, rows));
    let plain = weighted(&|_, _| 1.0);
    let pitch = image.pitch_nm().expect("a size")[0];
    let [first, second] = vectors("measured");
    let peaks = [first, second, first - second].map(|k| strongest_near(&windowed, pitch, k));
    for (peak, recorded) in peaks.iter().zip([first, second]) {
        assert!((peak - recorded).amax() < 0.01, "{peak} {recorded}");
    }
    let moved = (strongest_near(&plain, pitch, first) - peaks[0]).amax();
    assert!(moved > 0.02, "a window moves it by {moved} 1/nm only");
    let misfit = (peaks[0] - peaks[1] - peaks[2]).amax();
    assert!(misfit > 0.03, "they close to {misfit} 1/nm");
    let errors = [0, 1, 2].map(|i| lattice.wavelength(i).sigma / lattice.wavelength(i).value);
    let relative = errors.into_iter().fold(0.0, f64::max);
    for peak in peaks {
        let allowed = 4.0 * relative * peak.norm();
        assert!(off(peak) < allowed, "{peak}: {} of {allowed}", off(peak));
    }
}

/// The atoms in a frame of 1 nm: no record of the lattice, but trace and retrace see the same.
#[test]
fn atoms_by_rhk() {
    let Some(data) = testdata("atoms_by_rhk") else {
        return;
    };
    let lines = lattices(&data.join("real/rhk/rhk_atomic_1nm.sm4"), "Topography");
    forward_and_backward_agree(&lines);
    for (_, lattice) in &lines {
        for i in 0..3 {
            let length = lattice.wavelength(i).value;
            assert!((0.22..0.27).contains(&length), "{length} nm");
        }
    }
}

/// What the user is told without a word from him: the channel that shows a lattice, and no twist of
/// a lattice that is no moiré.
#[test]
fn lattices_of_atoms_have_no_twist() {
    let Some(data) = testdata("lattices_of_atoms_have_no_twist") else {
        return;
    };
    let work = tempfile::tempdir().expect("a folder");
    let run = |name: &str| {
        let out = work.path().join(name.replace('/', "-"));
        let run = succeed(&mut analyze(&data.join("real").join(name), &out));
        (run.stdout, results(&out))
    };
    let rhk = "rhk/rhk_atomic_1nm.sm4";
    for (name, channel, direction) in [
        (
            "iso28632/graphite_terrace_11nm.spm",
            "Z (Forward)",
            "direction unknown",
        ),
        (rhk, "Topography", "0 up, 1 down"),
    ] {
        let (said, found) = run(name);
        let set = &found["sets"][0];
        assert_eq!(set["channel"], channel);
        assert!(said.contains(direction), "{said}");
        assert!(caveats(&found).contains(&"no-moire"), "{said}");
        // Topography was not the first choice.
        let chosen = caveats(&found).contains(&"channel-chosen");
        assert_eq!(chosen, name == rhk, "{said}");
        assert!(
            set["mean"].is_null() && set["uncorrected"].is_null(),
            "{set}"
        );
        assert!(!said.contains("  twist"), "{said}");
        assert!(said.contains("  lattice       0.2"), "{said}");
        let scan = &set["scans"][0];
        assert!(scan["twist_strain"]["sensor"].is_null(), "{scan}");
    }
    let (said, si) = run("nanonis/si111_7x7_20nm.sxm");
    assert!(caveats(&si).contains(&"large-strain"), "{said}");
    let (said, moire) = run("nanonis/moire_nanomesh_10nm.sxm");
    for code in ["large-strain", "no-moire", "channel-chosen"] {
        assert!(!caveats(&moire).contains(&code), "{said}");
    }
}
