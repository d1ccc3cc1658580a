//! Lattices whose first shell is hidden, waves of pick-up, and harmonics that do not agree.

use crate::fit_scene::{Contrast, Scene, Wave};
use heterostrain::lattice::labelled_like;
use moiregauge::frame::Background;
use moiregauge::frame::Image;
use moiregauge::lattice::{MeasuredLattice, measure};
use moiregauge::settings::Lines;
use moiregauge::simulate::{SampleFeature, Simulation, Simulator, vary};
use moiregauge::spectrum::Method;
use moiregauge::{Settings, analyse, measure_scan};
use nalgebra::{Matrix2, Vector2};

fn fit(image: &Image, scene: &Scene) -> MeasuredLattice {
    measure(image, &scene.geometry(), Background::Plane, Method::Lattice).unwrap()
}

/// Errors of the four components over their stated errors, decorrelated: χ² with four degrees of freedom.
fn chi_squared(scene: &Scene, measured: &MeasuredLattice) -> f64 {
    let (_, change) = scene.change(&measured.pixels.basis);
    let covariance = change * measured.pixels.covariance * change.transpose();
    let error = scene.error(&measured.pixels.basis);
    error.dot(&(covariance.try_inverse().unwrap() * error))
}

/// Four square frames of a sample whose numbers are drawn, and its twist in degrees.
fn varied(sample: &str, pixels: usize, seed: u64) -> (Simulator, f64) {
    let mut set = Simulation {
        features: SampleFeature::parse(sample).unwrap(),
        ..Simulation::default()
    };
    set.raster.pixels = [pixels, pixels];
    set.raster.scans = 4;
    vary(&mut set, seed);
    let twist = set.sample.twist_deg;
    (Simulator::new(set).unwrap(), twist)
}

/// Without draws, which take time and change no result.
fn undrawn() -> Settings {
    Settings {
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    }
}

/// A cell with many atoms: as in Si(111)-7×7, the waves of the shells 7, 9 and 13 are strong and those below 7
/// are lost in noise.
fn many_atoms(seed: u64) -> Scene {
    let angle = 0.618 * seed as f64;
    let mut scene = Scene::new([192, 192], 6.5, angle, Contrast::Cosines, seed);
    let pair = scene.pair();
    scene.waves.clear();
    for (h, k) in (-4..=4).flat_map(|h| (-4..=4).map(move |k| (h, k))) {
        let order = h * h - h * k + k * k;
        let amplitude = match order {
            1 | 3 | 4 => 0.01,
            7 | 9 | 13 => 0.3,
            _ => 0.0,
        };
        if amplitude > 0.0 && (k > 0 || (k == 0 && h > 0)) {
            scene.waves.push(Wave {
                q: pair * Vector2::new(f64::from(h), f64::from(k)),
                amplitude,
                phase: f64::from(7 * h + 3 * k),
            });
        }
    }
    scene.white = 1.0;
    scene
}

/// A strong second shell, whose first shell has waves of this amplitude in noise of 1.
fn second_shell(first: f64, seed: u64) -> Scene {
    let mut scene = Scene::new(
        [192, 192],
        8.0,
        0.618 * seed as f64,
        Contrast::Cosines,
        seed,
    );
    let pair = scene.pair();
    scene.waves.clear();
    for (h, k) in [(1, 0), (0, 1), (1, 1), (2, 1), (1, 2), (1, -1)] {
        let strong = h * h - h * k + k * k == 3;
        scene.waves.push(Wave {
            q: pair * Vector2::new(f64::from(h), f64::from(k)),
            amplitude: if strong { 0.5 } else { first },
            phase: f64::from(7 * h + 3 * k),
        });
    }
    scene.white = 1.0;
    scene
}

/// Waves in time are multiples of one wave in the image, folded back at the line rate: a grid of peaks in the
/// spectrum. Amplitude a third of the lattice's, as strong against the noise around it.
fn with_pick_up(mut scene: Scene) -> Scene {
    let base = Vector2::new(0.71, 0.513 * std::f64::consts::TAU);
    for order in 1..=4 {
        let mut q = base * f64::from(order);
        q.y -= (q.y / std::f64::consts::TAU).round() * std::f64::consts::TAU;
        scene.waves.push(Wave {
            q,
            amplitude: 0.1,
            phase: f64::from(order),
        });
    }
    scene
}

