//! The lattice fit against the truth, the Cramér–Rao bound, and everything that goes wrong in scans.

use crate::draws::{draws, mean_square};
use crate::fit_scene::{Contrast, Scene, Wave};
use moiregauge::frame::Background;
use moiregauge::frame::Image;
use moiregauge::lattice::{MeasuredLattice, WaveBeside, measure};
use moiregauge::spectrum::Method;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

fn fit(image: &Image, scene: &Scene) -> MeasuredLattice {
    measure(image, &scene.geometry(), Background::Plane, Method::Lattice).unwrap()
}

/// Covariance in the labelling of the scene.
fn covariance(scene: &Scene, measured: &MeasuredLattice) -> Matrix4<f64> {
    let (_, change) = scene.change(&measured.pixels.basis);
    change * measured.pixels.covariance * change.transpose()
}

/// Errors over stated errors, decorrelated.
fn pull(scene: &Scene, measured: &MeasuredLattice) -> Vector4<f64> {
    let factor = covariance(scene, measured).cholesky().unwrap();
    let error = scene.error(&measured.pixels.basis);
    factor.l().solve_lower_triangular(&error).unwrap()
}

/// What a number of images gives.
struct Statistics {
    /// Mean square error, summed over the components.
    square: f64,
    /// Standard deviation of the pulls about zero.
    pull: f64,
    /// Mean pull of each component.
    bias: Vector4<f64>,
    /// Standard deviation of error over stated error of the wave vectors along the fast and along the
    /// slow axis.
    axes: [f64; 2],
}

fn statistics(count: u64, scene: impl Fn(u64) -> Scene) -> Statistics {
    let mut pulls = Vec::new();
    let (mut square, mut axes) = (0.0, [0.0; 2]);
    for seed in 0..count {
        let scene = scene(seed);
        let measured = fit(&scene.image(), &scene);
        square += scene.error(&measured.pixels.basis).norm_squared() / count as f64;
        pulls.push(pull(&scene, &measured));
        let waves = scene.wave_pulls(&measured.pixels.basis, &measured.pixels.covariance);
        for i in 0..4 {
            axes[i % 2] += waves[i].powi(2);
        }
    }
    let n = count as f64;
    Statistics {
        square,
        pull: (pulls.iter().map(Vector4::norm_squared).sum::<f64>() / (4.0 * n)).sqrt(),
        bias: pulls.iter().sum::<Vector4<f64>>() / n,
        axes: axes.map(|sum| (sum / (2.0 * n)).sqrt()),
    }
}

/// Without noise the model is the image: wave vectors, amplitudes and phases are exact, on square
/// and oblong frames, for few and many periods.
#[test]
fn without_noise_the_fit_is_exact() {
    for (size, periods, contrast) in [
        ([96, 96], 4.4, Contrast::Cosines),
        ([80, 130], 3.0, Contrast::Spots),
        ([150, 64], 5.0, Contrast::Spots),
        ([128, 128], 30.0, Contrast::Cosines),
    ] {
        let scene = Scene::new(size, periods, 0.3, contrast, 3);
        let measured = fit(&scene.image(), &scene);
        let error = scene.error(&measured.pixels.basis);
        // Harmonics too faint to be worth their place are left out; they bend the others.
        let most = if matches!(contrast, Contrast::Cosines) {
            1e-9
        } else {
            1e-4
        };
        assert!(
            error.amax() < most * scene.basis.amax(),
            "{size:?}: {error:?}"
        );
        let fit = measured.fit.unwrap();
        for harmonic in &fit.harmonics[..3] {
            let [h, k] = harmonic.index.map(f64::from);
            let q = fit.wave_vectors.basis * Vector2::new(h, k);
            let near = |w: &&Wave| (w.q - q).norm().min((w.q + q).norm()) < 1e-4;
            let wave = scene.waves.iter().find(near).unwrap();
            assert!((harmonic.amplitude / wave.amplitude - 1.0).abs() < 1e-3);
            let sign = wave.q.dot(&q).signum();
            let there = sign * (wave.q.dot(&fit.centre) + wave.phase);
            let off = (harmonic.phase - there).sin().abs();
            assert!(off < 1e-3 && (harmonic.phase - there).cos() > 0.0, "{off}");
        }
    }
}

