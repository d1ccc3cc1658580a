//! Where the covariance of the jointly fitted lattice comes from.
//!
//! Held at a known motion of the sample (drift, its change, the times of the frames) the lattice would
//! have the covariance `P = (XᵀX)⁻¹` of the remaining columns of the whitened design X, which is the
//! Schur complement of the whole; what is left of the whole is due to the motion. The whitened noise of
//! every row has the variance 1, of which the sensors have a share: their part of the covariance of a
//! wave vector, the instability of positions in a phase. With that share S, `P XᵀSX P` is the part of
//! the sensors.

use nalgebra::{DMatrix, DVector, Matrix4};

use crate::drift::joint::evaluate::{factor, linearise};
use crate::drift::joint::solve::JointFit;
use crate::drift::shares::Statistical;
use crate::numbers::normal_equations::{NormalEquations, add_square};

impl JointFit {
    /// The covariance of `waves`, (rad/nm)², as a sum of image noise, drift and sensor noise.
    pub fn statistical(&self) -> Option<Statistical> {
        let rows = linearise(
            &self.sightings,
            &self.layout,
            &self.solution,
            f64::INFINITY,
            self.instability_nm,
        );
        let kept = self.not_motion();
        let n = kept.len();
        let design: Vec<DVector<f64>> = rows
            .jacobian
            .iter()
            .map(|row| DVector::from_fn(n, |i, _| row[kept[i]]))
            .collect();
        let mut normal = DMatrix::<f64>::zeros(n, n);
        for row in &design {
            add_square(&mut normal, row);
        }
        // Columns that nothing sees are held.
        let held = |i: usize| if normal[(i, i)] == 0.0 { 1.0 } else { 0.0 };
        let units = NormalEquations::units(&normal);
        let inverse = NormalEquations::new(&normal, units, held)?.inverse();

        let mut shares = DMatrix::<f64>::zeros(n, n);
        let mut at = 0;
        for sighting in &self.sightings {
            let Some(lower) = factor(sighting) else {
                continue;
            };
            let own = DMatrix::from_fn(4, n, |i, j| design[at + i][j]);
            // L⁻¹ S L⁻ᵀ; S is symmetric.
            let half = lower.solve_lower_triangular(&sighting.sensor)?;
            let share = lower.solve_lower_triangular(&half.transpose())?;
            shares += own.transpose() * DMatrix::from_fn(4, 4, |i, j| share[(i, j)]) * own;
            at += 4;
            if rows.phases.iter().any(|p| p.row == at) {
                at += 3;
            }
        }
        let scatter = self.instability_nm * self.instability_nm;
        for phases in &rows.phases {
            let Some(lower) = phases.factor(scatter) else {
                continue;
            };
            let half = lower.solve_lower_triangular(&phases.waves)?;
            let own = DMatrix::from_fn(3, n, |i, j| design[phases.row + i][j]);
            let seen = own.transpose() * half;
            shares += scatter * &seen * seen.transpose();
        }

        // Enlarged like the covariance of the fit.
        let scale = self.waves.covariance[(0, 0)] / self.unscaled[(0, 0)];
        let lattice =
            |m: &DMatrix<f64>| -> Matrix4<f64> { m.fixed_view::<4, 4>(0, 0).into_owned() };
        let sensor = lattice(&(&inverse * shares * &inverse));
        let image = lattice(&inverse) - sensor;
        Some(Statistical::at_known_drift(
            [image, sensor],
            scale,
            &self.waves.covariance,
        ))
    }

    /// The parameters, lattice first, that do not say where the sample was when.
    fn not_motion(&self) -> Vec<usize> {
        let motion: Vec<usize> = self
            .layout
            .drift_weights(self.layout.origin)
            .iter()
            .flat_map(|&(i, _, _)| [i, i + 1])
            .collect();
        (0..self.layout.times_at().unwrap_or(self.layout.size))
            .filter(|i| !motion.contains(i))
            .collect()
    }
}