/// The lattice of the high orders is found, with pick-up and without, and its errors are as stated.
#[test]
fn high_orders_make_the_lattice() {
    let mut sum = 0.0;
    for seed in 0..12 {
        for scene in [many_atoms(seed), with_pick_up(many_atoms(seed))] {
            let measured = fit(&scene.image(), &scene);
            let error = scene.error(&measured.pixels.basis).norm();
            assert!(error < 1e-2 * scene.basis.norm(), "seed {seed}: {error}");
            sum += chi_squared(&scene, &measured);
        }
    }
    // 24 times four degrees of freedom, not quite independent: 96 with a standard deviation of 20.
    assert!((36.0..156.0).contains(&sum), "{sum}");
}

/// Waves of the first shell that no search among all waves would find (26 times the noise; 24 can be chance) make the lattice together,
/// and where there are none the lattice is that of the waves there are.
#[test]
fn a_first_shell_that_hides_makes_the_lattice() {
    let mut sum = 0.0;
    for seed in 0..24 {
        let scene = second_shell(0.08, seed);
        let measured = fit(&scene.image(), &scene);
        let error = scene.error(&measured.pixels.basis).norm();
        assert!(error < 1e-2 * scene.basis.norm(), "seed {seed}: {error}");
        sum += chi_squared(&scene, &measured);
        let scene = second_shell(0.0, seed);
        let alone = fit(&scene.image(), &scene).pixels.basis.determinant();
        let cells = scene.basis.determinant() / alone;
        assert!((cells.abs() - 3.0).abs() < 0.02, "seed {seed}: {cells}");
    }
    // 24 times four degrees of freedom: 96 with a standard deviation of 14.
    assert!((54.0..138.0).contains(&sum), "{sum}");
}

/// Images of one lattice say so: χ² of the closure is what it should be, and no error is enlarged.
#[test]
fn harmonics_of_one_lattice_agree() {
    let (mut sum, mut freedom) = (0.0, 0);
    for seed in 0..60 {
        let angle = 0.618 * seed as f64;
        let periods = [4.0, 6.0, 9.0][seed as usize % 3];
        let mut scene = Scene::new([96, 96], periods, angle, Contrast::Spots, seed);
        (scene.white, scene.line) = (0.7, 0.2);
        let closure = fit(&scene.image(), &scene).fit.unwrap().closure.unwrap();
        assert_eq!(closure.enlargement(), 1.0, "seed {seed}: {closure:?}");
        sum += closure.chi_squared;
        freedom += closure.degrees_of_freedom;
    }
    // The noise around harmonics is known to some ten per cent only.
    let reduced = sum / f64::from(freedom as u32);
    assert!((0.8..1.25).contains(&reduced), "{reduced} for {freedom}");
}

/// Three waves that do not add up to zero by 0.4 cycles over the frame, each known to 0.03: no lattice is right for
/// all of them, and the errors are enlarged to say so. The lattice of the first two, which are right, is
/// then within them.
#[test]
fn harmonics_that_make_no_lattice_enlarge_the_errors() {
    for seed in 0..8 {
        let angle = 0.618 * seed as f64;
        let mut scene = Scene::new([160, 160], 10.0, angle, Contrast::Cosines, seed);
        // Amplitude over noise in one resolution cell: 160/(2 · 6) = 13. Phase zero in the middle.
        scene.white = 6.0;
        for wave in &mut scene.waves {
            wave.phase = -wave.q.dot(&Vector2::repeat(79.5));
        }
        let whole = fit(&scene.image(), &scene);
        let closure = whole.fit.unwrap().closure.unwrap();
        assert_eq!(closure.enlargement(), 1.0, "seed {seed}: {closure:?}");
        let change = 0.4 * std::f64::consts::TAU / 160.0;
        scene.waves[2].q.x += change;
        scene.waves[2].phase -= 79.5 * change;
        let measured = fit(&scene.image(), &scene);
        let closure = measured.fit.as_ref().unwrap().closure.unwrap();
        assert!(closure.enlargement() > 5.0, "seed {seed}: {closure:?}");
        let chi_squared = chi_squared(&scene, &measured);
        // Four degrees of freedom: once in ten thousand, and χ² of the closure is uncertain itself.
        assert!(chi_squared < 24.0, "seed {seed}: {chi_squared}");
    }
}

