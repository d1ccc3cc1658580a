//! Local lattices in pixels → in coordinates of the sample at rest, and twist and strain from them.
//!
//! One linear map for all: a frame's pixels lie at `r = r₀ + (J − D τᵀ) n` on a sample that drifts with D
//! (see [`crate::drift::linear`]), so that wave vectors are mapped by the inverse transpose; nm, rad.

use heterostrain::lattice::{Lattice, Waves, both};
use heterostrain::material::Bilayer;
use heterostrain::strain::{FixedBranch, StrainConvention, StrainError, TwistStrain};
use nalgebra::{Matrix2, Vector2, Vector4};
use rayon::prelude::*;

use crate::frame::geometry::Geometry;
use crate::frame::grid_errors::Bends;
use crate::map::displacement;
use crate::map::gauge::Gauge;
use crate::map::nodes::{Grid, LatticeNode};
use crate::map::scanner::straight;
use crate::settings::knobs::Settings;
use crate::window::mask::Mask;
use crate::window::types::WaveMap;

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
    /// How the grid may be bent.
    pub bends: Bends,
    /// Row by row.
    pub nodes: Vec<LatticeNode>,
}

impl LatticeMap {
    /// Takes a map in pixels to the sample. `at_rest` is the geometry of the frame without drift,
    /// or the geometry itself where the drift is not known.
    ///
    /// `None` where the geometry is singular.
    pub fn new(map: &WaveMap, at_rest: &Geometry) -> Option<Self> {
        let map = &*straight(map, at_rest);
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
            bends: at_rest.bends(),
            nodes,
        })
    }

    /// Puts all places of the map elsewhere.
    pub(crate) fn move_by(&mut self, way: Vector2<f64>) {
        self.grid.origin += way;
        self.bends.centre += way;
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

    /// What bends of the grid that no sensor told may do to twist (rad) and both components of the strain at every node: standard errors,
    /// by the derivatives at `reference`.
    ///
    /// # Errors
    /// As [`heterostrain::strain`] for the reference.
    pub fn of_bends<'a>(
        &self,
        reference: &Matrix2<f64>,
        bilayer: impl Into<Bilayer<'a>>,
        convention: StrainConvention,
        settings: &Settings,
    ) -> Result<Vec<[f32; 3]>, StrainError> {
        let exact = Waves::exact(*reference);
        let no_area = StrainError::NoArea {
            area: reference.determinant(),
        };
        let real = exact.lattice().ok_or(no_area)?;
        let branch = FixedBranch::of(&real, bilayer, convention)?;
        // Of x and of y stretched by the whole.
        let variances = [(1.0, 0.0), (0.0, 1.0)].map(|(x, y)| {
            let change = Matrix2::new(x, 0.0, 0.0, y) * real.basis;
            let change = Vector4::from_column_slice(change.as_slice());
            let stretched = Lattice::new(real.basis, change * change.transpose());
            let covariance = branch.at(&stretched).map(|found| found.covariance);
            covariance.map_or([f64::NAN; 3], |c| [0, 2, 3].map(|i| c[(i, i)]))
        });
        let shares = settings.bends(&self.bends);
        let of = |node: usize| {
            let stretch = self.bends.stretch(self.grid.place(node));
            let stretch = stretch.component_mul(&shares);
            let [along_x, along_y] = variances;
            let variance =
                |i: usize| stretch.x.powi(2) * along_x[i] + stretch.y.powi(2) * along_y[i];
            [0, 1, 2].map(|i| variance(i).sqrt() as f32)
        };
        Ok((0..self.nodes.len()).map(of).collect())
    }

    /// Twist and strain of every node that has a lattice, with the labelling and the branch of
    /// `reference` (wave vectors, rad/nm).
    ///
    /// # Errors
    /// The reference as [`heterostrain::strain`] defines it.
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
