//! The nodes of a map: where they lie, and the local lattice at each.

use heterostrain::lattice::Waves;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector3};

use crate::window::mask::Mask;

/// Where the nodes of a map lie: `origin + step · (column, row)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Node (0, 0), nm.
    pub origin: Vector2<f64>,
    /// Columns: the way to the next node in a row, and to the next row, nm.
    pub step: Matrix2<f64>,
}

impl Grid {
    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Place of a node, counted row by row, nm.
    pub fn place(&self, node: usize) -> Vector2<f64> {
        let (column, row) = (node % self.size[0], node / self.size[0]);
        self.origin + self.step * Vector2::new(column as f64, row as f64)
    }

    /// The corners of what it covers, half a step beyond the outer nodes, in order, nm.
    pub fn corners(&self) -> [Vector2<f64>; 4] {
        let [columns, rows] = self.size.map(|n| n as f64 - 0.5);
        [(-0.5, -0.5), (columns, -0.5), (columns, rows), (-0.5, rows)]
            .map(|(c, r)| self.origin + self.step * Vector2::new(c, r))
    }

    /// From where to where it reaches along x and along y, nm.
    pub fn extent(&self) -> [[f64; 2]; 2] {
        let corners = self.corners();
        [0, 1].map(|axis| {
            let along = corners.iter().map(|c| c[axis]);
            along.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| {
                [l.min(v), h.max(v)]
            })
        })
    }
}

/// A local lattice on the sample.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct LatticeNode {
    /// Whether it is to be believed.
    pub mask: Mask,
    /// q₁, q₂ as columns, rad/nm, with the covariance of (q₁x, q₁y, q₂x, q₂y); NaN where there is none.
    pub waves: Waves,
    /// χ² of the closure of all harmonics.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub freedom: usize,
    /// Signal power over noise power under the window.
    pub signal_to_noise: f64,
    /// Phases of q₁ and q₂ of the pattern at the node, rad, modulo 2π, and that of the third harmonic less their
    /// difference; NaN where they are not known.
    pub phases: Vector3<f64>,
    /// Displacement of the pattern against the mean lattice of the good nodes, nm, and its covariance; NaN
    /// where it could not be followed.
    pub displacement: Vector2<f64>,
    /// See `displacement`, nm².
    pub displacement_covariance: Matrix2<f64>,
}

impl LatticeNode {
    /// A place that has no lattice, and why.
    pub(crate) fn nothing(mask: Mask) -> Self {
        Self {
            mask,
            waves: Waves::new(Matrix2::repeat(f64::NAN), Matrix4::repeat(f64::NAN)),
            chi2: f64::NAN,
            freedom: 0,
            signal_to_noise: 0.0,
            phases: Vector3::repeat(f64::NAN),
            displacement: Vector2::repeat(f64::NAN),
            displacement_covariance: Matrix2::repeat(f64::NAN),
        }
    }
}