/// With white noise of twice the amplitude the errors are those of the Cramér–Rao bound (inverse
/// Fisher matrix, computed here), the stated errors are true, and there is no bias. With 160 images,
/// 640 numbers, ratios of errors scatter by 3 % and a mean pull by 0.08.
#[test]
fn white_noise_reaches_the_bound() {
    let scene = |seed| {
        let mut scene = Scene::new([128, 128], 4.4, 0.7, Contrast::Cosines, seed);
        scene.white = 2.0;
        scene
    };
    let found = statistics(160, scene);
    let bound = (0..3).map(|seed| scene(seed).bound().trace()).sum::<f64>() / 3.0;
    let efficiency = (found.square / bound).sqrt();
    assert!(
        (0.9..1.10).contains(&efficiency),
        "error over bound {efficiency}"
    );
    assert!((0.9..1.1).contains(&found.pull), "pull {}", found.pull);
    assert!(found.bias.amax() < 0.25, "{:?}", found.bias);
}

/// Stated errors are true along either axis with line offsets, white or 1/f from line to line, and
/// with noise that is 1/f in time, few periods and a sharp contrast: the mean square of two pulls an image.
#[test]
fn coloured_noise_is_told_from_the_image() {
    for (name, periods, contrast, [white, line, flicker, line_flicker]) in [
        ("lines", 4.4, Contrast::Cosines, [1.0, 0.5, 0.0, 0.0]),
        ("1/f lines", 6.0, Contrast::Cosines, [1.0, 0.0, 0.0, 0.5]),
        ("1/f", 8.0, Contrast::Spots, [0.5, 0.0, 0.7, 0.0]),
        ("walls", 2.5, Contrast::Walls, [1.0, 0.3, 0.0, 0.0]),
    ] {
        let images = draws(20);
        let found = statistics(images.into(), |seed| {
            let angle = 0.618 * seed as f64;
            let mut scene = Scene::new([128, 128], periods, angle, contrast, seed);
            (scene.white, scene.line) = (white, line);
            (scene.flicker, scene.line_flicker) = (flicker, line_flicker);
            scene
        });
        for axis in found.axes {
            let square = axis * axis;
            assert!(
                mean_square(2 * images).contains(&square),
                "{name}: {square}"
            );
        }
    }
}

/// Where a harmonic runs along the slow axis, line offsets take up nearly all of it: its phase is then as
/// uncertain as it says, with offsets that are white and offsets that are 1/f from line to line.
#[test]
fn phases_on_the_ridge_of_line_noise_are_as_uncertain_as_they_say() {
    for (line, line_flicker) in [(0.5, 0.0), (0.0, 0.5)] {
        let images = draws(40);
        let (mut squares, mut count) = (0.0, 0);
        for seed in 0..images.into() {
            let angle = 0.3 * (2.0 * (0.618_034 * seed as f64).fract() - 1.0);
            let mut scene = Scene::new([128, 128], 6.0, angle, Contrast::Cosines, seed);
            (scene.white, scene.line, scene.line_flicker) = (0.5, line, line_flicker);
            let measured = fit(&scene.image(), &scene);
            for (cycles, pull) in scene.phase_pulls(&measured) {
                if cycles < 2.2 {
                    squares += pull * pull;
                    count += 1;
                }
            }
        }
        assert_eq!(count, images);
        let square = squares / f64::from(count);
        assert!(mean_square(count).contains(&square), "{line} {square}");
    }
}

/// Line offsets as large as the signal: random offsets make the errors those of the bound without
/// them, but for what the line means lose.
#[test]
fn line_offsets_cost_next_to_nothing() {
    // All first harmonics well away from the ridge of line noise at kx = 0.
    let scene = |seed| {
        let mut scene = Scene::new([128, 128], 8.0, 0.52, Contrast::Cosines, seed);
        (scene.white, scene.line) = (0.5, 2.0);
        scene
    };
    let closest = scene(0)
        .waves
        .iter()
        .map(|w| w.q.x.abs())
        .fold(9.0, f64::min);
    assert!(closest * 128.0 > 3.0 * std::f64::consts::TAU, "{closest}");
    let found = statistics(60, scene);
    let ratio = (found.square / scene(0).bound().trace()).sqrt();
    assert!(ratio < 1.2, "{ratio}");
}

