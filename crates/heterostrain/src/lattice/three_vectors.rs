//! Three measured lattice vectors → two, using that the third must be second − first.
//!
//! Generalised least squares for `y = (a₁, a₂, a₃)` with any covariance C, also a singular one:
//! with the closure `c = a₁ − a₂ + a₃ = K y`, the best y is `y − C Kᵀ (K C Kᵀ)⁻¹ c`. nm or px.

use nalgebra::{Matrix2, Matrix2x6, Matrix6, SymmetricEigen, Vector2, Vector6};

use crate::lattice::vectors::Lattice;

/// The lattice that fits three vectors best (third = second − first) and how badly they close.
///
/// `covariance` is that of the six components in order. The second number is χ² with two degrees
/// of freedom; infinite where vectors without uncertainty do not close.
pub fn three_vectors(vectors: &[Vector2<f64>; 3], covariance: &Matrix6<f64>) -> (Lattice, f64) {
    let y = Vector6::from_iterator(vectors.iter().flat_map(|v| [v.x, v.y]));
    #[rustfmt::skip]
    let closure = Matrix2x6::new(
        1.0, 0.0, -1.0, 0.0, 1.0, 0.0,
        0.0, 1.0, 0.0, -1.0, 0.0, 1.0,
    );
    let gap = closure * y;
    let (weight, chi2) = inverse_form(
        &(closure * covariance * closure.transpose()),
        &gap,
        y.norm(),
    );
    let gain = covariance * closure.transpose() * weight;
    let best = y - gain * gap;
    let best_covariance = covariance - gain * closure * covariance;
    let lattice = Lattice::new(
        Matrix2::new(best[0], best[2], best[1], best[3]),
        best_covariance.fixed_view::<4, 4>(0, 0).into_owned(),
    );
    (lattice, chi2)
}

/// `S⁻¹` where S has an inverse, zero in the directions without variance, and `gᵀ S⁻¹ g`.
fn inverse_form(s: &Matrix2<f64>, gap: &Vector2<f64>, length: f64) -> (Matrix2<f64>, f64) {
    let eigen = SymmetricEigen::new(*s);
    let largest = eigen.eigenvalues.max();
    let mut weight = Matrix2::zeros();
    let mut chi2 = 0.0;
    for (value, axis) in eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
    {
        let along = axis.dot(gap);
        if *value > 1e-14 * largest {
            weight += axis * axis.transpose() / *value;
            chi2 += along * along / value;
        } else if along.abs() > 1e-12 * length {
            chi2 = f64::INFINITY;
        }
    }
    (weight, chi2)
}
