//! 4×4 matrices for the four components of two vectors, and the dual of a pair.

use nalgebra::{Matrix2, Matrix4};

/// The 4×4 map of `(a₁, a₂)` under one 2×2 matrix for both vectors.
pub fn both(map: &Matrix2<f64>) -> Matrix4<f64> {
    block(map, &Matrix2::zeros(), &Matrix2::zeros(), map)
}

/// The 4×4 matrix of four 2×2 blocks, row by row.
pub fn block(
    a: &Matrix2<f64>,
    b: &Matrix2<f64>,
    c: &Matrix2<f64>,
    d: &Matrix2<f64>,
) -> Matrix4<f64> {
    let mut m = Matrix4::zeros();
    m.fixed_view_mut::<2, 2>(0, 0).copy_from(a);
    m.fixed_view_mut::<2, 2>(0, 2).copy_from(b);
    m.fixed_view_mut::<2, 2>(2, 0).copy_from(c);
    m.fixed_view_mut::<2, 2>(2, 2).copy_from(d);
    m
}

/// `(a₁, a₂) → (a₂, a₂ − a₁)`: the next names, 60° further.
pub(crate) const TURN: Matrix2<f64> = Matrix2::new(0.0, -1.0, 1.0, 1.0);

/// Real-space pair about 60° apart ↔ reciprocal pair about 60° apart, `K₁, K₂ = K₃ + K₁`.
///
/// For vectors `a₁, a₂` at 60° the dual pair (`a_i·b_j = 2π δ_ij`) stands at 120°; the pair
/// returned is `(b₁, b₁ + b₂)`, at 60° again. The function is its own inverse up to a turn by 60°.
pub fn reciprocal(basis: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    let dual = basis.try_inverse()?.transpose() * std::f64::consts::TAU;
    let (b1, b2) = (dual.column(0).into_owned(), dual.column(1).into_owned());
    Some(Matrix2::from_columns(&[b1, b1 + b2]))
}
