//! Does the fit agree with its own scans? Leave-one-out and a bootstrap, without fitting anew.
//!
//! At the solution the problem is linear: with the whitened residuals e and the design X of all rows,
//! normal matrix `N = XᵀX` and `C = N⁻¹`,
//!   the residual of scan i has the covariance `S = I − X_i C X_iᵀ`, and `eᵀ S⁺ e` is the χ² of the scan
//!   against the fit of all others;
//!   without scan i the solution moves by `−C X_iᵀ S⁺ e_i`;
//!   with weights `w_i` of the scans it moves by `(Σ w_i N_i)⁻¹ Σ w_i X_iᵀ e_i`.
//! N has the shape of an arrow, so that each of these takes a few products.

use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector, Matrix, Matrix2, RowDVector, Vector2};
use rand::RngExt as _;
use rayon::prelude::*;

use crate::drift::joint::arrow::{Arrow, BlockSums};
use crate::drift::joint::evaluate::{Linearised, linearise, phases};
use crate::drift::joint::found::JointFit;
use crate::drift::joint::instability::Displacements;
use crate::drift::joint::sums::ScanSums;
use crate::numbers::interrupt;
use crate::numbers::rng::stream;

/// Directions in which a scan alone determines a parameter have a residual of zero: below this share of the largest
/// eigenvalue of S they are left out. Any small number above rounding.
const NULL: f64 = 1e-6;

/// Damping that holds what nothing determines: times of scans that were not drawn. Any number far below 1 and above
/// rounding.
const HELD: f64 = 1e-10;

/// The scatter of positions (variance) is the same with or without a scan if it changes by no more than this: it changes χ² as
/// little. A scan that stands out among fewer than some thousand changes it by more (its χ² is beyond 26, of as many as
/// there are), so that it never excuses itself.
const SAME: f64 = 0.01;

/// One scan against all others.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
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
#[non_exhaustive]
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
        let all = Solved::new(self);
        let Some(first) = Step::new(&all, self.instability_nm) else {
            return Vec::new();
        };
        let scatter = self.instability_nm * self.instability_nm;
        let seen = self.terms.phases.then(|| {
            let locals = self.unscaled.locals();
            Displacements::new(&all.rows.phases, &locals, scatter)
        });
        let shape = &self.layout.shape;
        // Where the others do not scatter, which is one step for all.
        let still = OnceLock::new();
        (0..shape.blocks.len())
            .into_par_iter()
            .filter_map(|scan| {
                let alone = first.without(scan)?;
                let Some(seen) = &seen else {
                    return Some(alone);
                };
                let change = &alone.solution - &self.solution;
                let others = seen.scatter_without(scan, shape, &change);
                if (others * others - scatter).abs() <= SAME * scatter {
                    return Some(alone);
                }
                if others == 0.0 {
                    return still
                        .get_or_init(|| Step::new(&all, 0.0))
                        .as_ref()?
                        .without(scan);
                }
                Step::new(&all, others)?.without(scan)
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
        let shape = &self.layout.shape;
        let rows = linearise(&self.sightings, &self.layout, &self.solution, f64::INFINITY);
        let sums = rows.sums(shape, self.instability_nm);
        let held = held(&sums);
        let Some(parts) = sums.without_clocks(&held).collect::<Option<Vec<_>>>() else {
            return Vec::new();
        };
        (0..draws)
            .into_par_iter()
            .filter_map(|draw| {
                interrupt::check();
                let mut rng = stream(seed, name, draw as u64);
                let mut times = vec![0.0; parts.len()];
                for _ in blocks {
                    for &scan in &blocks[rng.random_range(0..blocks.len())] {
                        times[scan] += 1.0;
                    }
                }
                let mut drawn = BlockSums::new(shape);
                for (scan, part) in parts.iter().enumerate().filter(|(i, _)| times[*i] > 0.0) {
                    drawn.add(scan, part, times[scan]);
                }
                let mut x = self.solution.clone();
                let mut shared = x.rows_mut(0, shape.shared);
                shared += drawn.solve_shared(&held)?;
                Some(self.resampled(&x))
            })
            .collect()
    }
}

