//! The published drift estimate, for comparison: four approximate matrices, pairwise objective.
//!
//! The matrices drop the drift of the slow component during a fast line, an error of
//! `D_slow/V_fast` ≈ 10⁻⁵ (2·10⁻⁴ at twenty times the drift). The objective is the sum over all
//! pairs of scans of the squared differences of their corrected lattice vectors.
//!
//! # References
//! Tran et al., arXiv:2406.08681, supplementary material (the fourth matrix, fast x and backward, is
//! not printed there).

use nalgebra::{Matrix2, Vector2};

use crate::analysis::Axis;
use crate::lattice::LatticeVectors;

/// One scan as the published method sees it.
#[derive(Clone, Copy, Debug)]
pub struct PaperScan {
    /// Lattice vectors in sensor coordinates, nm.
    pub lattice: LatticeVectors,
    /// Slow axis.
    pub slow_axis: Axis,
    /// Signed tip velocity along the fast axis, nm/s (laboratory sense).
    pub fast_velocity: f64,
    /// Signed velocity along the slow axis, nm/s (laboratory sense; negative is "backward").
    pub slow_velocity: f64,
}

/// The matrix that takes true to observed vectors: `r = T R`.
///
/// With signed velocities the published forward and backward matrices are one expression.
pub fn matrix(scan: &PaperScan, drift: &Vector2<f64>) -> Matrix2<f64> {
    let (vf, vs) = (scan.fast_velocity, scan.slow_velocity);
    match scan.slow_axis {
        Axis::X => {
            let fast = 1.0 + drift.y / (vf - drift.y);
            Matrix2::new(
                1.0 + drift.x / (vs - drift.x),
                0.0,
                drift.y / (vs - drift.x) * fast,
                fast,
            )
        }
        Axis::Y => {
            let fast = 1.0 + drift.x / (vf - drift.x);
            Matrix2::new(
                fast,
                drift.x / (vs - drift.y) * fast,
                0.0,
                1.0 + drift.y / (vs - drift.y),
            )
        }
    }
}

/// Sum over pairs of scans and over the three vectors of the squared differences, nm².
///
/// For n scans it is n times the sum of squared deviations from the mean, which is how it is
/// computed.
pub fn pairwise_objective(scans: &[PaperScan], drift: &Vector2<f64>) -> f64 {
    let squares = |d: Vec<f64>| d.iter().map(|v| v * v).sum::<f64>();
    deviations(scans, drift).map_or(f64::INFINITY, |d| scans.len() as f64 * squares(d))
}

/// The drift that minimises the pairwise objective, nm/s; `None` where it has no minimum.
pub fn pairwise_drift(scans: &[PaperScan]) -> Option<Vector2<f64>> {
    let mut drift = Vector2::zeros();
    let scale = scans
        .iter()
        .map(|s| s.slow_velocity.abs())
        .fold(0.0, f64::max);
    for _ in 0..20 {
        let base = deviations(scans, &drift)?;
        let step = 1e-5 * scale;
        let columns: Vec<Vec<f64>> = (0..2)
            .map(|axis| {
                let mut moved = drift;
                moved[axis] += step;
                let changed = deviations(scans, &moved)?;
                Some(
                    changed
                        .iter()
                        .zip(&base)
                        .map(|(a, b)| (a - b) / step)
                        .collect(),
                )
            })
            .collect::<Option<_>>()?;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let normal = Matrix2::new(
            dot(&columns[0], &columns[0]),
            dot(&columns[0], &columns[1]),
            dot(&columns[1], &columns[0]),
            dot(&columns[1], &columns[1]),
        );
        let right = Vector2::new(dot(&columns[0], &base), dot(&columns[1], &base));
        let change = normal.try_inverse()? * right;
        drift -= change;
        if !(drift.norm() < scale) {
            return None;
        }
        if change.norm() < 1e-12 * scale {
            break;
        }
    }
    Some(drift)
}

/// Deviations of each corrected vector from its mean over the scans, all components in a row.
fn deviations(scans: &[PaperScan], drift: &Vector2<f64>) -> Option<Vec<f64>> {
    let corrected: Vec<Matrix2<f64>> = scans
        .iter()
        .map(|s| Some(matrix(s, drift).try_inverse()? * s.lattice.basis))
        .collect::<Option<_>>()?;
    let mean = corrected.iter().sum::<Matrix2<f64>>() / scans.len() as f64;
    let out = corrected
        .iter()
        .flat_map(|basis| {
            let d = basis - mean;
            let third = d.column(1) - d.column(0);
            [d[0], d[1], d[2], d[3], third.x, third.y]
        })
        .collect();
    Some(out)
}
