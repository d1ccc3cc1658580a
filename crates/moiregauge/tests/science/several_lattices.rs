//! Several lattices in one image are separated, each within its errors.

use crate::fit_scene::{Contrast, Scene, Wave};
use heterostrain::lattice::reciprocal;
use moiregauge::frame::Background;
use moiregauge::lattice::{MeasuredLattice, measure, measure_several};
use moiregauge::spectrum::{LatticeError, Method};
use nalgebra::{Matrix2, Vector4};

/// Size and turn a lattice.
fn changed(scene: &mut Scene, size: f64, turn: f64) {
    let (s, c) = turn.sin_cos();
    let map = Matrix2::new(c, -s, s, c);
    scene.basis = map * scene.basis * size;
    for wave in &mut scene.waves {
        wave.q = map * wave.q / size;
    }
}

/// One image with the lattices of all scenes and the noise of the first one.
fn together(scenes: &[Scene]) -> Scene {
    let mut all = scenes[0].clone();
    for scene in &scenes[1..] {
        all.waves.extend(scene.waves.iter().copied());
    }
    all
}

fn separate(scenes: &[Scene]) -> Result<Vec<MeasuredLattice>, LatticeError> {
    let all = together(scenes);
    measure_several(
        &all.image(),
        &all.geometry(),
        Background::Plane,
        scenes.len(),
    )
}

/// Lengths of the three shortest vectors of a scene, shortest first.
pub(crate) fn wavelengths(scene: &Scene) -> [f64; 3] {
    let [a, b] = [0, 1].map(|i| scene.basis.column(i).into_owned());
    let mut lengths = [a.norm(), b.norm(), (b - a).norm()];
    lengths.sort_by(f64::total_cmp);
    lengths
}

/// Decorrelated errors over stated errors of the lattice that is nearest to that of the scene.
fn pulls(scene: &Scene, found: &[MeasuredLattice]) -> Vector4<f64> {
    let off = |m: &&MeasuredLattice| scene.error(&m.pixels.basis).norm();
    let nearest = found
        .iter()
        .min_by(|a, b| off(a).total_cmp(&off(b)))
        .unwrap();
    let (_, change) = scene.change(&nearest.pixels.basis);
    let covariance = change * nearest.pixels.covariance * change.transpose();
    let factor = covariance.cholesky().unwrap();
    let error = scene.error(&nearest.pixels.basis);
    factor.l().solve_lower_triangular(&error).unwrap()
}

/// Over `count` images no pull beyond 4, and their mean square 1 within three times its scatter.
fn each_within_its_errors(count: u64, scenes: impl Fn(u64) -> Vec<Scene>) {
    let (mut squares, mut n) = (0.0, 0.0);
    for seed in 0..count {
        let scenes = scenes(seed);
        let found = separate(&scenes).unwrap_or_else(|error| panic!("{seed}: {error}"));
        assert_eq!(found.len(), scenes.len());
        for (i, scene) in scenes.iter().enumerate() {
            let pull = pulls(scene, &found);
            assert!(pull.amax() < 4.0, "seed {seed}, lattice {i}: {pull:?}");
            squares += pull.norm_squared();
            n += 4.0;
        }
    }
    let mean = squares / n;
    let scatter = 3.0 * f64::sqrt(2.0 / n);
    assert!((mean - 1.0).abs() < scatter, "{mean} ± {scatter}");
}

fn scene(size: usize, periods: f64, angle: f64, contrast: Contrast, seed: u64) -> Scene {
    let mut scene = Scene::new([size; 2], periods, angle, contrast, seed);
    scene.white = 1.0;
    scene
}

/// Twisted bilayer graphene on hBN: 12 and 8.5 periods, in any orientation, one sharp and one smooth.
#[test]
fn two_lattices_are_separated() {
    each_within_its_errors(20, |seed| {
        let angle = 0.618_034 * seed as f64;
        vec![
            scene(256, 12.0, angle, Contrast::Cosines, seed),
            scene(256, 8.5, 1.7 * angle, Contrast::Spots, seed + 100),
        ]
    });
}

