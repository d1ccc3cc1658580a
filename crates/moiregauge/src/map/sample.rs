//! Local lattices in pixels → in coordinates of the sample at rest, and twist and strain from them.
//!
//! One linear map for all: a frame's pixels lie at `r = r₀ + (J − D τᵀ) n` on a sample that drifts with D
//! (see [`crate::drift::linear`]), so that wave vectors are mapped by the inverse transpose; nm, rad.

use heterostrain::lattice::{Waves, both};
use heterostrain::material::Bilayer;
use heterostrain::strain::{FixedBranch, StrainConvention, StrainError, TwistStrain};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector3};
use rayon::prelude::*;

use crate::frame::geometry::Geometry;
use crate::map::displacement;
use crate::map::gauge::Gauge;
use crate::window::mask::Mask;
use crate::window::types::WaveMap;

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

/// Local lattices on the sample, in nm.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LatticeMap {
    /// Where the nodes are.
    pub grid: Grid,
    /// Width of the window, nm.
    pub window_nm: f64,
    /// What displacements count from; `None` where no phase could be followed.
    pub gauge: Option<Gauge>,
    /// Row by row.
    pub nodes: Vec<LatticeNode>,
}

impl LatticeMap {
    /// Takes a map in pixels to the sample. `at_rest` is the geometry of the frame without drift,
    /// or the geometry itself where the drift is not known.
    ///
    /// `None` where the geometry is singular.
    pub fn new(map: &WaveMap, at_rest: &Geometry) -> Option<Self> {
        let j = at_rest.pixel_to_nm;
        let dual = j.try_inverse()?.transpose();
        let of_both = both(&dual);
        let followed = displacement::phases(map);
        let good = map.nodes.iter().filter(|n| n.mask == Mask::Good);
        let (sum, count) = good.fold((Matrix2::zeros(), 0.0f64), |(sum, count), node| {
            (sum + node.pair, count + 1.0)
        });
        // ψ = −Qᵀ u.
        let mean = dual * sum / count.max(1.0);
        let back = mean.transpose().try_inverse();
        let back = -back.unwrap_or_else(|| Matrix2::repeat(f64::NAN));
        let unknown = (Vector2::repeat(f64::NAN), Matrix2::repeat(f64::NAN));
        let nodes = map.nodes.par_iter().zip(followed).enumerate();
        let nodes = nodes.map(|(n, (node, followed))| {
            let (followed, covariance) = followed.unwrap_or(unknown);
            LatticeNode {
                mask: node.mask,
                waves: Waves::new(
                    dual * node.pair,
                    of_both * node.covariance * of_both.transpose(),
                ),
                chi2: node.chi2,
                freedom: node.freedom,
                signal_to_noise: node.signal_to_noise,
                phases: map.phases(n),
                displacement: back * followed,
                displacement_covariance: back * covariance * back.transpose(),
            }
        });
        let nodes: Vec<LatticeNode> = nodes.collect();
        let grid = Grid {
            size: map.size,
            origin: at_rest.origin + j * map.first,
            step: j * Matrix2::new(map.step[0], 0.0, 0.0, map.step[1]),
        };
        Some(Self {
            grid,
            window_nm: map.window_nm,
            gauge: Gauge::of(&grid, mean, &nodes),
            nodes,
        })
    }

    /// Puts all places of the map elsewhere.
    pub(crate) fn move_by(&mut self, way: Vector2<f64>) {
        self.grid.origin += way;
        if let Some(gauge) = &mut self.gauge {
            gauge.node += way;
        }
    }

    /// The mean lattice of the good nodes: plain mean of their wave vectors, rad/nm.
    pub fn mean(&self) -> Option<Matrix2<f64>> {
        let good = self.nodes.iter().filter(|n| n.mask == Mask::Good);
        let (sum, count) = good.fold((Matrix2::zeros(), 0.0), |(sum, count), node| {
            (sum + node.waves.basis, count + 1.0)
        });
        (count > 0.0).then(|| sum / count)
    }

    /// Twist and strain of every node that has a lattice, with the labelling and the branch of
    /// `reference` (wave vectors, rad/nm).
    ///
    /// # Errors
    /// What [`heterostrain::strain`] says of the reference.
    pub fn twist_strain<'a>(
        &self,
        reference: &Matrix2<f64>,
        bilayer: impl Into<Bilayer<'a>>,
        convention: StrainConvention,
    ) -> Result<Vec<Option<TwistStrain>>, StrainError> {
        let exact = Waves::exact(*reference);
        let no_area = StrainError::NoArea {
            area: reference.determinant(),
        };
        let real = exact.lattice().ok_or(no_area)?;
        let branch = FixedBranch::of(&real, bilayer, convention)?;
        let found = self.nodes.par_iter().map(|node| {
            if node.waves.basis.iter().any(|x| x.is_nan()) {
                return None;
            }
            branch.at(&node.waves.lattice()?)
        });
        Ok(found.collect())
    }
}
