//! Maps against images whose phases are known, and against closed forms.

use heterostrain::lattice::{Nm, Waves};
use heterostrain::material::Material;
use heterostrain::strain::{StrainConvention, twist_strain};
use nalgebra::{Matrix2, Matrix4, Vector2};

use super::*;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::simulate::field::{Feature, FieldScene, Ripple};
use crate::window::mask::Mask;
use crate::window::types::{Reference, Resolution, WaveMap, WaveNode};

pub(crate) fn map_of(scene: &FieldScene, window: Option<f64>) -> WaveMap {
    map_of_image(&scene.image(), &scene.pair, window)
}

/// The map of an image with pixels of 1 nm about a pair of waves.
pub(crate) fn map_of_image(image: &Image, pair: &Matrix2<f64>, window: Option<f64>) -> WaveMap {
    let (reference, resolution) = asked(pair, window);
    local_lattices(image, &reference, &resolution).expect("a map")
}

fn asked(pair: &Matrix2<f64>, window_nm: Option<f64>) -> (Reference, Resolution) {
    let reference = Reference {
        pair: *pair,
        pitch: [1.0; 2],
    };
    let resolution = Resolution {
        window_nm,
        ..Resolution::default()
    };
    (reference, resolution)
}

fn place(map: &WaveMap, node: usize) -> Vector2<f64> {
    let (column, row) = (node % map.size[0], node / map.size[0]);
    map.first + Vector2::new(column as f64 * map.step[0], row as f64 * map.step[1])
}

/// Good nodes and their places.
pub(crate) fn good(map: &WaveMap) -> impl Iterator<Item = (&WaveNode, Vector2<f64>)> {
    let all = map.nodes.iter().enumerate();
    all.filter(|(_, node)| node.mask == Mask::Good)
        .map(|(i, node)| (node, place(map, i)))
}

/// Errors over stated errors of all components at good nodes, and those over `sigma`.
pub(crate) fn pulls(scene: &FieldScene, map: &WaveMap, sigma: f64) -> [Vec<f64>; 2] {
    let mut out = [Vec::new(), Vec::new()];
    for (node, at) in good(map) {
        let error = node.pair - scene.waves(at);
        for (wave, axis) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let stated = node.covariance[(2 * wave + axis, 2 * wave + axis)].sqrt();
            out[0].push(error[(axis, wave)] / stated);
            out[1].push(error[(axis, wave)] / sigma);
        }
    }
    out
}

pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// `σ_g = (σ/A)/(2√π w²)` per wave; of three equal waves at q₁, q₂, q₂ − q₁ the first two are then known to
/// `√(2/3)` of that.
fn formula(noise: f64, window: f64) -> f64 {
    (2.0f64 / 3.0).sqrt() * noise / (2.0 * std::f64::consts::PI.sqrt() * window * window)
}

#[test]
fn stated_errors_follow_the_formula() {
    let mut scene = FieldScene::rippled(400, 25.0, 0.0);
    scene.white = 1.2;
    let map = map_of(&scene, Some(16.0));
    let stated: Vec<f64> = good(&map)
        .map(|(n, _)| n.covariance[(0, 0)].sqrt())
        .collect();
    let mean = stated.iter().sum::<f64>() / stated.len() as f64;
    // Noise is measured on the image, to some per cent.
    assert!((mean / formula(1.2, 16.0) - 1.0).abs() < 0.06, "{mean}");
}

/// Noise as strong as the signal, wave vectors ± 10 % over the frame, windows chosen by themselves.
#[test]
fn errors_are_as_stated_and_near_the_formula() {
    let (mut all, mut against) = (Vec::new(), Vec::new());
    for (seed, size, periods) in [
        (1, 512, 20.0),
        (2, 640, 40.0),
        (3, 512, 60.0),
        (4, 512, 20.0),
        // Without a carrier that follows it, a window this wide would lose the lattice.
        (5, 640, 110.0),
    ] {
        let mut scene = FieldScene::rippled(size, periods, 0.1);
        scene.white = scene.signal_rms();
        scene.seed = seed;
        let map = map_of(&scene, None);
        let [stated, formula] = pulls(&scene, &map, formula(scene.white, map.window_nm));
        assert!(rms(&formula) < 1.3, "{seed}: {}", rms(&formula));
        all.extend(stated);
        against.extend(formula);
    }
    let inside = all.iter().filter(|p| p.abs() < 1.0).count() as f64 / all.len() as f64;
    assert!((inside - 0.683).abs() < 0.04, "{inside}");
    assert!(rms(&against) < 1.15, "{}", rms(&against));
}

