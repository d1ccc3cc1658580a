//! Cubic B-splines on a grid of equal cells.

use nalgebra::Vector2;

/// A grid of cells on which splines stand, four along each axis over every cell.
#[derive(Clone, Debug)]
pub(crate) struct Splines {
    low: Vector2<f64>,
    /// Length of a cell.
    cell: Vector2<f64>,
    cells: [usize; 2],
}

/// The sixteen splines that are not zero at a place.
pub(crate) struct Sixteen {
    pub(crate) places: [usize; 16],
    pub(crate) values: [f64; 16],
    pub(crate) along: [f64; 16],
    pub(crate) across: [f64; 16],
}

/// Values and slopes of the four splines over a cell, `t` from 0 to 1.
pub(crate) fn cubic(t: f64) -> [[f64; 4]; 2] {
    let s = 1.0 - t;
    [
        [
            s * s * s / 6.0,
            (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0,
            (4.0 - 6.0 * s * s + 3.0 * s * s * s) / 6.0,
            t * t * t / 6.0,
        ],
        [
            -0.5 * s * s,
            -2.0 * t + 1.5 * t * t,
            2.0 * s - 1.5 * s * s,
            0.5 * t * t,
        ],
    ]
}

impl Splines {
    /// A number of cells along each axis between `low` and `high`.
    pub(crate) fn new([low, high]: [Vector2<f64>; 2], cells: [usize; 2]) -> Self {
        Self {
            low,
            cell: Vector2::from_fn(|i, _| ((high - low)[i] / cells[i] as f64).max(1.0)),
            cells,
        }
    }

    /// Splines along each axis.
    pub(crate) fn size(&self) -> [usize; 2] {
        self.cells.map(|n| n + 3)
    }

    /// Cell and place within it along one axis; beyond the edges the outermost cell goes on.
    pub(crate) fn cell_of(&self, axis: usize, at: f64) -> (usize, f64) {
        let t = (at - self.low[axis]) / self.cell[axis];
        let cell = t.floor().clamp(0.0, self.cells[axis] as f64 - 1.0);
        (cell as usize, (t - cell).clamp(-0.5, 1.5))
    }

    /// The splines at a place, with their slopes along x and y.
    pub(crate) fn at(&self, at: Vector2<f64>) -> Sixteen {
        let (column, u) = self.cell_of(0, at.x);
        let (row, v) = self.cell_of(1, at.y);
        let ([x, dx], [y, dy]) = (cubic(u), cubic(v));
        let width = self.size()[0];
        Sixteen {
            places: std::array::from_fn(|i| (row + i / 4) * width + column + i % 4),
            values: std::array::from_fn(|i| x[i % 4] * y[i / 4]),
            along: std::array::from_fn(|i| dx[i % 4] * y[i / 4] / self.cell.x),
            across: std::array::from_fn(|i| x[i % 4] * dy[i / 4] / self.cell.y),
        }
    }

    /// Calls `each` with every three coefficients in a line, along columns and along rows: their second difference is
    /// how the splines bend.
    pub(crate) fn in_lines(&self, mut each: impl FnMut([usize; 3])) {
        let [width, height] = self.size();
        for row in 0..height {
            (2..width).for_each(|c| each([c - 2, c - 1, c].map(|c| row * width + c)));
        }
        for column in 0..width {
            (2..height).for_each(|r| each([r - 2, r - 1, r].map(|r| r * width + column)));
        }
    }
}