/// Tip events, lines that went wrong and missing pixels change the vectors by about as much as the
/// information they take away: less than two standard errors.
#[test]
fn damage_does_little() {
    let mut scene = Scene::new([160, 160], 6.0, 0.4, Contrast::Spots, 5);
    scene.white = 0.5;
    let image = scene.image();
    let intact = fit(&image, &scene);
    let intact_fit = intact.fit.clone().unwrap();
    assert_eq!(intact_fit.lines_left_out, 0);
    assert!(intact_fit.clipped < 0.006, "{}", intact_fit.clipped);
    let columns = image.columns;
    let mut tip_events = image.clone();
    for event in 0..60 {
        let at = (event * 397) % (160 * 140);
        for value in &mut tip_events.values[at..at + 12] {
            *value += 30.0;
        }
    }
    let mut bad_lines = image.clone();
    for (n, row) in [20, 21, 77, 130].into_iter().enumerate() {
        for column in 0..columns {
            let jump = if (column / (5 + n)) % 2 == 0 {
                8.0
            } else {
                -8.0
            };
            bad_lines.values[row * columns + column] += jump;
        }
    }
    let mut missing = image.clone();
    for row in 0..image.rows {
        for column in 0..columns {
            // Scattered pixels and a corner.
            if (row * 31 + column * 17) % 7 == 0 || (row < 70 && column < 60) {
                missing.values[row * columns + column] = f64::NAN;
            }
        }
    }
    let mut partial = image.clone();
    partial.values[100 * columns..].fill(f64::NAN);
    for (name, damaged, left_out) in [
        ("tip events", &tip_events, 0),
        ("bad lines", &bad_lines, 4),
        ("missing", &missing, 0),
        ("partial", &partial, 60),
    ] {
        let measured = fit(damaged, &scene);
        let pull = pull(&scene, &measured);
        assert!(pull.amax() < 3.5, "{name}: {pull:?}");
        // What is left has the larger errors, and not by orders of magnitude.
        let growth = measured.pixels.covariance.trace() / intact.pixels.covariance.trace();
        assert!((0.9..12.0).contains(&growth), "{name}: {growth}");
        assert_eq!(measured.fit.unwrap().lines_left_out, left_out, "{name}");
    }
}

/// Errors stay true where a quarter of the frame and every seventh pixel are missing.
#[test]
fn missing_pixels_are_counted() {
    let mut pulls = 0.0;
    let count = 80;
    for seed in 0..count {
        let mut scene = Scene::new([96, 96], 5.0, 0.9, Contrast::Cosines, seed);
        scene.white = 1.0;
        let mut image = scene.image();
        for row in 0..96 {
            for column in 0..96 {
                if (row * 5 + column * 3) % 7 == 0 || (row > 48 && column < 48) {
                    image.values[row * 96 + column] = f64::NAN;
                }
            }
        }
        pulls += pull(&scene, &fit(&image, &scene)).norm_squared();
    }
    let spread = (pulls / (4.0 * count as f64)).sqrt();
    assert!((0.88..1.12).contains(&spread), "{spread}");
}

/// The right lattice for few and many periods, sharp contrast, line offsets and noise of twice the
/// signal. (The example `lattice_fit` does this for hundreds of images.)
#[test]
fn finds_the_right_lattice() {
    for (size, periods, contrast) in [
        (128, 2.5, Contrast::Walls),
        (128, 5.0, Contrast::Walls),
        (128, 20.0, Contrast::Cosines),
        (512, 100.0, Contrast::Cosines),
    ] {
        let count = if size > 256 { 2 } else { 8 };
        for seed in 0..count {
            let angle = 0.618 * seed as f64;
            let mut scene = Scene::new([size; 2], periods, angle, contrast, 100 + seed);
            (scene.white, scene.line) = (2.0, 0.5);
            let measured = fit(&scene.image(), &scene);
            let pull = pull(&scene, &measured);
            assert!(
                pull.amax() < 4.5,
                "{periods} periods, seed {seed}: {pull:?}"
            );
            assert!((measured.periods / periods - 1.0).abs() < 0.2);
        }
    }
}

/// The wave that a lattice does not explain.
fn beside(measured: &MeasuredLattice) -> Option<WaveBeside> {
    measured.evidence.as_ref().unwrap().beside
}

/// A second lattice is measured beside the first and named; one lattice leaves only noise.
#[test]
fn a_second_lattice_stands_out() {
    let mut scene = Scene::new([160, 160], 8.0, 0.2, Contrast::Spots, 9);
    scene.white = 1.0;
    assert_eq!(beside(&fit(&scene.image(), &scene)), None);
    let other = Scene::new([160, 160], 11.0, 0.7, Contrast::Cosines, 10);
    let mut both = scene.clone();
    both.waves.extend(other.waves.iter().map(|w| Wave {
        amplitude: 0.3 * w.amplitude,
        ..*w
    }));
    let measured = fit(&both.image(), &both);
    assert!(scene.error(&measured.pixels.basis).norm() < 0.01 * scene.basis.norm());
    assert_eq!(beside(&measured), None);
    let second = measured.evidence.unwrap().second.unwrap();
    let wanted = crate::several_lattices::wavelengths(&other);
    let off = second.iter().zip(wanted).map(|(a, b)| (a / b - 1.0).abs());
    assert!(off.fold(0.0, f64::max) < 0.01, "{second:?} {wanted:?}");
}