/// Harmonics leak through windows that edges cut; none of that is a defect, nor beyond the errors: neither in
/// frames of a few periods nor in images almost without noise.
#[test]
fn perfect_lattices_have_no_defects() {
    let mut pulls_of_few = Vec::new();
    for (seed, periods, white) in [
        (1, 4.0, 0.6),
        (2, 4.0, 0.6),
        (3, 4.0, 0.6),
        (11, 2.5, 0.6),
        (12, 2.5, 0.6),
        (13, 3.0, 0.6),
        (4, 5.0, 0.6),
        (5, 5.0, 0.6),
        (6, 7.0, 0.6),
        (7, 10.0, 0.6),
        (8, 20.0, 0.0),
        (9, 20.0, 1e-3),
        (10, 20.0, 0.05),
    ] {
        let mut scene = FieldScene::hexagonal([512, 512], 512.0 / periods, 0.3);
        scene.white = white;
        scene.seed = seed;
        let map = map_of(&scene, None);
        let flagged = map.nodes.iter().filter(|n| n.mask > Mask::Margin);
        assert_eq!(flagged.count(), 0, "{periods} periods, noise {white}");
        assert!(good(&map).count() >= 49, "{periods} periods");
        let [stated, _] = pulls(&scene, &map, 1.0);
        assert!(rms(&stated) < 1.5, "{periods}: {}", rms(&stated));
        if white == 0.6 && periods < 6.0 {
            pulls_of_few.extend(stated);
        }
    }
    // Few independent nodes each: only together do they tell.
    let spread = rms(&pulls_of_few);
    assert!((0.75..1.25).contains(&spread), "{spread}");
}

/// The same of a lattice that bends and of one with missing pixels, with little noise.
#[test]
fn bent_lattices_and_gaps_have_no_defects() {
    let mut scene = FieldScene::rippled(512, 32.0, 0.05);
    scene.white = 0.02;
    let bent = map_of(&scene, None);
    let mut image = scene.image();
    for row in 240..262 {
        for column in 200..230 {
            image.values[row * 512 + column] = f64::NAN;
        }
    }
    let reference = Reference {
        pair: scene.pair,
        pitch: [1.0; 2],
    };
    let gap = local_lattices(&image, &reference, &Resolution::default()).unwrap();
    for map in [bent, gap] {
        let flagged = map.nodes.iter().filter(|n| n.mask > Mask::Missing);
        assert_eq!(flagged.count(), 0);
        let [stated, _] = pulls(&scene, &map, 1.0);
        assert!(rms(&stated) < 1.2, "{}", rms(&stated));
    }
}

/// A step of the wave vectors becomes an error function of the window's width.
#[test]
fn a_step_is_smeared_by_the_window() {
    let mut scene = FieldScene::hexagonal([400, 300], 12.0, 0.2);
    let normal = 0.5f64;
    let direction = Vector2::new(normal.cos(), normal.sin());
    let on = Vector2::new(200.0, 150.0);
    let change = [3e-4, -2e-4];
    scene.features = vec![Feature::Step {
        at: on,
        normal,
        change,
    }];
    let window = 14.0;
    let map = map_of(&scene, Some(window));
    let (mut seen, mut most) = (0, 0.0f64);
    for (i, node) in map.nodes.iter().enumerate() {
        let at = place(&map, i);
        let inside = at.x.min(at.y).min(399.0 - at.x).min(299.0 - at.y) > 4.0 * window;
        if !inside {
            continue;
        }
        let s = (at - on).dot(&direction) / (window * std::f64::consts::SQRT_2);
        let expected = 0.5 * (1.0 + libm::erf(s));
        for (wave, change) in change.into_iter().enumerate() {
            let step = (node.pair.column(wave) - scene.pair.column(wave)).dot(&direction);
            most = most.max((step / change - expected).abs());
            seen += 1;
        }
    }
    assert!(seen > 500 && most < 0.02, "{seen} {most}");
}

/// Around dislocations, wrinkles and boundaries nothing false is left: no error beyond six σ, nor beyond a
/// tenth of the wave vector; and the rest of the map is there.
#[test]
fn defects_are_masked() {
    let middle = Vector2::new(200.0, 210.0);
    let normal = 0.4;
    let dislocation = |turns| Feature::Dislocation { at: middle, turns };
    for (what, feature) in [
        (Mask::Defect, dislocation([1, 0])),
        (Mask::Defect, dislocation([1, -1])),
        (
            Mask::Weak,
            Feature::Wrinkle {
                at: middle,
                normal,
                width: 60.0,
            },
        ),
        (
            Mask::Defect,
            Feature::Boundary {
                at: middle,
                normal,
                turn: 0.15,
            },
        ),
    ] {
        let mut scene = FieldScene::rippled(420, 26.0, 0.0);
        scene.white = 0.4;
        scene.features = vec![feature];
        let map = map_of(&scene, None);
        let count = |mask: Mask| map.nodes.iter().filter(|n| n.mask == mask).count();
        assert!(count(what) > 10, "{feature:?}: {}", count(what));
        let inner = map.nodes.len() - count(Mask::Margin);
        assert!(5 * count(Mask::Good) > 2 * inner, "{feature:?}");
        for (node, at) in good(&map) {
            let error = (node.pair - scene.waves(at)).amax();
            let sigma = (node.covariance.trace() / 4.0).sqrt();
            assert!(
                error < 6.5 * sigma,
                "{feature:?} at {at}: {}",
                error / sigma
            );
            assert!(error < 0.1 * scene.pair.column(0).norm(), "{feature:?}");
        }
    }
}

