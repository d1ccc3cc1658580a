//! A strain as a vector, `E = ε e^{2iφ}`: unbiased and nearly normal, which its length and its axis are not.

use std::f64::consts::PI;

use nalgebra::{Matrix2, Vector2};

use crate::estimate::Estimate;
use crate::strain::inversion::reduce;
use crate::strain::limit::{interval_95, upper_limit_95};

/// The axis of the strain is quoted only if zero strain would give so large a vector less often: 1 %, a convention.
const SIGNIFICANT: f64 = 0.01;

/// A strain in the laboratory frame, and its noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrainVector {
    /// `(ε cos 2φ, ε sin 2φ)`, dimensionless; φ counter-clockwise from x.
    pub value: Vector2<f64>,
    /// Covariance of the two components.
    pub covariance: Matrix2<f64>,
}

impl StrainVector {
    /// The length, the bias of a noisy vector's length removed: `√max(0, |Ê|² − σ²)`.
    ///
    /// σ is the noise across the vector, which is what lengthens it. The uncertainty is the noise
    /// along the vector times the slope of that formula, which is kept finite at zero: one σ covers
    /// 67 % of the truths or more at any strain.
    pub fn magnitude(&self) -> Estimate {
        let square = (self.value.norm_squared() - self.across()).max(0.0);
        Estimate::from_variance(square.sqrt(), self.magnitude_variance(&self.covariance))
    }

    /// What an error of the vector with this covariance does to [`StrainVector::magnitude`]: linear in it, so that
    /// variances of several sources add.
    pub fn magnitude_variance(&self, error: &Matrix2<f64>) -> f64 {
        let length = self.value.norm();
        let along = if length > 0.0 {
            let u = self.value / length;
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

    /// The variance across the vector.
    fn across(&self) -> f64 {
        let length = self.value.norm();
        if length > 0.0 {
            let v = Vector2::new(-self.value.y, self.value.x) / length;
            (v.transpose() * self.covariance * v)[0]
        } else {
            self.covariance.trace() / 2.0
        }
    }

    /// φ, rad in [0, π); `None` unless p < 0.01.
    pub fn axis(&self) -> Option<Estimate> {
        let axis = self.value.y.atan2(self.value.x) / 2.0;
        self.has_axis().then(|| {
            Estimate::from_variance(reduce(axis, PI), self.axis_variance(&self.covariance))
        })
    }

    /// The variance of φ (rad²) for an error of the vector with this covariance.
    pub fn axis_variance(&self, error: &Matrix2<f64>) -> f64 {
        let gradient = self.axis_gradient();
        (gradient.transpose() * error * gradient)[0]
    }

    /// Derivatives of φ by the components.
    pub(crate) fn axis_gradient(&self) -> Vector2<f64> {
        Vector2::new(-self.value.y, self.value.x) / (2.0 * self.value.norm_squared())
    }

    /// Whether the vector is so long that it has a direction.
    pub(crate) fn has_axis(&self) -> bool {
        self.value.norm_squared() > 0.0 && self.p_value() < SIGNIFICANT
    }

    /// How often noise alone makes a vector this improbable: `exp(−Êᵀ C⁻¹ Ê / 2)`.
    pub fn p_value(&self) -> f64 {
        if self.value.norm_squared() <= 0.0 {
            return 1.0;
        }
        // Without an inverse there is a direction without noise: any strain is significant then.
        match self.covariance.try_inverse() {
            Some(inverse) => {
                let chi2 = (self.value.transpose() * inverse * self.value)[0];
                (-chi2.max(0.0) / 2.0).exp()
            }
            None => 0.0,
        }
    }

    /// The length that the strain does not exceed, with 95 % confidence.
    ///
    /// From the non-central χ² distribution with the noise of the noisiest direction; never below
    /// the limit for a measured strain of exactly zero, however well noise cancelled.
    pub fn upper_limit_95(&self) -> f64 {
        self.in_sigmas(|r| [0.0, upper_limit_95(r)])[1]
    }

    /// The interval that holds the length of the strain with 95 % confidence, or more.
    ///
    /// From the non-central χ² distribution with the noise of the noisiest direction; it begins at zero
    /// unless noise alone makes so long a vector in less than 2.5 % of cases.
    pub fn interval_95(&self) -> [f64; 2] {
        self.in_sigmas(interval_95)
    }

    /// Limits for a length in units of its noise → limits for that of the vector.
    fn in_sigmas(&self, limits: impl Fn(f64) -> [f64; 2]) -> [f64; 2] {
        let sigma = largest_variance(&self.covariance).sqrt();
        let length = self.value.norm();
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
