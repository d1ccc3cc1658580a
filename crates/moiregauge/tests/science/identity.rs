//! Each frame counts once, like goes with like, and headers that contradict the images are named.

use std::cell::Cell;

use heterostrain::material::Material;
use moiregauge::calibration::KnownLattice;
use moiregauge::campaign::{
    Analysis, SetAnalysis, analyse, atomic_orientation, calibrate, refusal,
};
use moiregauge::caveat::Caveat;
use moiregauge::scan::{MeasuredScan, measure_known, measure_scan};
use moiregauge::settings::{GivenDrift, Grouping, Settings};
use moiregauge::simulate::{FirstDirection, Simulation, Simulator};
use spmfile::{FrameDirection, Samples, Scan, sensor_axis};

use crate::draws::draws;

/// A small, quick set.
fn small_set(seed: u64) -> Simulation {
    let mut simulation = Simulation {
        seed,
        ..Simulation::default()
    };
    simulation.raster.pixels = [96, 96];
    simulation.raster.scans = 4;
    simulation
}

fn frames(simulation: &Simulation) -> Vec<Scan> {
    let simulator = Simulator::new(simulation.clone()).unwrap();
    (0..simulator.frames())
        .map(|i| simulator.frame(i))
        .collect()
}

fn quick() -> Settings {
    Settings {
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    }
}

fn measured(folder: &str, frames: &[Scan]) -> Vec<MeasuredScan> {
    let settings = quick();
    let named = frames.iter().enumerate();
    named
        .map(|(i, scan)| {
            let name = format!("{folder}/scan.{i:03}");
            measure_scan(&name, scan, &settings, None).unwrap()
        })
        .collect()
}

fn count(analysis: &Analysis, code: &str) -> usize {
    analysis.caveats.iter().filter(|c| c.code() == code).count()
}

/// The numbers that people take from a set.
fn numbers(set: &SetAnalysis) -> Vec<f64> {
    let (mean, drift) = (set.mean.as_ref().unwrap(), set.drift.as_ref().unwrap());
    let found = &mean.twist_strain;
    let values = [found.twist().value, found.twist().sigma];
    let strain = [found.heterostrain().value, found.heterostrain().sigma];
    let drift = [drift.velocity.x, drift.velocity.y, drift.covariance.m11];
    values.into_iter().chain(strain).chain(drift).collect()
}

/// The same frame as another program would write it: other units, single precision, no position sensors, and on demand
/// nothing but the pixels.
fn converted(scan: &Scan, bare: bool) -> Scan {
    let mut out = scan.clone();
    out.channels.retain(|c| !c.name.contains("Sensor"));
    for channel in &mut out.channels {
        let values = channel.values();
        channel.samples = Samples::F32(values.iter().map(|v| (v * 1e-9 + 3e-8) as f32).collect());
        (channel.scale, channel.offset) = (1.0, 0.0);
    }
    if bare {
        (out.acquired, out.frame_direction, out.line_rate_hz) = (None, None, None);
    }
    out
}

/// Copies under other names, in other formats and without their headers change no number and are named.
#[test]
fn the_same_data_count_once() {
    let scans = frames(&small_set(3));
    let once = analyse(measured("s", &scans), &quick());
    let expected = numbers(&once.sets[0]);
    let digests = |mut scans: Vec<MeasuredScan>| {
        for (i, scan) in scans.iter_mut().enumerate() {
            scan.digest = Some(i.to_string());
        }
        scans
    };
    let as_files: Vec<Scan> = scans.iter().map(|s| converted(s, false)).collect();
    let as_arrays: Vec<Scan> = scans.iter().map(|s| converted(s, true)).collect();
    for copies in [&scans, &as_files, &as_arrays] {
        // Copies come before or after the scans that tell more.
        for place in ["a", "t"] {
            let mut all = digests(measured("s", &scans));
            all.extend(measured(place, copies));
            let found = analyse(all, &quick());
            assert_eq!(found.sets.len(), 1);
            assert_eq!(numbers(&found.sets[0]), expected);
            assert_eq!(count(&found, "same-scan-twice"), 4);
            let left_out: Vec<&str> = found.sets[0]
                .scans
                .iter()
                .filter_map(|s| s.excluded.as_deref())
                .collect();
            assert_eq!(found.sets[0].scans.len(), 8);
            let named = |words: &&str| words.starts_with("it repeats s/scan.") || place == "a";
            assert!(
                left_out.len() == 4 && left_out.iter().all(named),
                "{left_out:?}"
            );
        }
    }
}

