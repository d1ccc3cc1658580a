//! The result: twist, lattice orientation and the heterostrain vector with their covariance.

use std::f64::consts::PI;

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

use crate::estimate::Estimate;
use crate::strain::inversion::reduce;
use crate::strain::limit::{interval_95, upper_limit_95};

/// The axis of the strain is quoted only if zero strain would give so large a vector less often.
const SIGNIFICANT: f64 = 0.01;

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

    /// Covariance of the strain vector.
    pub fn strain_covariance(&self) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(2, 2).into_owned()
    }

    /// Magnitude of the strain, the bias of a noisy vector's length removed: `√max(0, |Ê|² − σ²)`.
    ///
    /// σ is the noise across the vector, which is what lengthens it. The uncertainty is the noise
    /// along the vector times the slope of that formula, which is kept finite at zero: one σ covers
    /// 67 % of the truths or more at any strain.
    pub fn heterostrain(&self) -> Estimate {
        let across = self.across();
        let square = (self.strain_vector.norm_squared() - across).max(0.0);
        Estimate::from_variance(
            square.sqrt(),
            self.magnitude_variance(&self.strain_covariance()),
        )
    }

    /// What an error of the strain vector with this covariance does to [`TwistStrain::heterostrain`]:
    /// linear in it, so that variances of several sources add.
    pub fn magnitude_variance(&self, error: &Matrix2<f64>) -> f64 {
        let length = self.strain_vector.norm();
        let along = if length > 0.0 {
            let u = self.strain_vector / length;
            (u.transpose() * error * u)[0]
        } else {
            error.trace() / 2.0
        };
        let across = self.across();
        let square = (length * length - across).max(0.0);
        let steepening = if across > 0.0 {
            across / (square + across)
        } else {
            0.0
        };
        along * (1.0 + steepening)
    }

    /// The variance across the strain vector.
    fn across(&self) -> f64 {
        let length = self.strain_vector.norm();
        let covariance = self.strain_covariance();
        if length > 0.0 {
            let v = Vector2::new(-self.strain_vector.y, self.strain_vector.x) / length;
            (v.transpose() * covariance * v)[0]
        } else {
            covariance.trace() / 2.0
        }
    }

    /// The variance of `φ_lab` (rad²) for an error of the strain vector with this covariance.
    pub fn axis_variance(&self, error: &Matrix2<f64>) -> f64 {
        let e = self.strain_vector;
        let gradient = Vector2::new(-e.y, e.x) / (2.0 * e.norm_squared());
        (gradient.transpose() * error * gradient)[0]
    }

    /// The variance of `φ = φ_lab − α − θ` (rad²) for an error of `(θ, α, E₁, E₂)` with this covariance.
    pub fn axis_lattice_variance(&self, error: &Matrix4<f64>) -> f64 {
        let gradient = self.axis_gradient(1.0);
        (gradient.transpose() * error * gradient)[0]
    }

    /// Derivatives of `φ_lab − frame · (α + θ)` by `(θ, α, E₁, E₂)`.
    fn axis_gradient(&self, frame: f64) -> Vector4<f64> {
        let e = self.strain_vector;
        let double = 2.0 * e.norm_squared();
        Vector4::new(-frame, -frame, -e.y / double, e.x / double)
    }

    /// `φ_lab`, the axis of the strain in the laboratory, rad in [0, π); `None` unless p < 0.01.
    ///
    /// Axis of tension in the real-space form, of compression in the k-space form.
    pub fn axis_lab(&self) -> Option<Estimate> {
        self.axis(0.0)
    }

    /// `φ = φ_lab − α − θ`, the axis counted from layer 1, rad in [0, π); `None` unless p < 0.01.
    ///
    /// Belongs to the α of this result: where α is taken 60° further, φ is 60° less.
    pub fn axis_lattice(&self) -> Option<Estimate> {
        self.axis(1.0)
    }

    /// `φ_lab − frame · (α + θ)`.
    fn axis(&self, frame: f64) -> Option<Estimate> {
        let square = self.strain_vector.norm_squared();
        if square <= 0.0 || self.strain_p_value() >= SIGNIFICANT {
            return None;
        }
        let e = self.strain_vector;
        let gradient = self.axis_gradient(frame);
        let variance = (gradient.transpose() * self.covariance * gradient)[0];
        let axis = e.y.atan2(e.x) / 2.0 - frame * (self.lattice_angle + self.twist);
        Some(Estimate::from_variance(reduce(axis, PI), variance))
    }

    /// How often noise alone makes a strain vector this improbable: `exp(−Êᵀ C⁻¹ Ê / 2)`.
    pub fn strain_p_value(&self) -> f64 {
        if self.strain_vector.norm_squared() <= 0.0 {
            return 1.0;
        }
        // Without an inverse there is a direction without noise: any strain is significant then.
        match self.strain_covariance().try_inverse() {
            Some(inverse) => {
                let chi2 = (self.strain_vector.transpose() * inverse * self.strain_vector)[0];
                (-chi2.max(0.0) / 2.0).exp()
            }
            None => 0.0,
        }
    }

    /// The magnitude that the strain does not exceed, with 95 % confidence.
    ///
    /// From the non-central χ² distribution with the noise of the noisiest direction; never below
    /// the limit for a measured strain of exactly zero, however well noise cancelled.
    pub fn strain_upper_limit_95(&self) -> f64 {
        self.in_sigmas(|r| [0.0, upper_limit_95(r)])[1]
    }

    /// The interval that holds the magnitude of the strain with 95 % confidence, or more.
    ///
    /// From the non-central χ² distribution with the noise of the noisiest direction; it begins at zero
    /// unless noise alone makes so long a vector in less than 2.5 % of cases.
    pub fn strain_interval_95(&self) -> [f64; 2] {
        self.in_sigmas(interval_95)
    }

    /// Limits for a length in units of its noise → limits for that of the strain vector.
    fn in_sigmas(&self, limits: impl Fn(f64) -> [f64; 2]) -> [f64; 2] {
        let sigma = largest_variance(&self.strain_covariance()).sqrt();
        let length = self.strain_vector.norm();
        if sigma > 0.0 {
            limits(length / sigma).map(|limit| sigma * limit)
        } else {
            [length; 2]
        }
    }
}

/// The larger eigenvalue.
fn largest_variance(c: &Matrix2<f64>) -> f64 {
    let half_difference = (c.m11 - c.m22) / 2.0;
    let off = f64::midpoint(c.m12, c.m21);
    (c.trace() / 2.0 + half_difference.hypot(off)).max(0.0)
}
