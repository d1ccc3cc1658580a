//! The result: twist, lattice orientation and the heterostrain vector with their covariance.

use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::estimate::Estimate;

/// Twist and uniaxial heterostrain of one moiré lattice.
///
/// Parameters in the order `(θ, α, E₁, E₂)`: θ twist of layer 2 against layer 1 (rad, > 0 by
/// default), α orientation of layer 1 (rad, modulo 60°), `E = ε e^{2iφ_lab}` the strain vector in
/// the laboratory frame (φ_lab the tensile axis, counter-clockwise from x).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwistStrain {
    /// θ, rad.
    pub twist: f64,
    /// α, rad in [0, π/3).
    pub lattice_angle: f64,
    /// `(ε cos 2φ_lab, ε sin 2φ_lab)`, dimensionless.
    pub strain_vector: Vector2<f64>,
    /// Covariance of `(θ, α, E₁, E₂)`.
    pub covariance: Matrix4<f64>,
}

impl TwistStrain {
    /// θ with its uncertainty, rad.
    pub fn twist(&self) -> Estimate {
        Estimate::from_variance(self.twist, self.covariance[(0, 0)])
    }

    /// α with its uncertainty, rad.
    pub fn lattice_angle(&self) -> Estimate {
        Estimate::from_variance(self.lattice_angle, self.covariance[(1, 1)])
    }

    /// Covariance of the strain vector.
    pub fn strain_covariance(&self) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(2, 2).into_owned()
    }
}