/// Frames of a sample are never taken for one, not even where nothing moves and nothing is noisy and only dates and
/// directions differ; a noisy frame with another date is still the same frame.
#[test]
fn two_frames_are_two() {
    let mut still = small_set(1);
    still.drift.velocity_nm_per_min = [0.0; 2];
    let noisy = frames(&still);
    still.noise = moiregauge::simulate::Noise {
        sensor_nm: 0.0,
        pixel_deg: 0.0,
        line_deg: 0.0,
        flicker_deg: 0.0,
        clock_s: 0.0,
        plane_deg: [0.0; 2],
    };
    for scans in [frames(&still), noisy.clone()] {
        let found = analyse(measured("s", &scans), &quick());
        assert_eq!(count(&found, "same-scan-twice"), 0);
    }
    let mut again = noisy.clone();
    for scan in &mut again {
        scan.acquired.as_mut().unwrap().year += 1;
    }
    let mut all = measured("s", &noisy);
    all.extend(measured("t", &again));
    let found = analyse(all, &quick());
    assert_eq!(count(&found, "same-scan-twice"), 4);
    assert_eq!(
        numbers(&found.sets[0]),
        numbers(&analyse(measured("s", &noisy), &quick()).sets[0])
    );
}

/// The same for images of known lattices and of atoms, whose errors shrink as easily.
#[test]
fn calibration_and_orientation_count_once() {
    let mut set = small_set(5);
    set.sample.twist_deg = 60.0;
    set.sample.strain_percent = 0.0;
    set.sample.sharpness = 0.1;
    set.raster.scans = 2;
    set.raster.nominal_size_nm = [4.0; 2];
    let known = KnownLattice::hexagonal("graphene", 0.246, 0.0, "the simulator");
    let cell = known.cell().unwrap();
    let measure = |folder: &str| -> Vec<MeasuredScan> {
        let scans = frames(&set).into_iter().enumerate();
        scans
            .map(|(i, scan)| {
                measure_known(&format!("{folder}/{i}"), &scan, &quick(), &cell).unwrap()
            })
            .collect()
    };
    let (once, twice) = (measure("a"), [measure("a"), measure("b")].concat());
    let sigmas =
        |scans: &[MeasuredScan]| calibrate(scans.to_vec(), &known, 0.01, Grouping::Auto).unwrap();
    assert_eq!(sigmas(&once).statistical, sigmas(&twice).statistical);
    let repeats = |codes: &[Caveat]| {
        codes
            .iter()
            .filter(|c| c.code() == "same-scan-twice")
            .count()
    };
    assert_eq!(repeats(&sigmas(&twice).caveats), 2);
    let angle = |scans: &[MeasuredScan]| {
        let calibration = &quick().calibration;
        atomic_orientation(scans, &Material::graphene(), 1, calibration).unwrap()
    };
    assert_eq!(angle(&once).angle, angle(&twice).angle);
    assert_eq!(repeats(&angle(&twice).caveats), 2);
}

/// Positions of the sensors times a factor for each frame.
fn stretched(frames: &[Scan], factor: impl Fn(usize) -> f64) -> Vec<Scan> {
    let mut all = frames.to_vec();
    for (i, scan) in all.iter_mut().enumerate() {
        for channel in &mut scan.channels {
            if sensor_axis(&channel.name, &channel.internal_name).is_some() {
                channel.scale *= factor(i);
                channel.offset *= factor(i);
            }
        }
    }
    all
}

