//! The displacement of the pattern between the nodes of a map.

use nalgebra::{Matrix2, Vector2};

use crate::frame::image::Image;
use crate::frame::resample::at;
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
    /// Along x and y.
    displacement: [Image; 2],
}

impl Followed {
    /// `None` where no phase could be followed.
    pub(crate) fn new(map: &LatticeMap) -> Option<Self> {
        let [columns, rows] = map.grid.size;
        if columns < 2 || rows < 2 {
            return None;
        }
        let component = |axis: usize| {
            let nodes = map.nodes.iter();
            let values = nodes.map(|node| match node.mask {
                Mask::Good => node.displacement[axis],
                _ => f64::NAN,
            });
            Image::new(rows, columns, values.collect())
        };
        let gauge = map.gauge?;
        Some(Self {
            to_cells: gauge.vectors.try_inverse()?,
            gauge,
            grid: map.grid,
            inverse: map.grid.step.try_inverse()?,
            displacement: [component(0), component(1)],
        })
    }

    /// The displacement at a place, nm; `None` where it is not known.
    pub(crate) fn at(&self, place: Vector2<f64>) -> Option<Vector2<f64>> {
        let node = self.inverse * (place - self.grid.origin);
        let x = at(&self.displacement[0], node);
        x.is_finite()
            .then(|| Vector2::new(x, at(&self.displacement[1], node)))
    }

    /// What the pattern shows at a place that is displaced by `displacement`: a place of the mean lattice, in moiré vectors
    /// from the node.
    pub(crate) fn cells(&self, place: Vector2<f64>, displacement: Vector2<f64>) -> Vector2<f64> {
        self.to_cells * (place - displacement - self.gauge.node)
    }

    /// Nodes where it is known: their places and displacements, nm.
    pub(crate) fn known(&self) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> {
        let [x, y] = &self.displacement;
        let all = (0..self.grid.len()).filter(|&n| x.values[n].is_finite());
        all.map(|n| (self.grid.place(n), Vector2::new(x.values[n], y.values[n])))
    }
}
