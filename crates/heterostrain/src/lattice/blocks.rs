//! 4×4 matrices for the four components of two vectors.

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