/// Four frames of atoms, the scanner gains 0.8 % between the pairs up and down: no twist, but a lattice of all of them with their scatter and the
/// calibration in its total.
#[test]
fn atoms_have_a_lattice_of_all_scans() {
    let mut set = small_set(5);
    set.sample.twist_deg = 60.0;
    set.sample.strain_percent = 0.0;
    set.sample.sharpness = 0.1;
    set.raster.nominal_size_nm = [4.0; 2];
    set.drift.velocity_nm_per_min = [0.0; 2];
    let gain = |i: usize| if i < 2 { 1.0 } else { 1.008 };
    let scans = stretched(&frames(&set), gain);
    // A drift that changes would look like a gain that does.
    let still = Settings {
        drift: Some(GivenDrift {
            x_nm_per_min: 0.0,
            y_nm_per_min: 0.0,
            sigma_nm_per_min: 0.0,
        }),
        ..quick()
    };
    let found = analyse(measured("s", &scans), &still);
    let set = &found.sets[0];
    assert!(set.mean.is_none() && set.uncorrected.is_none());
    let lattice = set.lattice.as_ref().unwrap();
    for (i, length) in lattice.wavelengths.iter().enumerate() {
        let off = length.value / (0.246 * 1.004) - 1.0;
        assert!(off.abs() < 1e-3, "{length:?}");
        let scans = set.scans.iter();
        let scans = scans.map(|scan| scan.drift_corrected.unwrap().wavelength(i).value);
        let scans: Vec<f64> = scans.collect();
        let mean = scans.iter().sum::<f64>() / 4.0;
        let spread = scans.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / 3.0;
        assert!((lattice.scatter[i] / spread.sqrt() - 1.0).abs() < 1e-9);
        // The gains alone scatter by 0.46 %; the calibration of 1 % is in the total.
        assert!((0.003..0.006).contains(&(lattice.scatter[i] / 0.246)));
        let total = length.total / length.value;
        assert!((0.01..0.011).contains(&total), "{length:?}");
        assert!(length.statistical > 0.2 * lattice.scatter[i], "{length:?}");
    }
}

/// Four frames of atoms up and down by a scanner without sensors; those down are 1.5 % longer along the lines, or show what `change` makes of them.
fn creeping(change: &dyn Fn(&mut Simulation)) -> [Vec<Scan>; 2] {
    let mut set = small_set(5);
    set.sample.twist_deg = 60.0;
    set.sample.strain_percent = 0.0;
    set.sample.sharpness = 0.1;
    set.raster.nominal_size_nm = [4.0; 2];
    set.raster.sensors = false;
    set.window.gain = [1.0; 2];
    set.drift.velocity_nm_per_min = [0.3, -0.2];
    let up = frames(&set).into_iter().step_by(2).collect();
    change(&mut set);
    let down = frames(&set).into_iter().skip(1).step_by(2).collect();
    [up, down]
}

/// Creep makes no other sample of frames that their headers place on each other: they have one lattice, one drift and a scatter in per cent.
#[test]
fn creep_makes_no_samples() {
    let [up, down] = creeping(&|set| set.window.gain = [1.015, 1.0]);
    let found = analyse(measured("s", &[up, down].concat()), &quick());
    assert_eq!(count(&found, "samples-separated"), 0, "{:?}", found.caveats);
    let [set] = &found.sets[..] else {
        panic!("{} sets", found.sets.len());
    };
    let drift = set.drift.as_ref().expect("frames up and down tell it");
    for (i, truth) in [0.3, -0.2].into_iter().enumerate() {
        let sigma = 60.0 * drift.covariance[(i, i)].sqrt();
        let miss = 60.0 * drift.velocity[i] - truth;
        assert!(miss.abs() < 3.0 * sigma, "{i}: {miss} ± {sigma}");
    }
    let lattice = set.lattice.as_ref().expect("atoms");
    for length in &lattice.wavelengths {
        assert!(
            (length.value - 0.246).abs() < 2.0 * length.total,
            "{length:?}"
        );
    }
    let mut told = found.caveats.iter().filter(|c| c.code() == "scatter");
    let told = told.next().expect("they scatter").message();
    let per_cent = told
        .split("by up to ")
        .nth(1)
        .and_then(|s| s.split(' ').next());
    let per_cent: f64 = per_cent.expect("a share").parse().expect("a number");
    assert!((0.9..1.8).contains(&per_cent), "{told}");
}