/// Sets whose stripes are as strong as the lattice and two or three cycles of the frame from one of its waves, or make a larger
/// cell with it: read as parts, grains and other lattices they were 0.03 to 0.66 degrees off, by 15 to 88 of their errors.
#[test]
fn strong_stripes_make_no_lattice() {
    for seed in [1075, 1086, 1090] {
        let (simulator, truth) = varied("stripes", 192, seed);
        let settings = undrawn();
        let measured = (0..simulator.frames()).filter_map(|i| {
            measure_scan(
                &Simulator::file_name(i),
                &simulator.frame(i),
                &settings,
                None,
            )
            .ok()
        });
        let analysis = analyse(measured.collect(), &settings);
        for set in &analysis.sets {
            let Some(mean) = &set.mean else { continue };
            let (twist, sigma) = (mean.twist().value, mean.twist().statistical);
            let off = twist.to_degrees() - truth;
            assert!(off.abs() < 5.0 * sigma.to_degrees(), "{seed}: {off}");
            assert!(off.abs() < 0.001, "{seed}: {off}");
        }
        let answered = analysis.sets.iter().any(|set| set.mean.is_some());
        assert!(answered || seed == 1086, "{seed}");
    }
}

/// First-order waves of a fiftieth of the second order predict in some images and not in others: the images of a set decide together which cell it is.
/// Where none shows the larger one, a caveat names it.
#[test]
fn images_of_a_set_agree_on_a_first_shell() {
    let (mut split, mut right) = (0, 0);
    for seed in [1, 3, 5, 6] {
        let (simulator, truth) = varied("second-shell:first=0.02", 160, seed);
        let settings = undrawn();
        let scan = |i| {
            let (name, scan) = (Simulator::file_name(i), simulator.frame(i));
            measure_scan(&name, &scan, &settings, None).unwrap()
        };
        let measured: Vec<_> = (0..simulator.frames()).map(scan).collect();
        let lines = measured.iter().flat_map(|scan| &scan.lines);
        let cells = lines.map(|line| line.in_sensor_coordinates().basis.determinant().abs());
        let [least, most] = cells.fold([f64::INFINITY, 0.0], |[a, b], c| [c.min(a), c.max(b)]);
        split += usize::from(most > 2.0 * least);
        let analysis = analyse(measured, &settings);
        assert_eq!(analysis.sets.len(), 1, "{seed}");
        let twist = analysis.sets[0].mean.as_ref().unwrap().twist();
        let off = (twist.value.to_degrees() - truth).abs();
        // The harmonic shell is off by a factor of √3.
        if off < 0.01 * truth {
            assert!(off < 5.0 * twist.statistical.to_degrees(), "{seed}: {off}");
            right += 1;
        } else {
            let mut codes = analysis.caveats.iter().map(moiregauge::Caveat::code);
            assert!(codes.any(|code| code == "other-lattice"), "{seed}: {off}");
        }
    }
    // Otherwise nothing was decided together.
    assert!(split >= 2 && right >= 2, "{split}, {right}");
}

/// Trace and retrace of a frame show different cells. A copy of it under another name tells nothing new: neither the frame alone nor the frame and
/// its copy have a mean, and the copy is named once.
#[test]
fn a_copy_of_a_frame_whose_lines_disagree_counts_once() {
    let (simulator, _) = varied("second-shell+edge", 192, 10);
    let settings = undrawn();
    let scan = simulator.frame(0);
    let of = |name: &str| measure_scan(name, &scan, &settings, None).unwrap();
    for copies in [0, 1] {
        let mut measured = vec![of("one.spm")];
        measured.extend((0..copies).map(|_| of("two.spm")));
        let analysis = analyse(measured, &settings);
        assert!(analysis.sets.iter().all(|set| set.mean.is_none()));
        let count = |code: &str| {
            let codes = analysis.caveats.iter().map(moiregauge::Caveat::code);
            codes.filter(|found| *found == code).count()
        };
        assert_eq!(count("same-scan-twice"), copies);
        assert_eq!(count("shell-for-lattice"), 1, "{copies}");
    }
}