/// Stripes half as strong as the lattice, with an overtone, move no wave vector: errors are those of the lattice alone, and σ, in which the stripes are
/// noise, covers them. 24 images are 96 numbers, whose rms scatters by 7 %.
#[test]
fn stripes_move_no_wave_vector() {
    let alone = |seed: u64| {
        let angle = 0.618 * seed as f64;
        let mut scene = Scene::new([160, 160], 14.0, angle, Contrast::Cosines, seed);
        scene.white = 1.0;
        scene
    };
    let striped = |seed: u64| {
        let mut scene = alone(seed);
        // 9 and 18 cycles of the frame, where the lattice has 14 and 25.
        let turn = 1.1 + 2.399 * seed as f64;
        let q = Vector2::new(turn.cos(), turn.sin()) * (0.36 + 0.0005 * seed as f64);
        for (n, amplitude) in [(1.0, 0.5), (2.0, 0.25)] {
            let phase = seed as f64 * n;
            scene.waves.push(Wave {
                q: q * n,
                amplitude,
                phase,
            });
        }
        scene
    };
    let [plain, found] = [statistics(24, alone), statistics(24, striped)];
    println!("pull {:.2}, alone {:.2}", found.pull, plain.pull);
    assert!((0.6..1.2).contains(&found.pull), "{}", found.pull);
    let ratio = (found.square / plain.square).sqrt();
    assert!((0.8..1.25).contains(&ratio), "{ratio}");
    let scene = striped(1);
    assert!(beside(&fit(&scene.image(), &scene)).is_some());
}

/// A wavelength that grows by 1 % across the frame is found, and its size; a second lattice it is not.
#[test]
fn a_changing_lattice_is_pointed_out() {
    for seed in 0..20 {
        let angle = 0.618 * seed as f64;
        let mut scene = Scene::new([256, 256], 10.0, angle, Contrast::Cosines, seed);
        let white = if seed % 2 == 0 { 0.5 } else { 0.1 };
        (scene.white, scene.line, scene.change) = (white, 0.5 * white, 0.01);
        let measured = fit(&scene.image(), &scene);
        let found = measured.fit.as_ref().unwrap().inhomogeneity.unwrap();
        assert!(found.is_significant(), "seed {seed}: {found:?}");
        // q along x changes by 1 %: of |q| that is the square of its cosine, of its direction the
        // product of sine and cosine.
        let mut expected = [0.0f64; 2];
        for wave in &scene.waves {
            let direction = wave.q.normalize();
            expected[0] = expected[0].max(0.01 * direction.x.powi(2));
            expected[1] = expected[1].max(0.01 * (direction.x * direction.y).abs());
        }
        // The variance of X² on a frame is 4/45: with N pixels and noise σ = A a coefficient of ψ is known
        // to √(2/3 / (N/2 · 4/45)) = 0.015 rad, and q, 36 rad at the edge, changes by 4/36 of it, 0.17 %,
        // from corner to corner. Four standard errors.
        let most = 4.0 * 0.0017 * white;
        let near = |found: f64, expected: f64| {
            let off = (found - expected).abs();
            assert!(off < most, "seed {seed}: {found} {expected}");
        };
        near(found.wavelength, expected[0]);
        near(found.angle, expected[1]);
        assert_eq!(beside(&measured), None, "seed {seed}");
    }
}

/// What a lattice that changes by 1 % leaves beside its waves is no noise: errors are as large as is stated, 80 numbers, and not a third smaller.
#[test]
fn a_change_of_the_lattice_is_no_noise() {
    let mut squares = 0.0;
    for seed in 0..20 {
        let angle = 0.618 * seed as f64;
        let mut scene = Scene::new([256, 256], 11.0, angle, Contrast::Cosines, seed);
        (scene.white, scene.line, scene.change) = (0.2, 0.1, 0.01);
        squares += pull(&scene, &fit(&scene.image(), &scene)).norm_squared() / 4.0;
    }
    let rms = (squares / 20.0).sqrt();
    assert!((0.8..1.25).contains(&rms), "rms pull {rms}");
}

