//! A two-dimensional lattice as it was measured: two primitive vectors and their covariance.

use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector2};

use crate::estimate::Estimate;
use crate::lattice::blocks::block;

/// Two primitive vectors about 60° apart, with the covariance of their four components.
///
/// The third vector of the hexagon is `second − first`; the other three are the opposites.
/// The unit (px or nm) is that of whoever made it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticeVectors {
    /// The two vectors as columns.
    pub basis: Matrix2<f64>,
    /// Covariance of `(a1x, a1y, a2x, a2y)`.
    pub covariance: Matrix4<f64>,
}

impl LatticeVectors {
    /// The vector `index` (0, 1, 2): first, second, second − first.
    pub fn vector(&self, index: usize) -> Vector2<f64> {
        Self::selector(index) * self.flat()
    }

    /// Covariance of [`LatticeVectors::vector`].
    pub fn vector_covariance(&self, index: usize) -> Matrix2<f64> {
        let s = Self::selector(index);
        s * self.covariance * s.transpose()
    }

    /// Length of the vector `index`.
    pub fn wavelength(&self, index: usize) -> Estimate {
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

    /// The lattice seen through the linear map `map` (known exactly).
    #[must_use]
    pub fn mapped(&self, map: &Matrix2<f64>) -> Self {
        let zero = Matrix2::zeros();
        let big = block(map, &zero, &zero, map);
        Self {
            basis: map * self.basis,
            covariance: big * self.covariance * big.transpose(),
        }
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
        Self {
            basis: self.basis * change,
            covariance: big * self.covariance * big.transpose(),
        }
    }

    /// The four components `(a1x, a1y, a2x, a2y)`.
    pub fn flat(&self) -> nalgebra::Vector4<f64> {
        nalgebra::Vector4::from_column_slice(self.basis.as_slice())
    }

    fn selector(index: usize) -> Matrix2x4<f64> {
        let (c1, c2) = [(1.0, 0.0), (0.0, 1.0), (-1.0, 1.0)][index];
        Matrix2x4::new(c1, 0.0, c2, 0.0, 0.0, c1, 0.0, c2)
    }
}
