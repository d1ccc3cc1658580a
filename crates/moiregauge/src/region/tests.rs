use heterostrain::lattice::{Nm, Waves};
use heterostrain::material::Material;
use heterostrain::strain::StrainConvention;
use nalgebra::{Matrix2, Matrix4, Vector2};

use super::*;
use crate::frame::geometry::Geometry;
use crate::map::local::local_lattices;
use crate::map::nodes::Grid;
use crate::map::quantities::{Plane, TwistStrainMap};
use crate::map::sample::LatticeMap;
use crate::simulate::field::{FieldScene, Ripple};
use crate::window::mask::Mask;
use crate::window::types::{Reference, Resolution};

/// A map with this twist and error everywhere, on a sheared grid of 60 × 50 nodes about 2 nm apart.
pub(crate) fn made(twist: impl Fn(Vector2<f64>) -> f64, sigma: f64) -> TwistStrainMap {
    let grid = Grid {
        size: [60, 50],
        origin: Vector2::new(-5.0, 3.0),
        step: Matrix2::new(2.0, 0.1, -0.15, 1.9),
    };
    let places: Vec<Vector2<f64>> = (0..grid.len()).map(|n| grid.place(n)).collect();
    let plane = |value: &dyn Fn(Vector2<f64>) -> f64, sigma: f64| Plane {
        value: places.iter().map(|p| value(*p) as f32).collect(),
        sigma: vec![sigma as f32; places.len()],
    };
    let constant = |value: f64| plane(&|_| value, sigma);
    TwistStrainMap {
        grid,
        window_nm: 6.0,
        mask: vec![Mask::Good; places.len()],
        twist: plane(&twist, sigma),
        lattice_angle: constant(0.3),
        strain: [constant(0.002), constant(-0.001)],
        strain_covariance: vec![0.0; places.len()],
        magnitude: constant(0.0022),
        axis: constant(0.1),
        wavelengths: [constant(12.0), constant(13.0), constant(14.0)],
        orientation: constant(0.2),
        displacement: [constant(0.0), constant(0.0)],
        closure: vec![1.0; places.len()],
        curl: vec![0.0; places.len()],
        of_bends: Default::default(),
        signal_to_noise: vec![10.0; places.len()],
        grain: Vec::new(),
    }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// A twist that grows along x: the mean of a box is that of its middle, its spread that of a uniform
/// distribution, `g·width/√12`.
#[test]
fn a_gradient_has_the_mean_of_the_middle() {
    let map = made(|p| 0.02 + 1e-4 * p.x, 0.0);
    let box_ = Region::rectangle("b", Vector2::new(20.0, 20.0), [60.0, 50.0]);
    let found = RegionStatistics::new(&map, &box_);
    let twist = found.twist.unwrap();
    // Cells at the rim count by their share, to a tenth of a node.
    assert!((twist.mean - (0.02 + 1e-4 * 50.0)).abs() < 1e-4 * 0.1);
    assert!((twist.spread / (1e-4 * 60.0 / 12.0f64.sqrt()) - 1.0).abs() < 0.03);
    // Single precision alone.
    assert!(twist.sigma < 1e-11);
    let strain = found.mean.unwrap().strain_vector;
    assert!((strain - Vector2::new(0.002, -0.001)).norm() < 1e-9);
    assert!((found.strain_rms.unwrap() - strain.norm()).abs() < 1e-7);
    assert!((found.wavelength.unwrap().mean - 13.0).abs() < 1e-5);
    let area: f64 = box_.shares(&map.grid).iter().map(|n| n.1).sum();
    assert!((area * map.node_area() / box_.area() - 1.0).abs() < 0.01);
    assert_eq!(found.covered, 1.0);
}

/// Masked nodes are counted by reason and not used.
#[test]
fn masked_nodes_do_not_count() {
    let mut map = made(|p| 0.02 + 1e-4 * p.x, 1e-5);
    let whole = Region::rectangle("all", Vector2::new(-50.0, -50.0), [300.0, 300.0]);
    for node in 0..map.grid.len() {
        if map.grid.place(node).x > 40.0 {
            map.mask[node] = Mask::Weak;
            map.twist.value[node] = f32::NAN;
        }
    }
    map.mask[0] = Mask::Defect;
    let found = RegionStatistics::new(&map, &whole);
    let weak = map.count(Mask::Weak);
    assert_eq!(found.masked, [(Mask::Weak, weak), (Mask::Defect, 1)]);
    assert_eq!((found.nodes, found.good), (3000, 3000 - weak - 1));
    assert!(found.twist.unwrap().mean < 0.02 + 1e-4 * 40.0);
    assert!(found.covered < 0.2);
    let outside = Region::rectangle("o", Vector2::new(900.0, 0.0), [10.0, 10.0]);
    assert!(RegionStatistics::new(&map, &outside).twist.is_none());
}

/// Bilinear interpolation of a linear field is exact; beyond the map there is nothing.
#[test]
fn profiles_follow_the_field() {
    let map = made(|p| 0.02 + 1e-4 * p.x - 5e-5 * p.y, 2e-6);
    let ends = [Vector2::new(10.0, 15.0), Vector2::new(300.0, 40.0)];
    let profile = Profile::new(&map, "p", ends);
    let (mut seen, mut beyond) = (0, 0);
    for point in &profile.points {
        match point.values {
            Some(values) => {
                let truth = 0.02 + 1e-4 * point.place.x - 5e-5 * point.place.y;
                assert!((values.twist.value - truth).abs() < 1e-8);
                assert!((values.twist.sigma - 2e-6).abs() < 1e-11);
                seen += 1;
            }
            None => beyond += usize::from(point.mask.is_none()),
        }
    }
    assert!(seen > 40 && beyond > 80, "{seen} {beyond}");
    let last = profile.points.last().unwrap();
    assert!((last.distance - (ends[1] - ends[0]).norm()).abs() < 1e-9);
}

/// Where everything is the same, all areas are equally good and none overlaps another.
#[test]
fn a_uniform_map_has_equal_areas() {
    let map = made(|_| 0.02, 1e-5);
    let mut search = DeviceSearch::new([30.0, 12.0]);
    for orientations in [1, 4] {
        search.orientations = orientations;
        let found = uniform_areas(&map, &search);
        assert!(found.len() >= 8, "{}", found.len());
        let twist = |d: &Device| d.found.twist.unwrap();
        for device in &found {
            assert_eq!(twist(device).corrected, 0.0);
            assert!((twist(device).mean - 0.02).abs() < 1e-8);
            assert_eq!(device.found.masked_share, 0.0);
            assert!(device.found.covered > 0.85);
        }
        // No place belongs to two areas.
        for node in 0..map.grid.len() {
            let place = map.grid.place(node);
            let owners = found
                .iter()
                .filter(|d| d.found.region.contains(place))
                .count();
            assert!(owners <= 1);
        }
    }
    let large = DeviceSearch::new([500.0, 10.0]);
    assert!(uniform_areas(&map, &large).is_empty());
}

/// The quiet place is found, in the right orientation, and masked ones are avoided.
#[test]
fn the_quiet_place_is_found() {
    // A valley along y at x = 60: the twist grows away from it.
    let mut map = made(|p| 0.02 + 1e-6 * (p.x - 60.0).powi(2), 1e-6);
    let search = DeviceSearch {
        orientations: 2,
        most: 3,
        ..DeviceSearch::new([41.3, 10.7])
    };
    let best = &uniform_areas(&map, &search)[0];
    assert!((best.angle - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    assert!((best.centre.x - 60.0).abs() < 2.0, "{}", best.centre);
    // Over ± h, u = x − 60: the variance of u² is 4h⁴/45.
    let expected = 1e-6 * (4.0f64 / 45.0).sqrt() * 5.35f64.powi(2);
    let spread = best.found.twist.unwrap().spread;
    assert!(
        (spread / expected - 1.0).abs() < 0.35,
        "{spread} {expected}"
    );
    for node in 0..map.grid.len() {
        if (map.grid.place(node).x - 60.0).abs() < 8.0 {
            map.mask[node] = Mask::Defect;
        }
    }
    for device in uniform_areas(&map, &search) {
        assert!(device.found.masked_share <= 0.05);
        assert!((device.centre.x - 60.0).abs() > 10.0);
    }
}

/// A twist that grows evenly: the wanted band has a known share of the area; noise as large as the band
/// blurs what is counted and not what is corrected.
#[test]
fn the_share_of_a_wanted_twist_is_without_noise() {
    let wanted = WantedTwist {
        twist: 0.025,
        within: 0.001,
    };
    let exact = made(|p| 0.02 + 1e-4 * p.x, 0.0);
    let found = WantedArea::new(&exact, 0..exact.grid.len(), &wanted).unwrap();
    // 20 nm of the 118 nm that the sheared grid spans along x.
    assert!((found.measured - 20.0 / 120.0).abs() < 0.02, "{found:?}");
    assert!((found.measured - found.corrected).abs() < 1e-12);
    // A normal distribution of twists of width v about the wanted one, each measured with noise as wide.
    let mut noisy = made(|_| 0.025, 0.001);
    let mut rng = crate::numbers::rng::stream(5, "wanted", 0);
    let mut normal = || -> f64 {
        use rand_distr::{Distribution, StandardNormal};
        StandardNormal.sample(&mut rng)
    };
    for value in &mut noisy.twist.value {
        *value = (0.025 + 0.001 * (normal() + normal())) as f32;
    }
    let found = WantedArea::new(&noisy, 0..noisy.grid.len(), &wanted).unwrap();
    // erf(1/√2) of the true twists; erf(1/2) of the measured ones.
    assert!((found.corrected - 0.6827).abs() < 0.02, "{found:?}");
    assert!((found.measured - 0.5205).abs() < 0.03, "{found:?}");
    assert!(found.certain < found.measured && found.possible > found.corrected);
}

/// Smoothing moves the mean of `½ c x²` by `½ w² c`; a straight field by nothing. Noise is no curvature.
#[test]
fn blur_is_told_by_the_curvature() {
    let box_ = Region::rectangle("b", Vector2::new(30.0, 30.0), [50.0, 40.0]);
    let blur = |map: &TwistStrainMap| RegionStatistics::new(map, &box_).twist.unwrap();
    let bent = blur(&made(|p| 0.02 + 0.5e-6 * (p.x - 50.0).powi(2), 1e-9));
    let expected = 0.5 * 36.0 * 1e-6;
    assert!(
        (bent.blur / expected - 1.0).abs() < 0.02,
        "{} {expected}",
        bent.blur
    );
    assert!((bent.sigma / bent.blur - 1.0).abs() < 1e-3);
    let straight = blur(&made(|p| 0.02 + 1e-5 * p.x - 2e-5 * p.y, 1e-6));
    assert_eq!(straight.blur, 0.0);
}

/// The means of boxes on a lattice that changes from place to place, against the exact mean of the wave vectors' areas:
/// what smoothing does is in the errors.
#[test]
fn errors_of_means_know_the_smoothing() {
    let mut pulls = Vec::new();
    let mut blurred = 0;
    for seed in 0..16 {
        let mut scene = FieldScene::hexagonal([288, 256], 20.0, 0.3);
        (scene.white, scene.seed) = (0.5, seed);
        scene.ripples = vec![Ripple {
            wave: Vector2::new(0.02, 0.01),
            phase: 0.4 * seed as f64,
            amplitude: [0.35, -0.2],
        }];
        let map = mapped(&scene).0;
        for (centre, size) in [([72.0, 64.0], [80.0, 60.0]), ([60.0, 70.0], [30.0, 24.0])] {
            let region = Region::turned_rectangle("r", centre.into(), size, 0.0);
            let found = RegionStatistics::new(&map, &region).twist.unwrap();
            let truth: Vec<f64> = (0..400)
                .map(|i| {
                    let share = Vector2::new(f64::from(i % 20), f64::from(i / 20)) / 20.0;
                    let away = share.add_scalar(0.025 - 0.5);
                    let away = Vector2::new(away.x * size[0], away.y * size[1]);
                    let pixel = (Vector2::from(centre) + away) * 2.0;
                    exact_twist(&scene.waves(pixel))
                })
                .collect();
            let truth = truth.iter().sum::<f64>() / truth.len() as f64;
            pulls.push((found.mean - truth) / found.sigma);
            blurred += usize::from(found.blur > 0.0);
        }
    }
    assert!(blurred > 8, "{blurred}");
    assert!((0.7..1.35).contains(&rms(&pulls)), "{pulls:?}");
}

/// A uniform lattice in noise through the whole chain; amplitudes of the three first harmonics.
fn simulated(seed: u64, amplitudes: [f64; 3]) -> (TwistStrainMap, f64) {
    let mut scene = FieldScene::hexagonal([288, 256], 20.0, 0.3);
    for (harmonic, amplitude) in scene.harmonics.iter_mut().zip(amplitudes) {
        harmonic.1 = amplitude;
    }
    (scene.white, scene.seed) = (1.0, seed);
    mapped(&scene)
}

/// The twist of layers whose moiré has these wave vectors, rad per pixel of 0.5 nm.
fn exact_twist(pair: &Matrix2<f64>) -> f64 {
    let exact = Waves::<Nm>::new(pair * 2.0, Matrix4::zeros());
    let real = exact.lattice().unwrap();
    let convention = StrainConvention::RealSpace;
    let found = heterostrain::strain::twist_strain(&real, &Material::graphene(), convention);
    found.unwrap().twist
}

/// The map of a scene of 0.5 nm per pixel, and the twist of its lattice without ripples.
fn mapped(scene: &FieldScene) -> (TwistStrainMap, f64) {
    let reference = Reference {
        pair: scene.pair,
        pitch: [0.5; 2],
    };
    let resolution = Resolution {
        window_nm: Some(7.0),
        ..Resolution::default()
    };
    let waves = local_lattices(&scene.image(), &reference, &resolution).unwrap();
    let geometry = Geometry {
        size: [288, 256],
        pixel_to_nm: Matrix2::identity() * 0.5,
        origin: Vector2::zeros(),
        covariance: Matrix4::zeros(),
        from_sensors: false,
        departure: None,
    };
    let map = LatticeMap::new(&waves, &geometry).unwrap();
    let (material, convention) = (Material::graphene(), StrainConvention::RealSpace);
    let whole = scene.pair * 2.0;
    let found = map.twist_strain(&whole, &material, convention).unwrap();
    (TwistStrainMap::new(&map, &found), exact_twist(&scene.pair))
}

/// Over seeds, the means of boxes of several sizes scatter by σ, also where the harmonics are unequal,
/// and nothing but noise is taken for spread.
#[test]
fn errors_of_means_are_those_of_the_noise() {
    let boxes = [
        [8.0, 8.0],
        [30.0, 30.0],
        [80.0, 60.0],
        [70.0, 12.0],
        [12.0, 60.0],
    ];
    // The rest is for what the window may blur.
    let noise = |s: &RegionMean| (s.sigma.powi(2) - s.blur.powi(2)).sqrt();
    // The correlations are those of equal harmonics.
    for (amplitudes, unequal) in [([1.0; 3], 0.0), ([1.0, 0.5, 0.5], 0.15)] {
        let mut pulls = vec![Vec::new(); boxes.len()];
        let mut strains = vec![Vec::new(); boxes.len()];
        let (mut exceeded, mut all) = (0, 0);
        for seed in 0..60 {
            let (map, truth) = simulated(seed, amplitudes);
            for (i, size) in boxes.iter().enumerate() {
                let centre = Vector2::new(72.0, 64.0);
                let region = Region::turned_rectangle("r", centre, *size, 0.0);
                let found = RegionStatistics::new(&map, &region);
                let twist = found.twist.unwrap();
                pulls[i].push((twist.mean - truth) / noise(&twist));
                for e in found.strain.unwrap() {
                    strains[i].push(e.mean / noise(&e));
                }
                // Truth: no spread. `corrected` is significant if `below` were far from it.
                let limit = twist.below / twist.widening;
                let doubt = (limit.powi(2) - twist.corrected.powi(2)) / 1.645;
                exceeded += usize::from(twist.corrected.powi(2) > 1.645 * doubt);
                all += 1;
            }
        }
        for (pulls, size) in pulls.iter().chain(&strains).zip(boxes.iter().cycle()) {
            // Three standard deviations of a root mean square.
            let limit = unequal + 3.0 / (2.0 * pulls.len() as f64).sqrt();
            assert!(
                (rms(pulls) - 1.0).abs() < limit,
                "{amplitudes:?} {size:?}: {} of {}",
                rms(pulls),
                pulls.len()
            );
        }
        let share = exceeded as f64 / f64::from(all);
        assert!(share < 0.12, "{amplitudes:?}: {share}");
    }
}

/// A plane with one wiggle: its slopes, its value at the middle of the frame (half of the nodes masked), and the wiggle as
/// what is left.
#[test]
fn trends_are_planes() {
    let plane = |p: Vector2<f64>| 0.02 + 3e-5 * p.x - 2e-5 * p.y;
    let wiggle = |p: Vector2<f64>| 1e-4 * (p.x * 0.9).sin();
    let mut map = made(|p| plane(p) + wiggle(p), 1e-6);
    for node in 0..map.grid.len() {
        if map.grid.place(node).x > 50.0 {
            map.mask[node] = Mask::Weak;
        }
    }
    let trends = Trends::new(&map).unwrap();
    let found = trends.of(&map.twist).unwrap();
    assert!((found.gradient[0].value - 3e-5).abs() < 1e-6, "{found:?}");
    assert!((found.gradient[1].value + 2e-5).abs() < 1e-6, "{found:?}");
    let middle = map.grid.origin + map.grid.step * Vector2::new(29.5, 24.5);
    assert!(
        (found.middle.value - plane(middle)).abs() < 2e-5,
        "{found:?}"
    );
    assert!(
        (found.rest / (1e-4 / 2f64.sqrt()) - 1.0).abs() < 0.1,
        "{found:?}"
    );
    let mut few = map.clone();
    few.mask.iter_mut().skip(8).for_each(|m| *m = Mask::Weak);
    assert!(Trends::new(&few).is_none());
}

/// Slopes and middles of maps of a lattice that is the same everywhere scatter about the truth as stated, and noise
/// explains the spread.
#[test]
fn trends_have_honest_errors() {
    let mut pulls = [Vec::new(), Vec::new(), Vec::new()];
    let (mut left, mut noise) = (0.0, 0.0);
    for seed in 0..24 {
        let (map, truth) = simulated(300 + seed, [1.0; 3]);
        let trend = Trends::new(&map).unwrap().of(&map.twist).unwrap();
        for (pulls, slope) in pulls.iter_mut().zip(trend.gradient) {
            pulls.push(slope.value / slope.sigma);
        }
        pulls[2].push((trend.middle.value - truth) / trend.middle.sigma);
        left += trend.rest.powi(2);
        noise += trend.noise.powi(2);
    }
    // 24 numbers: 1 ± 0.14.
    for p in &pulls {
        assert!((0.6..1.45).contains(&rms(p)), "{} {pulls:?}", rms(p));
    }
    assert!(left < 0.3 * noise, "{left} {noise}");
}

/// A lattice that changes by ripples with `k w = kappa`, on windows of w = 14 pixels.
fn ripples(kappa: f64, seed: u64) -> FieldScene {
    let mut scene = FieldScene::hexagonal([288, 256], 20.0, 0.3);
    (scene.white, scene.seed) = (0.4, seed);
    // Near the direction that changes the lengths of the waves, and so the twist, most.
    let direction = -0.34 + 0.4 * (seed as f64).sin();
    // Wave vectors change by the same share of a per cent, however long the ripples are.
    let depth = 0.0035 * 14.0 / kappa;
    scene.ripples = vec![Ripple {
        wave: Vector2::new(direction.cos(), direction.sin()) * (kappa / 14.0),
        phase: 0.7 * seed as f64,
        amplitude: [depth, -0.6 * depth],
    }];
    scene
}

/// The twist of a scene at places evenly over a box, nm.
fn twists(scene: &FieldScene, centre: [f64; 2], size: [f64; 2]) -> Vec<f64> {
    let place = |i: u32| {
        let share = Vector2::new(f64::from(i % 40), f64::from(i / 40)) / 40.0;
        let away = share.add_scalar(0.0125 - 0.5);
        Vector2::from(centre) + Vector2::new(away.x * size[0], away.y * size[1])
    };
    (0..1600)
        .map(|i| exact_twist(&scene.waves(place(i) * 2.0)))
        .collect()
}

/// The upper limit of a spread holds what the window takes off it; of a trend over the frame it takes off next to nothing.
#[test]
fn the_limit_of_a_spread_knows_the_smoothing() {
    let (centre, size) = ([72.0, 64.0], [80.0, 60.0]);
    // Beyond, the errors of nodes hold the blur as well, and what is taken off the spread for noise is too much.
    for kappa in [0.5, 0.8] {
        let mut held = 0;
        let (mut limits, mut spreads) = (0.0, 0.0);
        for seed in 0..12 {
            let scene = ripples(kappa, seed);
            let (map, _) = mapped(&scene);
            let region = Region::turned_rectangle("r", centre.into(), size, 0.0);
            let found = RegionStatistics::new(&map, &region).twist.unwrap();
            let truth = twists(&scene, centre, size);
            let mean = truth.iter().sum::<f64>() / truth.len() as f64;
            let spread = rms(&truth.iter().map(|t| t - mean).collect::<Vec<_>>());
            held += usize::from(spread < found.below);
            limits += found.below.powi(2);
            spreads += spread.powi(2);
        }
        assert!(held >= 11, "{kappa}: {held} of 12");
        // A limit that is anything would hold, too.
        assert!(limits < 4.0 * spreads, "{kappa}: {limits} {spreads}");
    }
    let trend = made(|p| 0.02 + 1e-5 * p.x, 1e-6);
    let region = Region::rectangle("r", Vector2::new(20.0, 20.0), [80.0, 60.0]);
    let found = RegionStatistics::new(&trend, &region).twist.unwrap();
    // The window leaves a trend as it is.
    assert!((found.widening - 1.0).abs() < 0.02, "{found:?}");
}

/// What the window does to the share of a wanted twist is said beside it.
#[test]
fn the_share_of_a_wanted_twist_knows_the_smoothing() {
    let (mut off, mut said) = (0.0, 0.0);
    for seed in 0..6 {
        let scene = ripples(1.1, seed);
        let (map, mean) = mapped(&scene);
        let wanted = WantedTwist {
            twist: mean,
            within: 6e-5,
        };
        let found = WantedArea::new(&map, 0..map.grid.len(), &wanted).unwrap();
        let truth = twists(&scene, [72.0, 64.0], [116.0, 100.0]);
        let within = truth.iter().filter(|t| (*t - mean).abs() < wanted.within);
        off += found.corrected - within.count() as f64 / truth.len() as f64;
        said += found.blur;
    }
    assert!(
        off > 0.3 && said > 0.5 * off && said < 1.5 * off,
        "{off} {said}"
    );
}