/// What holds the parameters that nothing determines, on the diagonal.
fn held(sums: &ScanSums) -> DVector<f64> {
    sums.diagonal()
        .map(|d| if d > 0.0 { HELD * d } else { HELD })
}

/// The sightings at the solution, and the part of their normal equations that does not depend on how positions scatter.
struct Solved<'a> {
    fit: &'a JointFit,
    rows: Linearised,
    waves: ScanSums,
}

impl<'a> Solved<'a> {
    fn new(fit: &'a JointFit) -> Self {
        let rows = linearise(&fit.sightings, &fit.layout, &fit.solution, f64::INFINITY);
        let waves = rows.sums_without_phases(&fit.layout.shape);
        Self { fit, rows, waves }
    }
}

/// A Gauss–Newton step from the solution with another scatter of positions; at its end the gradient is zero.
struct Step<'a> {
    of: &'a Solved<'a>,
    instability: f64,
    inverse: Arrow,
    change: DVector<f64>,
    /// `eᵀe` at its end.
    squares: f64,
}

/// A scan left out, and the whole solution without it.
struct Without {
    left_out: LeftOut,
    solution: DVector<f64>,
}

impl<'a> Step<'a> {
    fn new(of: &'a Solved<'a>, instability: f64) -> Option<Self> {
        let mut sums = of.waves.clone();
        of.rows.add_phases(&mut sums, instability);
        let held = held(&sums);
        let inverse = Arrow::new(&sums, &held)?;
        let right = sums.right();
        let step = inverse.solve(&right);
        let damped = step.component_mul(&step).dot(&held);
        Some(Self {
            of,
            instability,
            inverse,
            squares: sums.squares - step.dot(&right) - damped,
            change: step,
        })
    }

    /// The residuals of a scan at the end of the step, and their derivatives by its local parameters.
    fn own(&self, scan: usize) -> (DVector<f64>, DMatrix<f64>) {
        let (shape, rows) = (&self.of.fit.layout.shape, &self.of.rows);
        let (mut residuals, mut slopes) = (Vec::new(), Vec::new());
        for waves in rows.waves.iter().filter(|waves| waves.scan == scan) {
            residuals.extend(waves.rows.residuals.iter());
            slopes.extend(waves.rows.slopes.row_iter().map(Matrix::into_owned));
        }
        let scatter = self.instability * self.instability;
        for phases in rows.phases.iter().filter(|phases| phases.scan == scan) {
            if let Some(rows) = phases.whitened(scatter) {
                residuals.extend(rows.residuals.iter());
                slopes.extend(rows.slopes.row_iter().map(Matrix::into_owned));
            }
        }
        if let Some([residual, slope]) = rows.clock(scan) {
            let mut row = RowDVector::zeros(shape.width());
            row[shape.width() - 1] = slope;
            residuals.push(residual);
            slopes.push(row);
        }
        let design = DMatrix::from_rows(&slopes);
        let moved = &design * shape.local(scan, &self.change);
        (DVector::from_vec(residuals) - moved, design)
    }

    fn without(&self, scan: usize) -> Option<Without> {
        let fit = self.of.fit;
        let (residual, design) = self.own(scan);
        let seen = &design * self.inverse.local(scan);
        let s = DMatrix::identity(residual.len(), residual.len()) - &seen * design.transpose();
        let eigen = s.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let mut solved = DVector::<f64>::zeros(residual.len());
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
        let mut right = DVector::zeros(fit.solution.len());
        let shape = &fit.layout.shape;
        shape.scatter(scan, &design.tr_mul(&solved), &mut right);
        let solution = &fit.solution + &self.change - self.inverse.solve(&right);
        let left_out = LeftOut {
            scan,
            chi2,
            degrees_of_freedom: freedom,
            rest: (
                self.squares - chi2,
                fit.degrees_of_freedom.saturating_sub(freedom),
            ),
            displacement: fit.displacement(scan, &solution),
            without: fit.resampled(&solution),
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
        let of_scan = self.sightings.iter().filter(|s| s.scan == scan);
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for phases in of_scan.filter_map(|s| phases(s, &self.layout, &x)) {
            let g = &phases.waves;
            normal += g.transpose() * g;
            right += g.transpose() * phases.miss;
        }
        Some(normal.try_inverse()? * right)
    }
}
