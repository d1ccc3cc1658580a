//! The displacement of the pattern between the nodes of a map.

use nalgebra::{Matrix2, Vector2};

use crate::frame::resample::all_at;
use crate::map::gauge::Gauge;
use crate::map::nodes::Grid;
use crate::map::sample::LatticeMap;
use crate::window::mask::Mask;

/// The displacement field of a map: cubic between nodes, nothing beyond those whose phase could be followed.
pub(crate) struct Followed {
    pub(crate) gauge: Gauge,
    pub(crate) grid: Grid,
    inverse: Matrix2<f64>,
    to_cells: Matrix2<f64>,
    /// Along x and y, of each node.
    displacements: Vec<[f64; 2]>,
}

impl Followed {
    /// `None` where no phase could be followed.
    pub(crate) fn new(map: &LatticeMap) -> Option<Self> {
        if map.grid.size.iter().any(|n| *n < 2) {
            return None;
        }
        let displacements = map.nodes.iter().map(|node| match node.mask {
            Mask::Good => node.displacement.into(),
            _ => [f64::NAN; 2],
        });
        let gauge = map.gauge?;
        Some(Self {
            to_cells: gauge.vectors.try_inverse()?,
            gauge,
            grid: map.grid,
            inverse: map.grid.step.try_inverse()?,
            displacements: displacements.collect(),
        })
    }

    /// The displacement at a place, nm; `None` where it is not known.
    pub(crate) fn at(&self, place: Vector2<f64>) -> Option<Vector2<f64>> {
        let node = self.inverse * (place - self.grid.origin);
        let found = all_at(&self.displacements, self.grid.size, node);
        found[0].is_finite().then(|| found.into())
    }

    /// What the pattern shows at a place that is displaced by `displacement`: a place of the mean lattice, in moiré vectors
    /// from the node.
    pub(crate) fn cells(&self, place: Vector2<f64>, displacement: Vector2<f64>) -> Vector2<f64> {
        self.to_cells * (place - displacement - self.gauge.node)
    }

    /// Nodes where it is known: their places and displacements, nm.
    pub(crate) fn known(&self) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> {
        let known = self.displacements.iter().enumerate();
        let known = known.filter(|(_, displacement)| displacement[0].is_finite());
        known.map(|(n, displacement)| (self.grid.place(n), Vector2::from(*displacement)))
    }
}