/// A trilayer: 8, 13 and 19 periods.
#[test]
fn three_lattices_are_separated() {
    each_within_its_errors(10, |seed| {
        let angle = 0.618_034 * seed as f64;
        vec![
            scene(256, 8.0, angle, Contrast::Cosines, seed),
            scene(256, 13.0, 0.2 + angle, Contrast::Cosines, seed + 100),
            scene(256, 19.0, 0.5 - angle, Contrast::Cosines, seed + 200),
        ]
    });
}

/// The same orientation, wavelengths 5 % apart: 30 and 31.5 periods, so that wave vectors lie one and a half
/// cycles per frame from each other, within the resolution of a window.
#[test]
fn nearly_equal_lattices_are_separated() {
    each_within_its_errors(15, |seed| {
        let angle = 0.618_034 * seed as f64;
        let first = scene(384, 30.0, angle, Contrast::Cosines, seed);
        let mut second = scene(384, 30.0, angle, Contrast::Cosines, seed + 100);
        changed(&mut second, 1.0 / 1.05, 0.0);
        vec![first, second]
    });
}

/// A second lattice is not made up, and not taken from the first one's overtones.
#[test]
fn what_is_not_there_is_not_found() {
    for seed in 0..10 {
        let one = scene(256, 9.0, 0.3 * seed as f64, Contrast::Walls, seed);
        let all = [one.clone()];
        let image = together(&all).image();
        let found = measure_several(&image, &one.geometry(), Background::Plane, 2);
        let expected = LatticeError::FewerLattices {
            found: 1,
            wanted: 2,
        };
        assert_eq!(found.err(), Some(expected), "{seed}");
    }
}

/// Cells of 1/2 and 1/√3 of the length at the angles of those vectors of a hexagonal lattice, and 3 % off: the first harmonics
/// of one lie near higher ones of the other. Both are right within their errors, or the second one is refused: what was left
/// of its own higher harmonics passed for it.
#[test]
fn nearly_commensurate_lattices_are_measured_or_refused() {
    let cases = [
        (2.0, 0.0, 0, true),
        (3f64.sqrt(), 30f64.to_radians(), 10, false),
    ];
    for (ratio, turn, seed, resolved) in cases {
        let off = -0.03;
        let angle = 0.618_034 * seed as f64;
        let first = scene(256, 7.0, angle, Contrast::Spots, seed);
        let mut second = scene(256, 7.0, angle, Contrast::Spots, seed + 100);
        changed(&mut second, 1.0 / (ratio * (1.0 + off)), turn + 0.5 * off);
        let scenes = [first, second];
        match separate(&scenes) {
            Ok(found) => {
                for scene in &scenes {
                    let pull = pulls(scene, &found);
                    assert!(pull.amax() < 4.0, "{ratio:.3}: {pull:?}");
                }
            }
            Err(error) => assert!(!resolved, "{ratio:.3}: {error}"),
        }
    }
}

/// The image of two lattices asked for one: it is the stronger one, within its errors, measured together with the other, which is named. Eight periods
/// and 0.8, 1.2 and 1.5 times as many at half the amplitude.
#[test]
fn the_stronger_of_two_lattices_is_measured_beside_the_other() {
    let (mut squares, mut n) = (0.0, 0.0);
    for (seed, (ratio, turn)) in [(0.8, 0.1), (1.2, 0.2), (1.5, 0.7)]
        .into_iter()
        .cycle()
        .take(12)
        .enumerate()
    {
        let (seed, angle) = (seed as u64, 0.618_034 * seed as f64);
        let first = scene(160, 8.0, angle, Contrast::Cosines, seed);
        let mut second = scene(160, 8.0, angle, Contrast::Cosines, seed + 100);
        changed(&mut second, 1.0 / ratio, turn);
        for wave in &mut second.waves {
            wave.amplitude *= 0.5;
        }
        let all = together(&[first.clone(), second.clone()]);
        let (geometry, method) = (all.geometry(), Method::Lattice);
        let found = measure(&all.image(), &geometry, Background::Plane, method).unwrap();
        let named = found.evidence.as_ref().and_then(|evidence| evidence.second);
        let named = named.unwrap_or_else(|| panic!("{seed}: no second lattice"));
        let wanted = wavelengths(&second);
        let off = named.iter().zip(wanted).map(|(a, b)| (a / b - 1.0).abs());
        assert!(
            off.fold(0.0, f64::max) < 0.02,
            "{seed}: {named:?} {wanted:?}"
        );
        let pull = pulls(&first, &[found]);
        assert!(pull.amax() < 4.0, "{seed}: {pull:?}");
        squares += pull.norm_squared();
        n += 4.0;
    }
    let (mean, scatter) = (squares / n, 3.0 * f64::sqrt(2.0 / n));
    assert!((mean - 1.0).abs() < scatter, "{mean} ± {scatter}");
}

