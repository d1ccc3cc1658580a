//! How far the positions of frames scatter beyond what noise does to their phases.

use nalgebra::{DMatrix, Matrix2};

use crate::drift::joint::evaluate::PhaseMiss;
use crate::numbers::chi2::is_significant;

/// The position scatter s that makes the phases fit: `Σ δᵀ(P + s²)⁻¹ δ` of the displacements
/// δ that they show, with covariance P, becomes the number of components less what the fit has taken up (Paule
/// and Mandel 1982, J. Res. NBS 87, 377). Zero where the noise alone explains them: where chance makes as much in
/// more than 5 % of cases, as with all enlarged errors. `scatter` is the s² (nm²) that the fit was made with, `locals` the
/// covariance that it gives the local parameters of each scan.
pub(crate) fn instability<'a>(
    phases: impl Iterator<Item = &'a PhaseMiss>,
    locals: &[DMatrix<f64>],
    scatter: f64,
) -> f64 {
    let mut freedom = 0.0;
    let mut displacements = Vec::new();
    for phases in phases {
        let known = phases.displacement().zip(phases.factor(scatter));
        let Some((displacement, lower)) = known else {
            continue;
        };
        let (Some(plane), Some(rows)) = (
            lower.solve_lower_triangular(&phases.waves),
            phases.whitened(scatter),
        ) else {
            continue;
        };
        // What of the two displacements, whitened, is left free by the fit.
        let seen = plane.qr().q().tr_mul(&rows.slopes);
        let known = &seen * &locals[phases.scan];
        freedom += 2.0 - known.dot(&seen);
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
