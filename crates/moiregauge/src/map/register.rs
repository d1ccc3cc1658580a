//! Registers maps of one pattern by its phases.
//!
//! Time and drift give the position of a later frame only roughly: drift changes between frames, and stages creep. The phases
//! give it precisely: if the pattern of a frame is displaced by s, its phases differ by `−Qᵀ s` at every node. All shared nodes
//! determine s to a small fraction of a pixel, up to a lattice vector; the smallest s is taken. Reversed contrast, as in error
//! signals of trace and retrace, changes all three phases by π. No displacement changes `φ₃ − φ₂ + φ₁`, so its change by π
//! identifies reversed contrast.

use std::f64::consts::{PI, TAU};

use heterostrain::Estimate;
use nalgebra::{Matrix2, Vector2, Vector3};

use crate::map::sample::LatticeMap;
use crate::map::view::View;
use crate::window::mask::Mask;

/// Fewest shared nodes: three by three, one window.
const FEWEST: usize = 9;
/// Smallest length of the mean phasor of the phase differences: 0.7 is a scatter of 0.84 rad. Uniform phases have 0.
const COHERENT: f64 = 0.7;

/// Displacement of the pattern of a map against the maps before it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Registration {
    /// Displacement that was subtracted from the positions of the nodes, along x and y, nm.
    pub shift: [Estimate; 2],
    /// The displacement as a fraction of the period: beyond 0.3 it may be off by a lattice vector.
    pub of_period: f64,
    /// True if the contrast is reversed.
    pub reversed: bool,
}

/// Moves every map after the first onto those before it. `None` for the first, for maps that share too few good nodes
/// with others, and where the phases contradict each other.
pub fn register(maps: &mut [&mut LatticeMap]) -> Vec<Option<Registration>> {
    let mut out = Vec::with_capacity(maps.len());
    for i in 0..maps.len() {
        let (before, rest) = maps.split_at_mut(i);
        let map = &mut *rest[0];
        // The earlier map with the most shared nodes.
        let found = before
            .iter()
            .filter_map(|fixed| shift(fixed, map))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let registration = found.map(|(registration, _)| registration);
        if let Some(found) = &registration {
            map.move_by(-Vector2::new(found.shift[0].value, found.shift[1].value));
        }
        out.push(registration);
    }
    out
}