/// A lattice and another one whose waves are `amplitude` times as strong, and whose wave vectors are `length` times as long as those of a superlattice.
fn with_superlattice(from_coarse: Matrix2<f64>, amplitude: f64, length: f64) -> [Scene; 2] {
    let fine = scene(192, 14.0, 0.3, Contrast::Cosines, 1);
    let mut coarse = fine.clone();
    let pair = Matrix2::from_columns(&[fine.waves[1].q, fine.waves[2].q]);
    let pair = pair * from_coarse.try_inverse().unwrap() * length;
    let [a, b] = [0, 1].map(|i| pair.column(i).into_owned());
    for (wave, q) in coarse.waves.iter_mut().zip([a, b, b - a]) {
        *wave = Wave {
            q,
            amplitude: amplitude * wave.amplitude,
            ..*wave
        };
    }
    coarse.basis = reciprocal(&pair).unwrap();
    [fine, coarse]
}

/// The cell of √3 times the period, by its reciprocal pair.
fn root_three() -> Matrix2<f64> {
    Matrix2::new(1.0, -1.0, 1.0, 2.0)
}

fn measured(scenes: &[Scene]) -> MeasuredLattice {
    let all = together(scenes);
    let (background, method) = (Background::Plane, Method::Lattice);
    measure(&all.image(), &all.geometry(), background, method).unwrap()
}

/// A lattice and another of √3 or 2 times the period whose harmonics it is are one lattice: that of the larger cell.
#[test]
fn a_superlattice_is_one_lattice() {
    for (name, fine_from_coarse) in [("√3", root_three()), ("2", Matrix2::identity() * 2.0)] {
        let scenes = with_superlattice(fine_from_coarse, 0.15, 1.0);
        let one = LatticeError::FewerLattices {
            found: 1,
            wanted: 2,
        };
        assert_eq!(separate(&scenes).err(), Some(one), "{name}");
        let found = measured(&scenes);
        let second = found.evidence.as_ref().unwrap().second;
        assert_eq!(second, None, "{name}");
        let cells = found.pixels.basis.determinant() / scenes[1].basis.determinant();
        assert!((cells.abs() - 1.0).abs() < 0.01, "{name}: {cells}");
    }
}

/// Waves that miss those of a superlattice by 1.2 %, or 0.2 cycles of the frame, are those of a second lattice, not of a larger cell.
#[test]
fn a_second_lattice_close_to_a_superlattice_is_told_from_it() {
    let mut scenes = with_superlattice(root_three(), 0.6, 1.012);
    scenes[0].white = 0.2;
    let found = measured(&scenes);
    let cells = found.pixels.basis.determinant() / scenes[0].basis.determinant();
    assert!((cells.abs() - 1.0).abs() < 0.001, "{cells}");
    let second = found.evidence.unwrap().second.unwrap();
    for (length, truth) in second.into_iter().zip(wavelengths(&scenes[1])) {
        let off = length / truth - 1.0;
        assert!(off.abs() < 0.003, "{off}");
    }
}