/// Lines and a block of missing pixels: what is left is as good as its errors say.
#[test]
fn missing_pixels_do_no_harm() {
    let mut scene = FieldScene::rippled(360, 24.0, 0.03);
    scene.white = 0.8;
    let mut image = scene.image();
    for row in 0..360 {
        for column in 0..360 {
            let block = (150..190).contains(&row) && (100..150).contains(&column);
            if block || row % 40 == 7 {
                image.values[row * 360 + column] = f64::NAN;
            }
        }
    }
    let reference = Reference {
        pair: scene.pair,
        pitch: [1.0; 2],
    };
    let map = local_lattices(&image, &reference, &Resolution::default()).unwrap();
    assert!(map.nodes.iter().any(|n| n.mask == Mask::Missing));
    let [stated, _] = pulls(&scene, &map, 1.0);
    assert!(stated.len() > 1000);
    assert!((0.85..1.15).contains(&rms(&stated)), "{}", rms(&stated));
}

/// Nothing but noise has no map, or one without good nodes.
#[test]
fn noise_has_no_map() {
    let mut scene = FieldScene::rippled(256, 16.0, 0.0);
    scene.harmonics.clear();
    scene.white = 1.0;
    let reference = Reference {
        pair: scene.pair,
        pitch: [1.0; 2],
    };
    let map = local_lattices(&scene.image(), &reference, &Resolution::default());
    let good = map.map_or(0, |m| good(&m).count());
    assert!(good < 5, "{good}");
}

/// The chain from pixels to twist and strain, on a turned and sheared frame, against the general solution
/// for the true local lattice.
#[test]
fn twist_and_strain_are_those_of_the_local_lattice() {
    let scene = FieldScene::rippled(512, 24.0, 0.02);
    let map = map_of(&scene, None);
    let geometry = Geometry {
        size: [512, 512],
        pixel_to_nm: Matrix2::new(0.55, -0.21, 0.2, 0.57),
        origin: Vector2::new(-3.0, 8.0),
        covariance: Matrix4::zeros(),
        from_sensors: true,
        departure: None,
    };
    let lattices = LatticeMap::new(&map, &geometry).unwrap();
    let material = Material::graphene();
    let convention = StrainConvention::RealSpace;
    let mean = lattices.mean().unwrap();
    let found = lattices.twist_strain(&mean, &material, convention).unwrap();
    let dual = geometry.pixel_to_nm.try_inverse().unwrap().transpose();
    let mut seen = 0;
    for (i, node) in map
        .nodes
        .iter()
        .enumerate()
        .filter(|(_, n)| n.mask == Mask::Good)
    {
        let at = place(&map, i);
        let position = geometry.origin + geometry.pixel_to_nm * at;
        assert!((lattices.grid.place(i) - position).norm() < 1e-9);
        let exact = Waves::<Nm>::new(dual * scene.waves(at), Matrix4::identity());
        let real = exact.lattice().unwrap();
        let truth = twist_strain(&real, &material, convention).unwrap();
        let here = found[i].unwrap();
        // What the window blurs: some 10⁻³ of the wave vectors.
        assert!((here.twist / truth.twist - 1.0).abs() < 2e-3);
        let apart = (here.strain_vector - truth.strain_vector).norm();
        assert!(apart < 3e-3 * truth.twist, "{apart}");
        assert!(node.chi2.is_finite());
        seen += 1;
    }
    assert!(seen > 100, "{seen}");
}