/// Displacement of the pattern in `map` against `fixed`, and the number of shared nodes.
fn shift(fixed: &LatticeMap, map: &LatticeMap) -> Option<(Registration, f64)> {
    let waves = fixed.mean()?;
    let view = View::new(fixed)?;
    let mut sums = [Vector2::<f64>::zeros(); 3];
    let mut shared = Vec::new();
    for (n, node) in map.nodes.iter().enumerate() {
        if node.mask != Mask::Good || node.phases.iter().any(|p| p.is_nan()) {
            continue;
        }
        let place = map.grid.place(n);
        let Some((near, at)) = view.nearest(place) else {
            continue;
        };
        if near.mask != Mask::Good || near.phases.iter().any(|p| p.is_nan()) {
            continue;
        }
        // Phase from the nearest node to this position, by the mean wave vectors of both nodes.
        let way = 0.5 * (near.waves.basis + node.waves.basis);
        let way = way.tr_mul(&(place - at));
        let difference = node.phases - near.phases - Vector3::new(way.x, way.y, 0.0);
        for (sum, d) in sums.iter_mut().zip(difference.iter()) {
            *sum += Vector2::new(d.cos(), d.sin());
        }
        shared.push(difference.xy());
    }
    if shared.len() < FEWEST {
        return None;
    }
    let count = shared.len() as f64;
    if sums[..2].iter().any(|s| s.norm() < COHERENT * count) {
        return None;
    }
    let mean = Vector2::new(sums[0].y.atan2(sums[0].x), sums[1].y.atan2(sums[1].x));
    let wrap = |x: f64| (x + PI).rem_euclid(TAU) - PI;
    // Nodes within one window have correlated noise: the number of independent ones.
    let cell = map.grid.step.determinant().abs();
    let independent = (count * cell / (4.0 * PI * map.window_nm.powi(2))).clamp(1.0, count);
    let covariance = shared.iter().fold(Matrix2::zeros(), |sum, d| {
        let miss = (d - mean).map(wrap);
        sum + miss * miss.transpose()
    }) / (count * independent);
    let reversed = sums[2].x < -COHERENT * count;
    let mean = mean.map(|phase| wrap(phase - if reversed { PI } else { 0.0 }));
    let back = -waves.transpose().try_inverse()?;
    // The smallest displacement of those that differ by lattice vectors.
    let candidates = (-1..=1).flat_map(|h| (-1..=1).map(move |k| (f64::from(h), f64::from(k))));
    let shift = candidates
        .map(|(h, k)| back * (mean + Vector2::new(h, k) * TAU))
        .min_by(|a, b| a.norm().total_cmp(&b.norm()))?;
    let covariance = back * covariance * back.transpose();
    let period = 2.0 * TAU / (3f64.sqrt() * waves.column(0).norm());
    Some((
        Registration {
            shift: [0, 1].map(|i| Estimate::from_variance(shift[i], covariance[(i, i)])),
            of_period: shift.norm() / period,
            reversed,
        },
        count,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::geometry::Geometry;
    use crate::map::combine;
    use crate::map::local::local_lattices;
    use crate::simulate::field::FieldScene;
    use crate::window::types::{Reference, Resolution};

    /// A frame of the same pattern, cut out elsewhere and said to lie a little off, in noise of its own.
    fn frame(corner: [usize; 2], said: Vector2<f64>, seed: u64) -> LatticeMap {
        let mut scene = FieldScene::rippled(480, 24.0, 0.04);
        scene.white = 0.6;
        scene.seed = seed;
        let mut image = scene.image().cropped(corner, [420, 420]);
        // Dark spots: the phases of three harmonics add up to π.
        image.values.iter_mut().for_each(|v| *v = -*v);
        let reference = Reference {
            pair: scene.pair,
            pitch: [1.0; 2],
        };
        let map = local_lattices(&image, &reference, &Resolution::default()).unwrap();
        let corner = Vector2::from(corner.map(|c| c as f64));
        let geometry =
            Geometry::of_pitch([420, 420], [1.0; 2], 0.0, Vector2::zeros()).expect("pixels");
        let geometry = Geometry {
            origin: corner + said,
            ..geometry
        };
        LatticeMap::new(&map, &geometry).unwrap()
    }

    #[test]
    fn maps_are_put_where_the_pattern_is() {
        let off = [
            Vector2::zeros(),
            Vector2::new(3.3, -1.7),
            Vector2::new(-2.2, 4.1),
        ];
        let corners = [[0, 0], [23, 41], [60, 12]];
        let mut maps: Vec<LatticeMap> = (0..3)
            .map(|i| frame(corners[i], off[i], 7 + i as u64))
            .collect();
        let apart = combine(&maps.iter().collect::<Vec<_>>())
            .unwrap()
            .1
            .unwrap();
        let found = register(&mut maps.iter_mut().collect::<Vec<_>>());
        assert!(found[0].is_none());
        for (found, off) in found.iter().zip(&off).skip(1) {
            let found = found.expect("shared nodes");
            for axis in 0..2 {
                let error = found.shift[axis].value - off[axis];
                assert!(error.abs() < 4.0 * found.shift[axis].sigma, "{found:?}");
                assert!(error.abs() < 0.1, "{found:?}");
            }
        }
        // Put right, maps of a lattice that varies agree better.
        let together = combine(&maps.iter().collect::<Vec<_>>())
            .unwrap()
            .1
            .unwrap();
        assert!(
            together.chi2_per_dof < apart.chi2_per_dof,
            "{together:?} {apart:?}"
        );
        assert!((together.chi2_per_dof - 1.0).abs() < 0.2, "{together:?}");
        // A second time nothing is left to be moved.
        for again in register(&mut maps.iter_mut().collect::<Vec<_>>())
            .iter()
            .flatten()
        {
            assert!(again.shift.iter().all(|s| s.value.abs() < 3.0 * s.sigma));
        }
    }

    /// The other contrast is no shift by half a period.
    #[test]
    fn reversed_contrast_is_no_shift() {
        let off = Vector2::new(1.2, -0.7);
        let mut reversed = frame([0, 0], off, 2);
        for node in &mut reversed.nodes {
            // All three harmonics of −I, the third less the difference of the first two.
            node.phases = node.phases.map(|phase| phase + PI);
        }
        let mut maps = [frame([0, 0], Vector2::zeros(), 1), reversed];
        let found = register(&mut maps.iter_mut().collect::<Vec<_>>());
        let found = found[1].expect("shared nodes");
        assert!(found.reversed);
        for axis in 0..2 {
            let error = found.shift[axis].value - off[axis];
            assert!(error.abs() < 4.0 * found.shift[axis].sigma, "{found:?}");
        }
        let mut alike = [frame([0, 0], Vector2::zeros(), 1), frame([0, 0], off, 2)];
        let found = register(&mut alike.iter_mut().collect::<Vec<_>>());
        assert!(!found[1].expect("shared nodes").reversed);
    }

    /// Another pattern is not forced upon the first.
    #[test]
    fn frames_side_by_side_are_left_alone() {
        let one = frame([0, 0], Vector2::zeros(), 1);
        let mut maps = [one.clone(), frame([0, 0], Vector2::new(500.0, 0.0), 2)];
        let found = register(&mut maps.iter_mut().collect::<Vec<_>>());
        assert_eq!(found, [None, None]);
        let mut turned = one.clone();
        for (n, node) in turned.nodes.iter_mut().enumerate() {
            node.phases.x += 0.02 * (n * n % 977) as f64;
        }
        let mut maps = [one, turned];
        let found = register(&mut maps.iter_mut().collect::<Vec<_>>());
        assert_eq!(found, [None, None]);
    }
}
