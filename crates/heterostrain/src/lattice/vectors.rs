//! Two vectors with their covariance: of a lattice, or of its waves, in pixels or in nanometres.
//!
//! What they are is in their type, since nothing in the numbers shows that a reciprocal lattice was taken for a real one,
//! or pixels for nanometres.

use std::f64::consts::TAU;
use std::marker::PhantomData;

use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector2, Vector4};

use crate::estimate::Estimate;
use crate::lattice::blocks::{TURN, block, both, reciprocal};

/// Real space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Real {}
/// Reciprocal space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reciprocal {}
/// Pixels of an image, (columns, rows).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Px {}
/// Nanometres, x to the right and y upwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Nm {}

/// Two vectors about 60° apart, with the covariance of their four components.
///
/// The third vector of the hexagon is `second − first`; the other three are the opposites.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair<Space, Unit> {
    /// The two vectors as columns.
    pub basis: Matrix2<f64>,
    /// Covariance of `(a1x, a1y, a2x, a2y)`.
    pub covariance: Matrix4<f64>,
    kind: PhantomData<(Space, Unit)>,
}

/// Two primitive vectors of a lattice: L₁, L₂.
pub type Lattice<Unit = Nm> = Pair<Real, Unit>;
/// Two wave vectors of a lattice, rad per unit of length: `K₁, K₂ = K₃ + K₁`.
pub type Waves<Unit = Nm> = Pair<Reciprocal, Unit>;

impl<Space, Unit> Pair<Space, Unit> {
    /// The columns of `basis`, and the covariance of `(a1x, a1y, a2x, a2y)`.
    pub fn new(basis: Matrix2<f64>, covariance: Matrix4<f64>) -> Self {
        Self {
            basis,
            covariance,
            kind: PhantomData,
        }
    }

    /// Vectors that are known exactly.
    pub fn exact(basis: Matrix2<f64>) -> Self {
        Self::new(basis, Matrix4::zeros())
    }

    /// The vector `index` (0, 1, 2): first, second, second − first.
    pub fn vector(&self, index: usize) -> Vector2<f64> {
        selector(index) * self.flat()
    }

    /// Covariance of [`Pair::vector`].
    pub fn vector_covariance(&self, index: usize) -> Matrix2<f64> {
        let s = selector(index);
        s * self.covariance * s.transpose()
    }

    /// Length of the vector `index`.
    pub fn length(&self, index: usize) -> Estimate {
        let v = self.vector(index);
        let unit = v / v.norm();
        let variance = (unit.transpose() * self.vector_covariance(index) * unit)[0];
        Estimate::from_variance(v.norm(), variance)
    }

    /// Polar angle of the vector `index`, rad counter-clockwise from x, in (−π, π].
    pub fn polar_angle(&self, index: usize) -> Estimate {
        let v = self.vector(index);
        let across = Vector2::new(-v.y, v.x) / v.norm_squared();
        let variance = (across.transpose() * self.vector_covariance(index) * across)[0];
        Estimate::from_variance(v.y.atan2(v.x), variance)
    }

    /// Each vector through the linear map `map` (known exactly).
    #[must_use]
    pub fn mapped(&self, map: &Matrix2<f64>) -> Self {
        self.carried(map)
    }

    /// The same lattice described by the primitive pair `basis · change` (`change` of determinant ±1).
    #[must_use]
    pub fn relabelled(&self, change: &Matrix2<f64>) -> Self {
        let i = Matrix2::identity();
        let big = block(
            &(i * change[(0, 0)]),
            &(i * change[(1, 0)]),
            &(i * change[(0, 1)]),
            &(i * change[(1, 1)]),
        );
        Self::new(self.basis * change, big * self.covariance * big.transpose())
    }

    /// The four components `(a1x, a1y, a2x, a2y)`.
    pub fn flat(&self) -> Vector4<f64> {
        Vector4::from_column_slice(self.basis.as_slice())
    }

    fn carried<Other>(&self, map: &Matrix2<f64>) -> Pair<Space, Other> {
        let big = both(map);
        Pair::new(map * self.basis, big * self.covariance * big.transpose())
    }

    /// The dual pair, with its covariance: the full inverse, not `λ = 2/(√3|K|)`, which holds for undistorted hexagons only.
    fn dual<Other>(&self) -> Option<Pair<Other, Unit>> {
        let basis = reciprocal(&self.basis)?;
        // d(B⁻ᵀ) = −B⁻ᵀ dBᵀ B⁻ᵀ, column by column, then the same recombination of columns.
        let dual = self.basis.try_inverse()?.transpose();
        let mut jacobian = Matrix4::zeros();
        for entry in 0..4 {
            let mut change = Matrix2::zeros();
            change[entry] = 1.0;
            let d = -TAU * dual * change.transpose() * dual;
            let (d1, d2) = (d.column(0).into_owned(), d.column(1).into_owned());
            let column = Matrix2::from_columns(&[d1, d1 + d2]);
            jacobian
                .column_mut(entry)
                .copy_from_slice(column.as_slice());
        }
        Some(Pair::new(
            basis,
            jacobian * self.covariance * jacobian.transpose(),
        ))
    }
}

impl<Unit> Lattice<Unit> {
    /// Length of the vector `index`.
    pub fn wavelength(&self, index: usize) -> Estimate {
        self.length(index)
    }

    /// The wave vectors of this lattice, rad per unit; `None` for parallel vectors.
    pub fn waves(&self) -> Option<Waves<Unit>> {
        self.dual()
    }
}

impl<Unit> Waves<Unit> {
    /// The lattice of these waves, named from 60° further on than the lattice whose [`Lattice::waves`] they are; `None` for
    /// parallel vectors.
    pub fn lattice(&self) -> Option<Lattice<Unit>> {
        self.dual()
    }

    /// The lattice of these waves under the names it had: [`Lattice::waves`] backwards, so that L₁, L₂ and L₃ of a map
    /// are those of the image.
    pub fn lattice_named_alike(&self) -> Option<Lattice<Unit>> {
        Some(self.lattice()?.relabelled(&TURN))
    }
}

impl<Space> Pair<Space, Px> {
    /// On the sample: each vector through the map from pixels (for waves its inverse transpose), known exactly.
    pub fn in_nm(&self, map: &Matrix2<f64>) -> Pair<Space, Nm> {
        self.carried(map)
    }
}

impl<Space> Pair<Space, Nm> {
    /// In an image: each vector through the map to pixels (for waves its inverse transpose), known exactly.
    pub fn in_pixels(&self, map: &Matrix2<f64>) -> Pair<Space, Px> {
        self.carried(map)
    }
}

fn selector(index: usize) -> Matrix2x4<f64> {
    let (c1, c2) = [(1.0, 0.0), (0.0, 1.0), (-1.0, 1.0)][index];
    Matrix2x4::new(c1, 0.0, c2, 0.0, 0.0, c1, 0.0, c2)
}
