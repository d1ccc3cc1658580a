//! Which moiré vector belongs to which atomic vector: lattice vectors → strain-free-most labelling.
//!
//! The measured primitive pair `L = [a₁ a₂]` is matched with the atomic pair
//! `A⁰ = a [∠30°, ∠90°]`, whose reciprocal pair lies at 0° and 120°; α is then the orientation of
//! the reciprocal vectors of layer 1. With `M = 2π L⁻ᵀ` the first moiré harmonics,
//! `P = M (G⁰)⁻¹ = (A⁰ L⁻¹)ᵀ` has no dimension and needs no 2π.
//!
//! Every other primitive pair of the same lattice, `L U` with U in SL(2, Z), is as good a name for
//! it. The one with the smallest anisotropic part |q| of P is used; as the determinant is fixed by
//! the area of the cell, it is the pair with the shortest reciprocal vectors.

use nalgebra::{Matrix2, Matrix4, Vector4};

use super::complex_pair::ComplexPair;
use crate::lattice::LatticeVectors;

/// `A⁰`: the atomic vectors at 30° and 90° as columns.
pub(super) fn atomic_pair(lattice_constant_nm: f64) -> Matrix2<f64> {
    let half_root3 = 3.0_f64.sqrt() / 2.0;
    lattice_constant_nm * Matrix2::new(half_root3, 0.0, 0.5, 1.0)
}

/// `P = (A⁰ L⁻¹)ᵀ`; `None` for a lattice without area.
pub(super) fn moire_matrix(basis: &Matrix2<f64>, lattice_constant_nm: f64) -> Option<Matrix2<f64>> {
    let inverse = basis.try_inverse()?;
    let p = (atomic_pair(lattice_constant_nm) * inverse).transpose();
    p.iter().all(|x| x.is_finite()).then_some(p)
}

/// Derivative of `(Re p, Im p, Re q, Im q)` by `(a1x, a1y, a2x, a2y)`: dP = −L⁻ᵀ dLᵀ P.
pub(super) fn moire_matrix_jacobian(
    basis: &Matrix2<f64>,
    moire: &Matrix2<f64>,
) -> Option<Matrix4<f64>> {
    let inverse_transposed = basis.try_inverse()?.transpose();
    let mut jacobian = Matrix4::zeros();
    for component in 0..4 {
        let mut unit = Matrix2::zeros();
        unit[component] = 1.0;
        let change = ComplexPair::from(-inverse_transposed * unit.transpose() * moire);
        jacobian.set_column(
            component,
            &Vector4::new(change.p.re, change.p.im, change.q.re, change.q.im),
        );
    }
    Some(jacobian)
}

/// The same lattice named by its least strained right-handed pair; `None` without area.
pub(super) fn least_strained(lattice: &LatticeVectors) -> Option<LatticeVectors> {
    let anisotropy =
        |basis: &Matrix2<f64>| Some(ComplexPair::from(moire_matrix(basis, 1.0)?).q.norm());
    let mut best = *lattice;
    if best.basis.determinant() < 0.0 {
        best = best.relabelled(&Matrix2::new(0.0, 1.0, 1.0, 0.0));
    }
    let mut smallest = anisotropy(&best.basis)?;
    // Each step shortens the reciprocal vectors, so this ends; a pair from an image needs one.
    loop {
        let mut step = None;
        for change in small_changes() {
            let q = anisotropy(&(best.basis * change))?;
            // Turning all names by 60° changes nothing: do not follow rounding errors.
            if q < smallest * (1.0 - 1e-9) {
                smallest = q;
                step = Some(change);
            }
        }
        match step {
            Some(change) => best = best.relabelled(&change),
            None => return Some(best),
        }
    }
}

/// All matrices of determinant 1 with entries −1, 0, 1.
fn small_changes() -> impl Iterator<Item = Matrix2<f64>> {
    (0..81).filter_map(|code: i32| {
        let entry = |power: u32| f64::from(code / 3_i32.pow(power) % 3 - 1);
        let change = Matrix2::new(entry(0), entry(1), entry(2), entry(3));
        (change.determinant() == 1.0).then_some(change)
    })
}