/// Of a lattice whose wave vectors are larger at both edges than in the middle the mean over the frame is given. Straight waves fitted
/// to the pixels weigh the middle more: what they see is 0.4 times the bow less, four times the error that is told.
#[test]
fn the_mean_of_a_lattice_that_changes_is_that_over_the_area() {
    let (mut squares, mut by_fit) = (0.0, 0);
    for seed in 0..20 {
        let angle = 0.618 * seed as f64;
        let mut scene = Scene::new([200, 256], 9.0, angle, Contrast::Cosines, seed);
        (scene.white, scene.line, scene.bow) = (0.5, 0.1, 0.005);
        let measured = fit(&scene.image(), &scene);
        let change = measured.fit.as_ref().and_then(|fit| fit.inhomogeneity);
        by_fit += usize::from(change.is_some_and(|change| change.is_significant()));
        squares += pull(&scene, &measured).norm_squared() / 4.0;
    }
    let rms = (squares / 20.0).sqrt();
    assert!(
        by_fit >= 15 && rms < 1.3,
        "{by_fit} by the fit, rms pull {rms}"
    );
}

/// A lattice that is the same everywhere is rarely said not to be: once in a thousand images or less. Of n images k or more
/// are by chance with a probability of λᵏ/k! at most, λ = n/1000: the first k for which that is below 0.2 %.
#[test]
fn a_constant_lattice_is_left_alone() {
    let images = u64::from(draws(40));
    let (mut chance, mut limit) = (1.0, 0);
    while chance > 0.002 {
        limit += 1;
        chance *= images as f64 / 1000.0 / limit as f64;
    }
    let alarms = (0..images)
        .filter(|&seed| {
            let angle = 0.618 * seed as f64;
            let periods = [3.5, 5.0, 8.0, 12.0][seed as usize % 4];
            let mut scene = Scene::new([96, 96], periods, angle, Contrast::Cosines, seed);
            (scene.white, scene.line) = (1.0, 0.4);
            let fit = fit(&scene.image(), &scene).fit.unwrap();
            fit.inhomogeneity.unwrap().is_significant()
        })
        .count();
    assert!(alarms < limit, "{alarms} of {images}");
}

/// White noise, line offsets and 1/f noise alone hold no lattice, however it is looked for.
#[test]
fn noise_has_no_lattice() {
    for seed in 0..16 {
        let mut scene = Scene::new([80, 80], 5.0, 0.0, Contrast::Cosines, seed);
        scene.waves.clear();
        (scene.white, scene.line, scene.flicker) = match seed % 4 {
            0 => (1.0, 0.0, 0.0),
            1 => (1.0, 2.0, 0.0),
            2 => (0.3, 0.0, 1.0),
            _ => (0.2, 1.0, 1.0),
        };
        let found = measure(
            &scene.image(),
            &scene.geometry(),
            Background::Plane,
            Method::Lattice,
        );
        assert!(found.is_err(), "seed {seed}");
    }
}

/// The goodness of a complete model in white noise is 1.
#[test]
fn goodness_is_one_for_white_noise() {
    let mut scene = Scene::new([160, 160], 8.0, 0.2, Contrast::Spots, 9);
    scene.white = 1.0;
    let fit = fit(&scene.image(), &scene).fit.unwrap();
    assert!((fit.goodness - 1.0).abs() < 0.03, "{}", fit.goodness);
    assert!(fit.line_offsets.is_none());
}

/// The image turned by 90° gives the lattice turned by 90°, with the same errors but for the part
/// that lines play.
#[test]
fn turning_the_image_turns_the_lattice() {
    let mut scene = Scene::new([120, 120], 6.0, 0.3, Contrast::Spots, 4);
    scene.white = 0.7;
    let image = scene.image();
    let values = (0..120 * 120)
        .map(|i| image.row(i % 120)[119 - i / 120])
        .collect();
    let turned = fit(&Image::new(120, 120, values), &scene);
    let straight = fit(&image, &scene);
    // (column, row) → (row, 119 − column): old = (119 − row', column').
    let turn = Matrix2::new(0.0, -1.0, 1.0, 0.0);
    let back = turn * turned.pixels.basis;
    let sigma = straight.pixels.covariance.diagonal().amax().sqrt();
    let mut reference = scene.clone();
    reference.basis = straight.pixels.basis;
    assert!(
        reference.error(&back).amax() < 0.1 * sigma,
        "{} {sigma}",
        reference.error(&back)
    );
}
