//! Real images of known lattices, through the whole chain.

use std::path::Path;

use moiregauge::lattice::LatticeVectors;
use moiregauge::series::{analyse, measure_scan};
use moiregauge::settings::Settings;
use nalgebra::Vector2;
use serde_json::Value;
use spmfile::{LineDirection, read};

use crate::common::{analyze, caveats, json, results, succeed, testdata};

/// The lattice of each line direction of a channel, nm, all with the same names.
fn lattices(file: &Path, channel: &str) -> Vec<(LineDirection, LatticeVectors)> {
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
fn agrees(lattice: &LatticeVectors, recorded: &[[f64; 2]], tolerance: [f64; 2]) {
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
fn forward_and_backward_agree(lines: &[(LineDirection, LatticeVectors)]) {
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

/// The atoms of graphite beside a step, on a drifting scanner: the published wave vectors within their tolerance.
/// The lattice bends, so that its harmonics do not agree; the record's own, made of two of the three,
/// lie within four of our errors.
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
    let nearest = |wanted: Vector2<f64>| -> Vector2<f64> {
        let off = |k: &&Vector2<f64>| (*k - wanted).amax();
        let found = ours.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
        found.expect("six") - wanted
    };
    // 1/Å in the record.
    let vectors = |of: &str| -> Vec<Vector2<f64>> {
        let list = record["lattice"][of]["K"].as_array().expect("two vectors");
        let part = |k: &Value, i: usize| 10.0 * k[i].as_f64().expect("a number");
        list.iter()
            .map(|k| Vector2::new(part(k, 0), part(k, 1)))
            .collect()
    };
    for wanted in vectors("published") {
        let off = nearest(wanted);
        assert!(off.amax() < 0.05, "{wanted:?}: {off:?} 1/nm");
    }
    for wanted in vectors("measured") {
        let relative = lattice.wavelength(0).sigma / lattice.wavelength(0).value;
        let off = nearest(wanted).norm() / wanted.norm();
        assert!(
            off < 4.0 * relative,
            "{wanted:?}: {off} of it, ± {relative}"
        );
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
