//! Does the fit agree with its own scans? Leave-one-out and a bootstrap, without fitting anew.
//!
//! At the solution the problem is linear: with the whitened residuals e and the design X of all rows,
//! normal matrix N = XᵀX and C = N⁻¹,
//!   the residual of scan i has the covariance `S = I − X_i C X_iᵀ`, and `eᵀ S⁺ e` is the χ² of the scan
//!   against the fit of all others;
//!   without scan i the solution moves by `−C X_iᵀ S⁺ e_i`;
//!   with weights w_i of the scans it moves by `(Σ w_i N_i)⁻¹ Σ w_i X_iᵀ e_i`.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rand::RngExt as _;

use super::evaluate::{DRIFT, Linearised, linearise};
use super::solve::JointFit;
use crate::rng::stream;

/// Directions in which a scan alone determines a parameter have a residual of zero: below this share
/// of the largest eigenvalue of S they are left out.
const NULL: f64 = 1e-6;

/// One scan against all others.
#[derive(Clone, Copy, Debug)]
pub struct LeftOut {
    /// The scan.
    pub scan: usize,
    /// χ² of its residuals against the fit of the others.
    pub chi2: f64,
    /// Degrees of freedom of `chi2`.
    pub degrees_of_freedom: usize,
    /// Where the scan stands from where the fit has it, nm; `None` without linked phases.
    pub displacement: Option<Vector2<f64>>,
    /// The result without it.
    pub without: Resampled,
}

/// A result of other scans or other weights.
#[derive(Clone, Copy, Debug)]
pub struct Resampled {
    /// Reciprocal pair, rad/nm.
    pub waves: Matrix2<f64>,
    /// Drift velocity in the middle of the campaign, nm/s.
    pub velocity: Vector2<f64>,
}

impl JointFit {
    /// Every scan against the fit of all others.
    pub fn leave_one_out(&self) -> Vec<LeftOut> {
        let rows = self.rows();
        (0..self.scans(&rows))
            .filter_map(|scan| self.without(scan, &rows))
            .collect()
    }

    /// Results of `draws` samples of the blocks of scans (up and down scans in pairs), drawn with
    /// replacement. Draws that do not determine the result are left out.
    pub fn bootstrap(
        &self,
        blocks: &[Vec<usize>],
        draws: usize,
        seed: u64,
        name: &str,
    ) -> Vec<Resampled> {
        let rows = self.rows();
        let n = self.solution.len();
        let parts: Vec<(DMatrix<f64>, DVector<f64>)> = blocks
            .iter()
            .map(|block| {
                let mut normal = DMatrix::<f64>::zeros(n, n);
                let mut right = DVector::<f64>::zeros(n);
                for i in (0..rows.scans.len()).filter(|&i| block.contains(&rows.scans[i])) {
                    normal.ger(1.0, &rows.jacobian[i], &rows.jacobian[i], 1.0);
                    right.axpy(rows.residuals[i], &rows.jacobian[i], 1.0);
                }
                (normal, right)
            })
            .collect();
        let scale = parts
            .iter()
            .fold(DVector::<f64>::zeros(n), |sum, (normal, _)| {
                sum + normal.diagonal()
            })
            .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 });
        (0..draws)
            .filter_map(|draw| {
                let mut rng = stream(seed, name, draw as u64);
                let mut normal = DMatrix::<f64>::zeros(n, n);
                let mut right = DVector::<f64>::zeros(n);
                for _ in blocks {
                    let (part, side) = &parts[rng.random_range(0..parts.len())];
                    normal += part;
                    right += side;
                }
                // Times of scans that were not drawn are determined by nothing: held by the damping.
                let scaled = DMatrix::from_fn(n, n, |i, j| {
                    let held = if i == j { 1e-9 } else { 0.0 };
                    normal[(i, j)] * scale[i] * scale[j] + held
                });
                let step = scaled.cholesky()?.solve(&right.component_mul(&scale));
                Some(self.moved(&step.component_mul(&scale)))
            })
            .collect()
    }

    fn rows(&self) -> Linearised {
        linearise(
            &self.sightings,
            &self.layout,
            &self.solution,
            f64::INFINITY,
            self.instability_nm,
        )
    }

    fn scans(&self, rows: &Linearised) -> usize {
        rows.scans.iter().max().map_or(0, |last| last + 1)
    }

    fn without(&self, scan: usize, rows: &Linearised) -> Option<LeftOut> {
        let own: Vec<usize> = (0..rows.scans.len())
            .filter(|&i| rows.scans[i] == scan)
            .collect();
        let n = self.solution.len();
        let design = DMatrix::from_fn(own.len(), n, |i, j| rows.jacobian[own[i]][j]);
        let residual = DVector::from_fn(own.len(), |i, _| rows.residuals[own[i]]);
        let seen = &design * &self.unscaled;
        let s = DMatrix::identity(own.len(), own.len()) - &seen * design.transpose();
        let eigen = s.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let mut solved = DVector::<f64>::zeros(own.len());
        let (mut chi2, mut freedom) = (0.0, 0);
        for (value, vector) in eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
        {
            if *value > NULL * largest {
                let along = vector.dot(&residual);
                solved.axpy(along / value, &vector, 1.0);
                chi2 += along * along / value;
                freedom += 1;
            }
        }
        let step = -(seen.transpose() * solved);
        Some(LeftOut {
            scan,
            chi2,
            degrees_of_freedom: freedom,
            displacement: self.displacement(scan, rows),
            without: self.moved(&step),
        })
        .filter(|_| freedom > 0)
    }

    /// Least squares of `G_h·δ = miss_h` over the harmonics and lines of a scan.
    fn displacement(&self, scan: usize, rows: &Linearised) -> Option<Vector2<f64>> {
        let g = self.waves.basis;
        let three = [
            g.column(0).into_owned(),
            g.column(1).into_owned(),
            g.column(1) - g.column(0),
        ];
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        let of_scan = rows
            .phase_rows
            .iter()
            .zip(&rows.phase_misses)
            .filter(|(row, _)| rows.scans[**row] == scan);
        for (k, (_, miss)) in of_scan.enumerate() {
            let unit = three[k % 3].normalize();
            normal += unit * unit.transpose();
            right += unit * miss.value;
        }
        Some(normal.try_inverse()? * right)
    }

    fn moved(&self, step: &DVector<f64>) -> Resampled {
        let x = &self.solution + step;
        Resampled {
            waves: Matrix2::new(x[0], x[2], x[1], x[3]),
            velocity: Vector2::new(x[DRIFT], x[DRIFT + 1]),
        }
    }
}
