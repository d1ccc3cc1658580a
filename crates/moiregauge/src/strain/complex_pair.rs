//! A real 2×2 matrix as two complex numbers: `A z = p z + q z̄` with z = x + iy.
//!
//! The isotropic part and the rotation live in `p`, the anisotropic part in `q`; the singular
//! values are `|p| ± |q|` and the determinant is `|p|² − |q|²`.

use nalgebra::{Complex, Matrix2};

/// The complex form of a real 2×2 matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ComplexPair {
    pub(super) p: Complex<f64>,
    pub(super) q: Complex<f64>,
}

impl From<Matrix2<f64>> for ComplexPair {
    fn from(m: Matrix2<f64>) -> Self {
        Self {
            p: Complex::new(m.m11 + m.m22, m.m21 - m.m12) / 2.0,
            q: Complex::new(m.m11 - m.m22, m.m21 + m.m12) / 2.0,
        }
    }
}
