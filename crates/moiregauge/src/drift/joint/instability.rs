//! How far the positions of frames scatter beyond what noise does to their phases.

use nalgebra::{DMatrix, DVector, Matrix2};

use crate::drift::joint::evaluate::Linearised;
use crate::numbers::chi2::is_significant;

/// The position scatter s that makes the phases of the wanted rows fit: `Σ δᵀ(P + s²)⁻¹ δ` of the displacements
/// δ that they show, with covariance P, becomes the number of components less what the fit has taken up (Paule
/// and Mandel 1982, J. Res. NBS 87, 377). Zero where the noise alone explains them: where chance makes as much in
/// more than 5 % of cases, as with all enlarged errors. `scatter` is the s² (nm²) that `now` and `covariance` were
/// made with.
pub(crate) fn instability(
    now: &Linearised,
    covariance: &DMatrix<f64>,
    scatter: f64,
    wanted: &dyn Fn(usize) -> bool,
) -> f64 {
    let mut freedom = 0.0;
    let mut displacements = Vec::new();
    for phases in now.phases.iter().filter(|p| wanted(p.row)) {
        let known = phases.displacement().zip(phases.factor(scatter));
        let Some((displacement, lower)) = known else {
            continue;
        };
        let Some(plane) = lower.solve_lower_triangular(&phases.waves) else {
            continue;
        };
        // What of the two displacements, whitened, is left free by the fit.
        for unit in plane.qr().q().column_iter() {
            let rows = now.jacobian[phases.row..phases.row + 3].iter();
            let seen: DVector<f64> = rows.zip(&unit).map(|(row, u)| row * *u).sum();
            freedom += 1.0 - seen.dot(&(covariance * &seen));
        }
        displacements.push(displacement);
    }
    let excess = |variance: f64| {
        let squares = displacements.iter().filter_map(|(shift, noise)| {
            let whole = noise + Matrix2::identity() * variance;
            Some(shift.dot(&(whole.try_inverse()? * shift)))
        });
        squares.sum::<f64>() - freedom
    };
    let chi2 = excess(0.0) + freedom;
    if !is_significant(chi2, freedom.round() as usize) {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, 1e-6);
    while excess(high) > 0.0 && high < 1e3 {
        (low, high) = (high, 10.0 * high);
    }
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if excess(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high.sqrt()
}