/// As large a difference is another sample where headers do not tell that the place is the same, and a grain that is turned always is.
#[test]
fn what_is_no_creep_is_another_sample() {
    let longer = |set: &mut Simulation| set.window.gain = [1.015, 1.0];
    let sets = |all: Vec<MeasuredScan>| {
        let found = analyse(all, &quick());
        assert_eq!(count(&found, "samples-separated"), 1);
        found.sets.len()
    };
    let [up, down] = creeping(&longer);
    let folders = [measured("s/a", &up), measured("s/b", &down)].concat();
    assert_eq!(sets(folders), 2, "another folder");
    let with = |change: &dyn Fn(&mut Scan)| {
        let mut changed = down.clone();
        changed.iter_mut().for_each(change);
        measured("s", &[up.clone(), changed].concat())
    };
    assert_eq!(
        sets(with(&|scan| scan.offset_nm = [3.0, 0.0])),
        2,
        "another place"
    );
    assert_eq!(sets(with(&|scan| scan.acquired = None)), 2, "no date");
    let [up, turned] = creeping(&|set| set.sample.lattice_angle_deg += 3.0);
    assert_eq!(sets(measured("s", &[up, turned].concat())), 2, "a grain");
}

/// The length of atoms is known, that of a moiré is not: moirés that differ by as much are of other samples, wherever headers place them.
#[test]
fn moires_that_differ_are_other_samples() {
    let mut set = small_set(5);
    set.raster.sensors = false;
    let one = frames(&set);
    set.sample.twist_deg *= 1.02;
    let found = analyse(measured("s", &[one, frames(&set)].concat()), &quick());
    assert_eq!(count(&found, "samples-separated"), 1, "{:?}", found.caveats);
    assert_eq!(found.sets.len(), 2);
}

/// Two samples make two sets, whatever their vectors are called, and no number is the mean of both.
#[test]
fn two_samples_are_two_sets() {
    for (other, turned) in [(1.30, 0.0), (1.16, 0.0), (1.13, 7.0), (1.30, 41.0)] {
        let (first, mut second) = (small_set(11), small_set(12));
        second.sample.twist_deg = other;
        second.sample.lattice_angle_deg += turned;
        let mut all = measured("data/A/x", &frames(&first));
        all.extend(measured("data/B/x", &frames(&second)));
        let found = analyse(all, &quick());
        assert_eq!(count(&found, "samples-separated"), 1, "{other} {turned}");
        assert_eq!(found.sets.len(), 2);
        assert!(found.combined.is_none());
        let names: Vec<&str> = found.sets.iter().map(|s| s.name.as_str()).collect();
        assert!(
            names[0].ends_with(", A/x") && names[1].ends_with(", B/x"),
            "{names:?}"
        );
        for (set, truth) in found.sets.iter().zip([first.sample.twist_deg, other]) {
            let twist = set.mean.as_ref().unwrap().twist_strain.twist();
            let miss = twist.value.to_degrees() - truth;
            assert!(
                miss.abs() < 5.0 * twist.sigma.to_degrees(),
                "{truth} {miss}"
            );
        }
    }
}