/// Displacements of a rippled lattice are those of its phases, whatever their number of turns, but for the
/// constant and what belongs to the mean lattice.
#[test]
fn displacements_follow_the_phases() {
    let mut scene = FieldScene::rippled(512, 32.0, 0.05);
    scene.white = 0.5;
    let map = map_of(&scene, None);
    let geometry = Geometry {
        size: [512, 512],
        pixel_to_nm: Matrix2::identity(),
        origin: Vector2::zeros(),
        covariance: Matrix4::zeros(),
        from_sensors: false,
        departure: None,
    };
    let lattices = LatticeMap::new(&map, &geometry).unwrap();
    let mean = lattices.mean().unwrap();
    let back = -mean.transpose().try_inverse().unwrap();
    let (mut difference, mut stated) = (Vec::new(), Vec::new());
    for (i, node) in lattices.nodes.iter().enumerate() {
        if node.displacement.x.is_finite() {
            let at = lattices.grid.place(i);
            let truth = back * (scene.phases(at) - mean.transpose() * at);
            difference.push(node.displacement - truth);
            stated.push(node.displacement_covariance.m11.sqrt());
        }
    }
    assert!(difference.len() * 10 > 9 * good(&map).count());
    let centre = difference.iter().sum::<Vector2<f64>>() / difference.len() as f64;
    let spread: Vec<f64> = difference.iter().map(|d| (d - centre).x).collect();
    // Noise, and the curvature that the window takes off the phases (tenths of a pixel).
    let typical = stated.iter().sum::<f64>() / stated.len() as f64;
    assert!(
        rms(&spread) < 1.5 * typical + 0.1,
        "{} {typical}",
        rms(&spread)
    );
    assert!(rms(&spread) > 0.5 * typical);
}

/// Bands of a survey are the map of the whole image, node by node: places exactly, values within a small
/// part of their errors (each band has a carrier and a noise level of its own).
#[test]
fn bands_go_on_where_others_end() {
    let mut scene = FieldScene::rippled(512, 40.0, 0.03);
    scene.white = 0.7;
    let image = scene.image();
    let (reference, resolution) = asked(&scene.pair, Some(14.0));
    let survey = Survey::new([512, 512], reference, resolution, 14.0, 150);
    assert!(survey.bands() >= 3);
    let mut nodes = 0;
    let mut next = None;
    for band in 0..survey.bands() {
        let rows = survey.rows(band);
        let part = image.cropped([0, rows.start], [512, rows.len()]);
        let map = survey.map(band, &part).unwrap();
        // Rows of nodes follow each other at equal steps.
        if let Some(next) = next {
            assert_eq!(map.first.y, next);
        }
        next = Some(map.first.y + map.step[1] * map.size[1] as f64);
        nodes += map.nodes.len();
        let [stated, _] = pulls(&scene, &map, 1.0);
        assert!(
            (0.8..1.2).contains(&rms(&stated)),
            "{band}: {}",
            rms(&stated)
        );
    }
    let whole = local_lattices(&image, &reference, &resolution).unwrap();
    assert!(nodes.abs_diff(whole.nodes.len()) <= 2 * whole.size[0]);
}

/// Opposite changes of drift in upward and downward frames are found, with their size; equal ones are not.
#[test]
fn changing_drift_is_told_from_strain() {
    // 0.05 s per nm along y, A = (2, −3)·10⁻³ nm/s²: the phase of G changes by −½ (A·G)(u·r)².
    let u = 0.05;
    let acceleration = Vector2::new(2e-3, -3e-3);
    let of = |sign: f64, seed: u64| {
        let mut scene = FieldScene::hexagonal([400, 400], 16.0, 0.2);
        let at = scene.pair.tr_mul(&acceleration) * sign;
        // A sine of long period is a parabola where it bends most.
        let wave = 1e-3;
        scene.ripples.push(Ripple {
            wave: Vector2::new(0.0, wave),
            phase: std::f64::consts::FRAC_PI_2 - 200.0 * wave,
            amplitude: [at.x, at.y].map(|a| a * u * u / (wave * wave)),
        });
        scene.white = 0.5;
        scene.seed = seed;
        let geometry = Geometry {
            size: [400, 400],
            pixel_to_nm: Matrix2::identity(),
            origin: Vector2::zeros(),
            covariance: Matrix4::zeros(),
            from_sensors: true,
            departure: None,
        };
        LatticeMap::new(&map_of(&scene, Some(16.0)), &geometry).unwrap()
    };
    let gradient = Vector2::new(0.0, u);
    let found = drift_change(&of(1.0, 1), &of(-1.0, 2), gradient).unwrap();
    assert!(found.is_significant(), "{found:?}");
    for i in 0..2 {
        let error = found.acceleration[i].value - 2.0 * acceleration[i];
        assert!(error.abs() < 4.0 * found.acceleration[i].sigma, "{found:?}");
        assert!(error.abs() < 0.3 * acceleration.norm(), "{found:?}");
    }
    let same = drift_change(&of(1.0, 3), &of(1.0, 4), gradient).unwrap();
    assert!(!same.is_significant(), "{same:?}");
}
