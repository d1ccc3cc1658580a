//! Does the fit agree with its own scans? Leave-one-out and a bootstrap, without fitting anew.
//!
//! At the solution the problem is linear: with the whitened residuals e and the design X of all rows,
//! normal matrix `N = XᵀX` and `C = N⁻¹`,
//!   the residual of scan i has the covariance `S = I − X_i C X_iᵀ`, and `eᵀ S⁺ e` is the χ² of the scan
//!   against the fit of all others;
//!   without scan i the solution moves by `−C X_iᵀ S⁺ e_i`;
//!   with weights `w_i` of the scans it moves by `(Σ w_i N_i)⁻¹ Σ w_i X_iᵀ e_i`.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rand::RngExt as _;
use rayon::prelude::*;

use crate::drift::joint::evaluate::{Linearised, linearise};
use crate::drift::joint::instability::instability;
use crate::drift::joint::solve::JointFit;
use crate::numbers::normal_equations::{NormalEquations, add_square};
use crate::numbers::rng::stream;

/// Directions in which a scan alone determines a parameter have a residual of zero: below this share of the largest
/// eigenvalue of S they are left out. Any small number above rounding.
const NULL: f64 = 1e-6;

/// Damping that holds what nothing determines: times of scans that were not drawn. Any number far below 1 and above
/// rounding.
const HELD: f64 = 1e-10;

/// One scan against all others.
#[derive(Clone, Copy, Debug)]
pub struct LeftOut {
    /// The scan.
    pub scan: usize,
    /// χ² of its residuals against the fit of the others.
    pub chi2: f64,
    /// Degrees of freedom of `chi2`.
    pub degrees_of_freedom: usize,
    /// χ² of the others about their own fit, and its degrees of freedom.
    pub rest: (f64, usize),
    /// Where the scan stands from where the others have it, nm; `None` without linked phases.
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
    /// Every scan against the fit of all others. The instability of the positions is estimated anew
    /// from the others, so that a displaced scan does not excuse itself.
    pub fn leave_one_out(&self) -> Vec<LeftOut> {
        let scans = 1 + self.sightings.iter().map(|s| s.scan).max().unwrap_or(0);
        let Some(all) = Step::new(self, self.instability_nm) else {
            return Vec::new();
        };
        (0..scans)
            .into_par_iter()
            .filter_map(|scan| {
                let first = all.without(scan)?;
                if !self.terms.phases {
                    return Some(first);
                }
                let others = self.instability_without(scan, &first.solution);
                Step::new(self, others)?.without(scan)
            })
            .map(|step| step.left_out)
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
        let rows = self.rows(&self.solution, self.instability_nm);
        let n = self.solution.len();
        let parts: Vec<(DMatrix<f64>, DVector<f64>)> = blocks
            .iter()
            .map(|block| normal_equations(&rows, n, |scan| block.contains(&scan)))
            .collect();
        let diagonal = parts
            .iter()
            .fold(DVector::<f64>::zeros(n), |sum, (normal, _)| {
                sum + normal.diagonal()
            });
        let scale = NormalEquations::units_of(&diagonal);
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
                let step = NormalEquations::new(&normal, scale.clone(), |_| HELD)?.solve(&right);
                Some(self.resampled(&(&self.solution + step)))
            })
            .collect()
    }

    fn rows(&self, x: &DVector<f64>, instability: f64) -> Linearised {
        linearise(&self.sightings, &self.layout, x, f64::INFINITY, instability)
    }

    /// The instability that the phases of all other scans show at the solution `x` without `scan`.
    fn instability_without(&self, scan: usize, x: &DVector<f64>) -> f64 {
        let rows = self.rows(x, self.instability_nm);
        let others = |row: usize| rows.scans[row] != scan;
        let scatter = self.instability_nm * self.instability_nm;
        instability(&rows, &self.unscaled, scatter, &others)
    }
}

/// A Gauss–Newton step from the solution with other weights; at its end the gradient is zero.
struct Step<'a> {
    fit: &'a JointFit,
    rows: Linearised,
    covariance: DMatrix<f64>,
    solution: DVector<f64>,
}

/// A scan left out, and the whole solution without it.
struct Without {
    left_out: LeftOut,
    solution: DVector<f64>,
}

impl<'a> Step<'a> {
    fn new(fit: &'a JointFit, instability: f64) -> Option<Self> {
        let mut rows = fit.rows(&fit.solution, instability);
        let (normal, right) = normal_equations(&rows, fit.solution.len(), |_| true);
        let units = NormalEquations::units(&normal);
        let covariance = NormalEquations::new(&normal, units, |_| HELD)?.inverse();
        let step = &covariance * right;
        for (residual, row) in rows.residuals.iter_mut().zip(&rows.jacobian) {
            *residual -= row.dot(&step);
        }
        Some(Self {
            fit,
            rows,
            covariance,
            solution: &fit.solution + step,
        })
    }

    fn without(&self, scan: usize) -> Option<Without> {
        let rows = &self.rows;
        let own: Vec<usize> = (0..rows.scans.len())
            .filter(|&i| rows.scans[i] == scan)
            .collect();
        let n = self.solution.len();
        let design = DMatrix::from_fn(own.len(), n, |i, j| rows.jacobian[own[i]][j]);
        let residual = DVector::from_fn(own.len(), |i, _| rows.residuals[own[i]]);
        let seen = &design * &self.covariance;
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
        let all: f64 = rows.residuals.iter().map(|r| r * r).sum();
        let solution = &self.solution - seen.transpose() * solved;
        let left_out = LeftOut {
            scan,
            chi2,
            degrees_of_freedom: freedom,
            rest: (
                all - chi2,
                self.fit.degrees_of_freedom.saturating_sub(freedom),
            ),
            displacement: self.fit.displacement(scan, &solution),
            without: self.fit.resampled(&solution),
        };
        (freedom > 0).then_some(Without { left_out, solution })
    }
}

impl JointFit {
    fn resampled(&self, x: &DVector<f64>) -> Resampled {
        let (_, velocity) = self.layout.motion(x, self.layout.origin);
        Resampled {
            waves: Matrix2::new(x[0], x[2], x[1], x[3]),
            velocity,
        }
    }

    /// Where a scan stands from where the solution `x` has it: least squares of `G_h·δ = miss_h` over
    /// its harmonics and lines, its clock taken as right.
    fn displacement(&self, scan: usize, x: &DVector<f64>) -> Option<Vector2<f64>> {
        let mut x = x.clone();
        if let Some(first) = self.layout.times_at() {
            x[first + scan] = 0.0;
        }
        let rows = self.rows(&x, self.instability_nm);
        let of_scan = rows.phases.iter().filter(|p| rows.scans[p.row] == scan);
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for phases in of_scan {
            let g = &phases.waves;
            normal += g.transpose() * g;
            right += g.transpose() * phases.miss;
        }
        Some(normal.try_inverse()? * right)
    }
}

/// `XᵀX` and `Xᵀe` of the scans that are wanted.
fn normal_equations(
    rows: &Linearised,
    size: usize,
    wanted: impl Fn(usize) -> bool,
) -> (DMatrix<f64>, DVector<f64>) {
    let mut normal = DMatrix::<f64>::zeros(size, size);
    let mut right = DVector::<f64>::zeros(size);
    for i in (0..rows.scans.len()).filter(|&i| wanted(rows.scans[i])) {
        add_square(&mut normal, &rows.jacobian[i]);
        right.axpy(rows.residuals[i], &rows.jacobian[i], 1.0);
    }
    (normal, right)
}
