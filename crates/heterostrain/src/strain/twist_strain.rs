//! The result: twist, lattice orientation and the heterostrain vector with their covariance.

use std::f64::consts::PI;

use nalgebra::{Matrix4, Vector2, Vector4};

use crate::estimate::Estimate;
use crate::strain::inversion::reduce;
use crate::strain::vector::StrainVector;

/// Twist and uniaxial heterostrain of one moiré lattice.
///
/// Parameters in the order `(θ, α, E₁, E₂)`: θ twist of layer 2 against layer 1 (rad, > 0 by
/// default), α orientation of layer 1 (rad, modulo 60°), `E = ε e^{2iφ_lab}` the strain vector in
/// the laboratory frame (`φ_lab` the axis of ε, counter-clockwise from x: of tension in the
/// real-space form, of compression in the k-space form).
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

    /// The strain with its noise.
    pub fn strain(&self) -> StrainVector {
        StrainVector {
            value: self.strain_vector,
            covariance: self.covariance.fixed_view::<2, 2>(2, 2).into_owned(),
        }
    }

    /// Magnitude of the strain, the bias of a noisy vector's length removed: [`StrainVector::magnitude`].
    pub fn heterostrain(&self) -> Estimate {
        self.strain().magnitude()
    }

    /// `φ_lab`, the axis of the strain in the laboratory, rad in [0, π); `None` unless p < 0.01.
    ///
    /// Axis of tension in the real-space form, of compression in the k-space form.
    pub fn axis_lab(&self) -> Option<Estimate> {
        self.strain().axis()
    }

    /// `φ = φ_lab − α − θ`, the axis counted from layer 1, rad in [0, π); `None` unless p < 0.01.
    ///
    /// Belongs to the α of this result: where α is taken 60° further, φ is 60° less.
    pub fn axis_lattice(&self) -> Option<Estimate> {
        let strain = self.strain();
        let axis = strain.value.y.atan2(strain.value.x) / 2.0 - (self.lattice_angle + self.twist);
        let variance = self.axis_lattice_variance(&self.covariance);
        strain
            .has_axis()
            .then(|| Estimate::from_variance(reduce(axis, PI), variance))
    }

    /// The variance of `φ = φ_lab − α − θ` (rad²) for an error of `(θ, α, E₁, E₂)` with this covariance.
    pub fn axis_lattice_variance(&self, error: &Matrix4<f64>) -> f64 {
        let by_strain = self.strain().axis_gradient();
        let gradient = Vector4::new(-1.0, -1.0, by_strain.x, by_strain.y);
        (gradient.transpose() * error * gradient)[0]
    }
}
