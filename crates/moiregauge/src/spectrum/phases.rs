//! Phases of the first three harmonics of a lattice, with what their errors have in common.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::numbers::exact;

/// Phases of the harmonics K₁, K₂ and K₂ − K₁, rad.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Phases {
    /// The phases.
    #[serde(with = "exact")]
    pub values: [f64; 3],
    /// Their covariance, rad².
    #[serde(with = "exact")]
    pub covariance: Matrix3<f64>,
}

impl Phases {
    /// With errors that have nothing in common.
    pub fn independent(values: [f64; 3], variances: [f64; 3]) -> Self {
        Self {
            values,
            covariance: Matrix3::from_diagonal(&Vector3::from(variances)),
        }
    }

    /// In another order and with other signs: the phase `h` is `sign` times the old phase `old`, for each
    /// `(old, sign)`.
    #[must_use]
    pub fn relabelled(&self, places: [(usize, f64); 3]) -> Self {
        Self {
            values: places.map(|(old, sign)| sign * self.values[old]),
            covariance: Matrix3::from_fn(|i, j| {
                let ((a, s), (b, t)) = (places[i], places[j]);
                s * t * self.covariance[(a, b)]
            }),
        }
    }

    /// With the variance of each phase enlarged by a factor.
    #[must_use]
    pub fn enlarged(&self, factors: [f64; 3]) -> Self {
        let root = Matrix3::from_diagonal(&Vector3::from(factors.map(f64::sqrt)));
        Self {
            values: self.values,
            covariance: root * self.covariance * root,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of three phases with K₃ = K₂ − K₁ in another naming (K₁' = K₂, K₂' = K₂ − K₁, K₃' = −K₁): combinations that mean the
    /// same have the same variance.
    #[test]
    fn names_do_not_matter() {
        let phases = Phases {
            values: [0.3, -0.2, 0.5],
            covariance: Matrix3::new(1.0, 0.2, 0.1, 0.2, 2.0, -0.3, 0.1, -0.3, 3.0),
        };
        let other = phases.relabelled([(1, 1.0), (2, 1.0), (0, -1.0)]);
        assert_eq!(other.values, [-0.2, 0.5, -0.3]);
        let variance = |p: &Phases, a: Vector3<f64>| (a.transpose() * p.covariance * a)[0];
        // φ₁ + φ₂ − φ₃ of the old names is −φ₃ + φ₁ − φ₂ of the new ones.
        let old = variance(&phases, Vector3::new(1.0, 1.0, -1.0));
        let new = variance(&other, Vector3::new(1.0, -1.0, -1.0));
        assert!((old - new).abs() < 1e-12, "{old} {new}");
    }

    #[test]
    fn enlarging_scales_variances_and_keeps_correlations() {
        let covariance = Matrix3::new(1.0, 0.5, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 1.0);
        let phases = Phases {
            values: [0.0; 3],
            covariance,
        };
        let larger = phases.enlarged([4.0, 1.0, 1.0]).covariance;
        assert_eq!((larger[(0, 0)], larger[(0, 1)]), (4.0, 1.0));
    }
}