/// Within one folder the periods tell samples apart.
#[test]
fn samples_of_one_folder_are_called_by_their_periods() {
    let (first, mut second) = (small_set(13), small_set(14));
    second.sample.twist_deg = 1.30;
    let mut scans = frames(&first);
    scans.extend(frames(&second));
    let found = analyse(measured("s", &scans), &quick());
    let names: Vec<&str> = found.sets.iter().map(|s| s.name.as_str()).collect();
    // 0.246/(2 sin θ/2) is 12.47 and 10.84 nm, a per cent or two changed by drift and strain.
    assert_eq!(names.len(), 2, "{names:?}");
    assert!(
        names.iter().any(|n| n.contains(", 12.")) && names.iter().any(|n| n.contains(", 10.")),
        "{names:?}"
    );
}

/// Drift changes frames by up to a quarter of their size, up and down in opposite senses, and they are one set still.
#[test]
fn drift_makes_no_samples() {
    for seed in 0..10 {
        let mut set = small_set(seed + 60);
        set.raster.pixels = [64, 64];
        let angle = seed as f64;
        let slow = 55.0 * set.raster.line_rate_hz / 64.0 * 60.0;
        let speed = 0.02 * slow * (angle + 1.0);
        set.drift.velocity_nm_per_min = [speed * angle.cos(), speed * angle.sin()];
        set.sample.lattice_angle_deg = 11.0 * angle;
        let found = analyse(measured("s", &frames(&set)), &quick());
        assert_eq!(found.sets.len(), 1, "{seed}");
        assert_eq!(count(&found, "samples-separated"), 0, "{seed}");
    }
}

/// Random sets with a drift of 0.4 to 1.6 nm/min, from four scans on.
fn drifting(seed: u64) -> Simulation {
    let mut set = small_set(seed + 700);
    let spread = |k: f64| (k * (seed as f64 + 0.5)).fract();
    set.raster.pixels = [96, 96];
    set.raster.scans = 4 + (seed % 4) as usize;
    set.raster.line_rate_hz = [2.0, 4.0][(seed % 2) as usize];
    set.raster.first_direction =
        [FirstDirection::Up, FirstDirection::Down][(seed / 2 % 2) as usize];
    set.sample.twist_deg = 1.0 + 0.4 * spread(0.618_034);
    set.sample.lattice_angle_deg = 60.0 * spread(0.414_214);
    let (speed, angle) = (0.4 + 1.2 * spread(0.732_051), 6.3 * spread(0.236_068));
    set.drift.velocity_nm_per_min = [speed * angle.cos(), speed * angle.sin()];
    set
}

fn turned_over(scan: &mut Scan) {
    scan.frame_direction = scan.frame_direction.map(|d| match d {
        FrameDirection::Up => FrameDirection::Down,
        FrameDirection::Down => FrameDirection::Up,
    });
}

/// Headers that tell all slow directions wrong, or another line rate, are found out in every set; good headers are not
/// blamed in any.
#[test]
fn headers_that_contradict_the_images_are_named() {
    let doubts = ["headers-contradict-images", "frames-do-not-link"];
    let told = Cell::new(0);
    let sets = draws(12);
    for seed in 0..sets.into() {
        let good = frames(&drifting(seed));
        let of = |change: &dyn Fn(&mut Scan)| {
            let mut scans = good.clone();
            scans.iter_mut().for_each(change);
            analyse(measured("s", &scans), &quick())
        };
        let with = |factor: f64| {
            move |scan: &mut Scan| scan.line_rate_hz = scan.line_rate_hz.map(|r| r * factor)
        };
        let right = of(&|_| ());
        for code in doubts.iter().chain(&["dates-contradict-line-rate"]) {
            assert_eq!(count(&right, code), 0, "{seed}: {:?}", right.caveats);
        }
        let blamed = |analysis: &Analysis, words: &str| {
            let all = analysis
                .caveats
                .iter()
                .filter(|c| doubts.contains(&c.code()));
            let all: Vec<String> = all.map(Caveat::message).collect();
            assert!(!all.is_empty(), "{seed}, {words}");
            let named = format!("but they do {words}");
            told.set(told.get() + usize::from(all.iter().any(|m| m.contains(&named))));
        };
        match seed % 3 {
            0 => blamed(
                &of(&turned_over),
                "with all slow directions the other way (up is down)",
            ),
            1 => {
                let doubled = of(&with(2.0));
                blamed(&doubled, "with half the line rate");
                assert_eq!(count(&doubled, "dates-contradict-line-rate"), 1, "{seed}");
            }
            _ => {
                let halved = of(&with(0.5));
                blamed(&halved, "with twice the line rate");
                assert_eq!(count(&halved, "dates-contradict-line-rate"), 1, "{seed}");
            }
        }
    }
    // The right entry in nearly all of them.
    assert!(10 * told.get() >= 9 * sets as usize, "{}", told.get());
}

