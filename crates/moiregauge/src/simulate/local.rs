//! The twist and strain of a lattice at one place, from the forward equation alone.

use heterostrain::strain::{Stacking, moire_pair_of};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

use crate::numbers::MOST_ROUNDS;
use crate::simulate::settings::Sample;

/// Twist (rad), strain vector `ε (cos 2φ, sin 2φ)` with φ in the laboratory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Local {
    pub(crate) twist: f64,
    pub(crate) strain: Vector2<f64>,
}

impl Local {
    /// Those of a lattice that is not bent.
    pub(crate) fn uniform(sample: &Sample) -> Self {
        let stacking = sample.stacking();
        let axis = 2.0 * (stacking.axis_lattice + stacking.lattice_angle + stacking.twist);
        Self {
            twist: stacking.twist,
            strain: Vector2::new(axis.cos(), axis.sin()) * stacking.strain,
        }
    }
}

/// rad: differences that are taken, and the accuracy, far below what is printed.
const STEP: f64 = 1e-7;

/// The twist and strain whose moiré has these waves (columns, rad/nm), near those of the sample: what an analysis with
/// the same convention, Poisson ratio and isotropic strain has to find there. `None` if there are none.
pub(crate) fn local(sample: &Sample, reciprocal: &Matrix2<f64>) -> Option<Local> {
    let uniform = Local::uniform(sample);
    let angle = sample.lattice_angle_deg.to_radians();
    let waves_of = |x: &Vector4<f64>| -> Option<Matrix2<f64>> {
        let strain = Vector2::new(x[1], x[2]);
        let axis_lab = strain.y.atan2(strain.x) / 2.0;
        let stacking = Stacking {
            twist: x[0],
            lattice_angle: x[3],
            strain: strain.norm(),
            axis_lattice: axis_lab - x[3] - x[0],
            biaxial: sample.biaxial_percent / 100.0,
        };
        let pair = moire_pair_of(&stacking, sample.bilayer(), sample.strain_convention).ok()?;
        Some(std::f64::consts::TAU * pair.try_inverse()?.transpose())
    };
    let start = Vector4::new(uniform.twist, uniform.strain.x, uniform.strain.y, angle);
    let mut x = start;
    for _ in 0..MOST_ROUNDS {
        let here = waves_of(&x)?;
        let missing = reciprocal - here;
        let mut jacobian = Matrix4::zeros();
        for k in 0..4 {
            let mut there = x;
            there[k] += STEP;
            let slope = (waves_of(&there)? - here) / STEP;
            jacobian.set_column(k, &Vector4::from_column_slice(slope.as_slice()));
        }
        let step = jacobian
            .lu()
            .solve(&Vector4::from_column_slice(missing.as_slice()))?;
        x += step;
        if step.norm() < 1e-13 {
            break;
        }
    }
    let left = (waves_of(&x)? - reciprocal).norm() / reciprocal.norm();
    // Not converged: no such twist and strain.
    (left < 1e-9).then_some(Local {
        twist: x[0],
        strain: Vector2::new(x[1], x[2]),
    })
}
