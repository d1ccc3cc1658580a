//! A map at places between its nodes.

use heterostrain::lattice::Waves;
use nalgebra::{Matrix2, Vector2, Vector3};

use crate::map::nodes::LatticeNode;
use crate::map::sample::LatticeMap;

/// A map and the way from places to its nodes.
pub(crate) struct View<'a> {
    map: &'a LatticeMap,
    inverse: Matrix2<f64>,
}

impl<'a> View<'a> {
    pub(crate) fn new(map: &'a LatticeMap) -> Option<Self> {
        let inverse = map.grid.step.try_inverse()?;
        Some(Self { map, inverse })
    }

    /// The node next to a place within the map, and where it lies.
    pub(crate) fn nearest(&self, place: Vector2<f64>) -> Option<(&'a LatticeNode, Vector2<f64>)> {
        let grid = &self.map.grid;
        let t = (self.inverse * (place - grid.origin)).map(f64::round);
        let [columns, rows] = grid.size.map(|n| n as f64);
        if t.x < 0.0 || t.y < 0.0 || t.x >= columns || t.y >= rows {
            return None;
        }
        let node = t.y as usize * grid.size[0] + t.x as usize;
        Some((&self.map.nodes[node], grid.place(node)))
    }

    /// The map at a place, between its nodes (bilinear); the mask is the worst of those around.
    pub(crate) fn at(&self, place: Vector2<f64>) -> Option<LatticeNode> {
        let t = self.inverse * (place - self.map.grid.origin);
        let along = |axis: usize| {
            let last = self.map.grid.size[axis] as f64 - 1.0;
            if !(-1e-6..=last + 1e-6).contains(&t[axis]) {
                return None;
            }
            let cell = t[axis].floor().clamp(0.0, (last - 1.0).max(0.0));
            // A single node has no next one.
            Some((cell as usize, (t[axis] - cell).clamp(0.0, last.min(1.0))))
        };
        let ((column, u), (row, v)) = (along(0)?, along(1)?);
        let columns = self.map.grid.size[0];
        let mut out: Option<LatticeNode> = None;
        for (c, r, weight) in [
            (column, row, (1.0 - u) * (1.0 - v)),
            (column + 1, row, u * (1.0 - v)),
            (column, row + 1, (1.0 - u) * v),
            (column + 1, row + 1, u * v),
        ] {
            if weight < 1e-9 {
                continue;
            }
            let node = self.map.nodes[r * columns + c];
            let scaled = LatticeNode {
                waves: Waves::new(node.waves.basis * weight, node.waves.covariance * weight),
                chi2: node.chi2 * weight,
                signal_to_noise: node.signal_to_noise * weight,
                displacement: node.displacement * weight,
                displacement_covariance: node.displacement_covariance * weight,
                ..node
            };
            out = Some(match out {
                None => scaled,
                Some(sum) => LatticeNode {
                    mask: sum.mask.max(node.mask),
                    waves: Waves::new(
                        sum.waves.basis + scaled.waves.basis,
                        sum.waves.covariance + scaled.waves.covariance,
                    ),
                    chi2: sum.chi2 + scaled.chi2,
                    freedom: sum.freedom.max(node.freedom),
                    signal_to_noise: sum.signal_to_noise + scaled.signal_to_noise,
                    // Phases cannot be averaged.
                    phases: Vector3::repeat(f64::NAN),
                    displacement: sum.displacement + scaled.displacement,
                    displacement_covariance: sum.displacement_covariance
                        + scaled.displacement_covariance,
                },
            });
        }
        out
    }
}
