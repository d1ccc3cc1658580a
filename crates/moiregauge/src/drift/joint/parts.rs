//! Where the covariance of the jointly fitted lattice comes from.
//!
//! Held at a known motion of the sample (drift, its change, the times of the frames) the lattice would
//! have the covariance `P = (XᵀX)⁻¹` of the remaining columns of the whitened design X, which is the
//! Schur complement of the whole; what is left of the whole is due to the motion. The whitened noise of
//! every row has the variance 1, of which the sensors have a share: their part of the covariance of a
//! wave vector, the instability of positions in a phase. With that share S, `P XᵀSX P` is the part of
//! the sensors.

use nalgebra::{DVector, Matrix4, Matrix4xX};

use crate::drift::joint::arrow::Arrow;
use crate::drift::joint::evaluate::{factor, linearise};
use crate::drift::joint::found::JointFit;
use crate::drift::joint::sums::{ScanSums, Whitened};
use crate::drift::shares::Statistical;

impl JointFit {
    /// The covariance of `waves`, (rad/nm)², as a sum of image noise, drift and sensor noise.
    pub fn statistical(&self) -> Option<Statistical> {
        let layout = &self.layout;
        let rows = linearise(&self.sightings, layout, &self.solution, f64::INFINITY);
        let scatter = self.instability_nm * self.instability_nm;
        let still = self
            .is_motion()
            .map(|motion| if motion { 0.0 } else { 1.0 });
        let mut sums = ScanSums::new(&layout.shape);
        for waves in &rows.waves {
            sums.add(waves.scan, &at_rest(&waves.rows, &still));
        }
        for phases in &rows.phases {
            if let Some(whitened) = phases.whitened(scatter) {
                sums.add(phases.scan, &at_rest(&whitened, &still));
            }
        }
        // What nothing sees is held: the motion, and columns of zeros.
        let held = |d: f64| if d == 0.0 { 1.0 } else { 0.0 };
        let inverse = Arrow::new(&sums, &sums.diagonal().map(held))?;

        let locals = inverse.locals();
        let lattice = |scan: usize| locals[scan].columns(0, 4);
        let mut sensor = Matrix4::zeros();
        for waves in &rows.waves {
            let sighting = &self.sightings[waves.sighting];
            let lower = factor(sighting)?;
            // L⁻¹ S L⁻ᵀ; S is symmetric.
            let half = lower.solve_lower_triangular(&sighting.sensor)?;
            let share = lower.solve_lower_triangular(&half.transpose())?;
            let own: Matrix4<f64> =
                fixed(&(at_rest(&waves.rows, &still).slopes * lattice(waves.scan)));
            sensor += own.transpose() * share * own;
        }
        for phases in &rows.phases {
            let (Some(lower), Some(whitened)) = (phases.factor(scatter), phases.whitened(scatter))
            else {
                continue;
            };
            let half = lower.solve_lower_triangular(&phases.waves)?;
            let own = at_rest(&whitened, &still).slopes * lattice(phases.scan);
            let seen = own.transpose() * half;
            let of_phases = scatter * &seen * seen.transpose();
            sensor += of_phases.fixed_view::<4, 4>(0, 0);
        }

        // Enlarged like the covariance of the fit.
        let scale = self.waves.covariance[(0, 0)] / self.unscaled.shared[(0, 0)];
        let image = inverse.shared.fixed_view::<4, 4>(0, 0) - sensor;
        Some(Statistical::at_known_drift(
            [image, sensor],
            scale,
            &self.waves.covariance,
        ))
    }

    /// Which of the local parameters of a scan say where the sample was when.
    fn is_motion(&self) -> DVector<bool> {
        let layout = &self.layout;
        let mut motion = DVector::repeat(layout.shape.width(), false);
        for (i, _, _) in layout.drift_weights(layout.origin) {
            motion[i] = true;
            motion[i + 1] = true;
        }
        if layout.times_at().is_some() {
            motion[layout.shape.width() - 1] = true;
        }
        motion
    }
}

/// The rows without the derivatives by the motion.
fn at_rest<const N: usize>(rows: &Whitened<N>, still: &DVector<f64>) -> Whitened<N> {
    let mut slopes = rows.slopes.clone();
    for (mut column, still) in slopes.column_iter_mut().zip(still.iter()) {
        column *= *still;
    }
    Whitened {
        residuals: rows.residuals,
        slopes,
    }
}

fn fixed(four: &Matrix4xX<f64>) -> Matrix4<f64> {
    four.fixed_columns::<4>(0).into_owned()
}