/// Two samples of which one has the points of the other, with a third of its cell: no image of the smaller one has a first shell of the other, and
/// which is meant nobody knows.
#[test]
fn lattices_that_hold_each_other_are_no_result() {
    let large = Simulation::default().sample;
    let half = |twist: f64| twist.to_radians() / 2.0;
    let twist = 2.0
        * (3f64.sqrt() * half(large.twist_deg).sin())
            .asin()
            .to_degrees();
    let mut measured = Vec::new();
    for (first, twist) in [(0, large.twist_deg), (2, twist)] {
        let mut set = Simulation::default();
        set.raster.pixels = [128, 128];
        set.raster.scans = 4;
        set.sample.strain_percent = 0.0;
        set.sample.twist_deg = twist;
        // Turned by 30°, as the second shell is.
        let turn = if first == 0 { 0.0 } else { 30.0 };
        set.sample.lattice_angle_deg += turn + (large.twist_deg - twist) / 2.0;
        let simulator = Simulator::new(set).unwrap();
        for i in first..first + 2 {
            let (name, scan) = (Simulator::file_name(i), simulator.frame(i));
            measured.push(measure_scan(&name, &scan, &Settings::default(), None).unwrap());
        }
    }
    let analysis = analyse(measured, &Settings::default());
    let codes: Vec<_> = analysis
        .caveats
        .iter()
        .map(moiregauge::Caveat::code)
        .collect();
    assert!(codes.contains(&"shell-for-lattice"), "{codes:?}");
    let means = analysis.sets.iter().map(|set| &set.mean);
    assert!(means.into_iter().all(Option::is_none) && analysis.combined.is_none());
}

/// The strongest waves of a frame may be those of two grains: no part of it has them together, and each grain has a lattice of its own.
#[test]
fn waves_of_two_grains_make_no_lattice() {
    let mut set = Simulation {
        features: SampleFeature::parse("grains").unwrap(),
        ..Simulation::default()
    };
    vary(&mut set, 1003);
    set.raster.pixels = [768, 768];
    set.raster.nominal_size_nm = [250.0, 250.0];
    let simulator = Simulator::new(set).unwrap();
    let settings = Settings {
        line: Lines::Trace,
        ..Settings::default()
    };
    let largest = measure_scan("down", &simulator.frame(1), &settings, None).unwrap();
    let truth = simulator.truth().sample.unwrap().grains;
    assert_eq!(largest.grains.len() + 1, truth.len());
    let found = std::iter::once(&largest).chain(&largest.grains);
    // Drift changes vectors by a thousandth; those of the grains differ by forty.
    for (grain, truth) in found.zip(&truth) {
        let [a, b, _] = truth.lattice_vectors_nm.map(Vector2::from);
        let truth = Matrix2::from_columns(&[a, b]);
        let found = labelled_like(&grain.lines[0].in_sensor_coordinates(), &truth).basis;
        assert!(
            (found - truth).norm() < 0.005 * truth.norm(),
            "{found} {truth}"
        );
    }
}

/// Eight holes in a moiré of nine periods make a lattice of two and a half of their own, which changes by as much as itself across the frame.
#[test]
fn holes_make_no_lattice_of_few_periods() {
    let (simulator, _) = varied("hole:count=8", 192, 78);
    let truth = simulator.truth().sample.unwrap().grains[0].lattice_vectors_nm;
    let wanted = truth.map(|v| Vector2::from(v).norm());
    for i in 0..simulator.frames() {
        let name = Simulator::file_name(i);
        let Ok(scan) = measure_scan(&name, &simulator.frame(i), &Settings::default(), None) else {
            continue;
        };
        let found = scan.lines[0].in_sensor_coordinates();
        for wavelength in [0, 1, 2].map(|k| found.vector(k).norm()) {
            assert!(
                wanted.iter().any(|w| (wavelength / w - 1.0).abs() < 0.02),
                "{name}: {wavelength} nm, {wanted:?}"
            );
        }
    }
}