/// Aligned layers make a moiré of `a₁a₂/|a₁ − a₂|`, the longest there is: a lattice half as long again is refused with
/// both numbers.
#[test]
fn layers_that_cannot_make_the_lattice_are_refused() {
    let named = |name: &str| Material::named(name).unwrap();
    let (upper, lower) = (named("MoS2"), named("WSe2"));
    let (a, b) = (upper.lattice_constant_nm, lower.lattice_constant_nm);
    let longest = a * b / (b - a).abs();
    let scans = measured("s", &frames(&small_set(21)));
    let with = |material: &Material, substrate: Option<&Material>| {
        let settings = Settings {
            material: material.clone(),
            substrate: substrate.cloned(),
            ..quick()
        };
        analyse(scans.clone(), &settings)
    };
    let found = with(&upper, Some(&lower));
    let why = refusal(&found).unwrap();
    assert_eq!(why.code(), "layers-cannot-make-it");
    assert!(
        why.message().contains(&format!("at most {longest:.1} nm")),
        "{}",
        why.message()
    );
    // 0.246/(2 sin θ/2) at 1.13°, with strain and drift some per cent more or less.
    let message = why.message();
    let measured = message
        .split(" nm")
        .next()
        .unwrap()
        .rsplit(' ')
        .next()
        .unwrap();
    let measured: f64 = measured.parse().unwrap();
    assert!((measured / 12.47 - 1.0).abs() < 0.05, "{measured}");
    assert!(refusal(&with(&Material::graphene(), None)).is_none());
    // 13.9 nm of graphene on hBN are enough.
    assert!(refusal(&with(&Material::graphene(), Some(&named("hBN")))).is_none());
}

/// A lattice with the period of a silicon surface is no moiré of layers that nobody named; who names them is believed.
#[test]
fn assumed_layers_are_asked_about() {
    let mut set = small_set(22);
    // λ = a/(2 sin θ/2) is 2.688 nm.
    set.sample.twist_deg = 2.0 * (0.246_f64 / (2.0 * 2.688)).asin().to_degrees();
    set.sample.strain_percent = 0.0;
    set.raster.nominal_size_nm = [15.0; 2];
    let scans = measured("s", &frames(&set));
    let assumed = analyse(scans.clone(), &quick());
    let asked: Vec<String> = assumed
        .caveats
        .iter()
        .filter(|c| c.code() == "moire-doubtful")
        .map(Caveat::message)
        .collect();
    assert!(
        asked.len() == 1 && asked[0].contains("si111-7x7") && asked[0].contains("assumed"),
        "{asked:?}"
    );
    let chosen = Settings {
        layers_chosen: true,
        ..quick()
    };
    assert_eq!(count(&analyse(scans, &chosen), "moire-doubtful"), 0);
    assert_eq!(
        count(
            &analyse(measured("s", &frames(&small_set(23))), &quick()),
            "moire-doubtful"
        ),
        0
    );
}

#[test]
fn excluding_everything_leaves_nothing() {
    let settings = Settings {
        exclude: vec!["*".to_owned()],
        ..quick()
    };
    let found = analyse(measured("s", &frames(&small_set(24))), &settings);
    let why = refusal(&found).unwrap();
    assert_eq!(why.code(), "everything-excluded");
    assert!(why.message().contains("all 4 scans"), "{}", why.message());
}
