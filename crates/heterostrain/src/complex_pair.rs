//! A real 2×2 matrix as two complex numbers: `A z = p z + q z̄` with z = x + iy.
//!
//! The isotropic part and the rotation live in `p`, the anisotropic part in `q`; the singular
//! values are `|p| ± |q|` and the determinant is `|p|² − |q|²`.

use nalgebra::{Complex, Matrix2};

/// The complex form of a real 2×2 matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComplexPair {
    /// Size and turn.
    pub p: Complex<f64>,
    /// Stretch.
    pub q: Complex<f64>,
}

impl ComplexPair {
    /// The matrix product `self · right`.
    #[must_use]
    pub fn times(&self, right: &Self) -> Self {
        Self {
            p: self.p * right.p + self.q * right.q.conj(),
            q: self.p * right.q + self.q * right.p.conj(),
        }
    }

    /// `|q|/|p|`: how far the matrix is from one that only turns and scales.
    pub fn distortion(&self) -> f64 {
        self.q.norm() / self.p.norm()
    }

    /// The matrix times a real number.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            p: self.p * factor,
            q: self.q * factor,
        }
    }

    /// The matrix itself.
    pub fn matrix(&self) -> Matrix2<f64> {
        let (p, q) = (self.p, self.q);
        Matrix2::new(p.re + q.re, q.im - p.im, q.im + p.im, p.re - q.re)
    }

    /// The inverse matrix; `None` without one.
    pub fn inverse(&self) -> Option<Self> {
        let determinant = self.p.norm_sqr() - self.q.norm_sqr();
        let inverse = Self {
            p: self.p.conj() / determinant,
            q: -self.q / determinant,
        };
        (inverse.p.is_finite() && inverse.q.is_finite()).then_some(inverse)
    }
}

impl From<Matrix2<f64>> for ComplexPair {
    fn from(m: Matrix2<f64>) -> Self {
        Self {
            p: Complex::new(m.m11 + m.m22, m.m21 - m.m12) / 2.0,
            q: Complex::new(m.m11 - m.m22, m.m21 + m.m12) / 2.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Products and inverses are those of the matrices.
    #[test]
    fn algebra_of_matrices() {
        let (a, b) = (
            Matrix2::new(1.1, -0.3, 0.4, 0.8),
            Matrix2::new(0.2, 0.9, -1.3, 0.5),
        );
        let near = |x: ComplexPair, y: ComplexPair| {
            assert!(
                (x.p - y.p).norm() + (x.q - y.q).norm() < 1e-14,
                "{x:?} {y:?}"
            );
        };
        near(
            ComplexPair::from(a).times(&b.into()),
            ComplexPair::from(a * b),
        );
        let inverse = ComplexPair::from(a).inverse().unwrap();
        near(inverse, ComplexPair::from(a.try_inverse().unwrap()));
        near(ComplexPair::from(a).scaled(3.0), ComplexPair::from(a * 3.0));
        assert!((ComplexPair::from(a).matrix() - a).norm() < 1e-15);
        assert_eq!(ComplexPair::from(Matrix2::zeros()).inverse(), None);
    }
}
