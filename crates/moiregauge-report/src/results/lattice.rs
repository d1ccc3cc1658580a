//! Estimates, lattice vectors, twist and strain as the document holds them.

use std::f64::consts::FRAC_PI_6;

use heterostrain::lattice::Lattice;
use heterostrain::material::Bilayer;
use heterostrain::strain::StrainDraw;
use heterostrain::strain::{TwistStrain, naive_twist};
use heterostrain::{Estimate, TotalEstimate};
use moiregauge::meaning::Budget;
use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::convert::{PERCENT, degree, estimate, estimate_in_all, number, pair, square};
use super::estimate::ResultEstimate;
use crate::stats::mean_and_deviation;

/// Names of the three vectors.
pub(crate) const NAMES: [&str; 3] = ["L1", "L2", "L3"];

/// One lattice vector.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LatticeVector {
    /// Component to the right, nm.
    pub x_nm: Option<f64>,
    /// Component up, nm.
    pub y_nm: Option<f64>,
    /// Covariance of (x, y), nm².
    pub covariance_nm2: [[Option<f64>; 2]; 2],
    /// Length, nm.
    pub wavelength_nm: ResultEstimate,
    /// Direction, degrees counter-clockwise from x, in (−180, 180].
    pub polar_angle_deg: Option<f64>,
    /// One standard deviation of the direction, degrees.
    pub polar_angle_sigma_deg: Option<f64>,
    /// 2 arcsin(a/2λ), degrees: the twist if nothing were strained; `null` beyond 30°, where the vector is that of atoms.
    pub naive_twist_deg: ResultEstimate,
}

impl LatticeVector {
    pub(crate) fn of(lattice: &Lattice, index: usize, bilayer: Bilayer<'_>) -> Self {
        let vector = lattice.vector(index);
        let wavelength = lattice.wavelength(index);
        let angle = estimate(lattice.polar_angle(index), degree());
        Self {
            x_nm: number(vector.x),
            y_nm: number(vector.y),
            covariance_nm2: square(&lattice.vector_covariance(index), 1.0),
            wavelength_nm: estimate(wavelength, 1.0),
            polar_angle_deg: angle.value,
            polar_angle_sigma_deg: angle.sigma,
            naive_twist_deg: estimate(naive(wavelength, bilayer), degree()),
        }
    }

    pub(crate) fn all(lattice: &Lattice, bilayer: Bilayer<'_>) -> [Self; 3] {
        [0, 1, 2].map(|index| Self::of(lattice, index, bilayer))
    }

    /// The three vectors of a mean lattice.
    pub(crate) fn of_mean(lattice: &Lattice, budget: &Budget, bilayer: Bilayer<'_>) -> [Self; 3] {
        let lengths = [0, 1, 2].map(|index| budget.wavelength(lattice, index));
        Self::with_lengths(lattice, &lengths, bilayer)
    }

    /// The three vectors with the totals of their lengths.
    pub(crate) fn with_lengths(
        lattice: &Lattice,
        lengths: &[TotalEstimate; 3],
        bilayer: Bilayer<'_>,
    ) -> [Self; 3] {
        [0, 1, 2].map(|index| Self {
            wavelength_nm: estimate_in_all(lengths[index], 1.0),
            ..Self::of(lattice, index, bilayer)
        })
    }
}

/// The twist if nothing were strained; none where it would be beyond 30°: the vector is that of atoms.
fn naive(wavelength: Estimate, bilayer: Bilayer<'_>) -> Estimate {
    let found = naive_twist(wavelength, bilayer);
    if found.value > FRAC_PI_6 {
        Estimate::new(f64::NAN, f64::NAN)
    } else {
        found
    }
}

/// Twist and heterostrain of one lattice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TwistStrainResult {
    /// Twist of layer 2 against layer 1, degrees.
    pub twist_deg: ResultEstimate,
    /// Magnitude of the uniaxial heterostrain with the noise bias removed, per cent.
    pub heterostrain_percent: ResultEstimate,
    /// Orientation of layer 1, degrees in [0, 60).
    pub lattice_angle_deg: ResultEstimate,
    /// Axis of the strain in the laboratory, degrees in [0, 180); `null` unless significant.
    pub strain_axis_lab_deg: Option<ResultEstimate>,
    /// Axis of the strain from layer 1, degrees in [0, 180); `null` unless significant.
    pub strain_axis_lattice_deg: Option<ResultEstimate>,
    /// (ε cos 2φ, ε sin 2φ) with φ the axis in the laboratory, per cent. Average this, not the magnitude.
    pub strain_vector_percent: [Option<f64>; 2],
    /// Covariance of the strain vector, per cent².
    pub strain_vector_covariance: [[Option<f64>; 2]; 2],
    /// One standard deviation of each component with everything, calibration and model included, per cent; as
    /// `sigma_total` of the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strain_vector_sigma_total_percent: Option<[Option<f64>; 2]>,
    /// Probability that noise alone gives such a strain vector.
    pub strain_p_value: Option<f64>,
    /// Upper limit of the magnitude of the strain, 95 % confidence, per cent.
    pub strain_upper_limit_95_percent: Option<f64>,
    /// The interval that holds the magnitude of the strain with 95 % confidence, or more, per cent; it
    /// begins at 0 where noise alone may explain the strain.
    pub strain_interval_95_percent: [Option<f64>; 2],
}

impl From<&TwistStrain> for TwistStrainResult {
    fn from(result: &TwistStrain) -> Self {
        let axis = |angle: Estimate| estimate(angle, degree());
        Self {
            twist_deg: estimate(result.twist(), degree()),
            heterostrain_percent: estimate(result.heterostrain(), PERCENT),
            lattice_angle_deg: estimate(result.lattice_angle(), degree()),
            strain_axis_lab_deg: result.axis_lab().map(axis),
            strain_axis_lattice_deg: result.axis_lattice().map(axis),
            strain_vector_percent: pair(result.strain_vector, PERCENT),
            strain_vector_covariance: square(&result.strain().covariance, PERCENT * PERCENT),
            strain_vector_sigma_total_percent: None,
            strain_p_value: number(result.strain().p_value()),
            strain_upper_limit_95_percent: number(result.strain().upper_limit_95() * PERCENT),
            strain_interval_95_percent: result
                .strain()
                .interval_95()
                .map(|end| number(end * PERCENT)),
        }
    }
}

impl TwistStrainResult {
    /// Twist and strain of a mean lattice, with the totals of its budget.
    pub fn of_mean(found: &TwistStrain, budget: &Budget) -> Self {
        let axis = |angle| estimate_in_all(angle, degree());
        let totals = budget
            .strain_vector(found)
            .map(|part| number(part.total * PERCENT));
        Self {
            twist_deg: estimate_in_all(budget.twist(found), degree()),
            heterostrain_percent: estimate_in_all(budget.heterostrain(found), PERCENT),
            lattice_angle_deg: estimate_in_all(budget.lattice_angle(found), degree()),
            strain_axis_lab_deg: budget.axis_lab(found).map(axis),
            strain_axis_lattice_deg: budget.axis_lattice(found).map(axis),
            strain_vector_sigma_total_percent: totals.iter().any(Option::is_some).then_some(totals),
            ..found.into()
        }
    }
}

/// Mean and spread of the Monte Carlo draws of twist and strain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StrainMonteCarlo {
    /// Number of draws.
    pub draws: usize,
    /// Twist, degrees.
    pub twist_deg: ResultEstimate,
    /// Orientation of layer 1, degrees.
    pub lattice_angle_deg: ResultEstimate,
    /// Mean strain vector, per cent.
    pub strain_vector_percent: [Option<f64>; 2],
    /// Covariance of the drawn strain vectors, per cent².
    pub strain_vector_covariance: [[Option<f64>; 2]; 2],
}

impl StrainMonteCarlo {
    /// `None` where nothing was drawn.
    pub(crate) fn of(draws: &[StrainDraw]) -> Option<Self> {
        if draws.is_empty() {
            return None;
        }
        let spread = |values: Vec<f64>| {
            let (mean, deviation) = mean_and_deviation(&values);
            estimate(Estimate::new(mean, deviation), degree())
        };
        let n = draws.len() as f64;
        let mean = draws
            .iter()
            .fold(Vector2::zeros(), |s, d| s + d.strain_vector)
            / n;
        let covariance = draws.iter().fold(Matrix2::zeros(), |c, d| {
            let from_mean = d.strain_vector - mean;
            c + from_mean * from_mean.transpose()
        }) / (n - 1.0);
        Some(Self {
            draws: draws.len(),
            twist_deg: spread(draws.iter().map(|d| d.twist).collect()),
            lattice_angle_deg: spread(draws.iter().map(|d| d.lattice_angle).collect()),
            strain_vector_percent: pair(mean, PERCENT),
            strain_vector_covariance: square(&covariance, PERCENT * PERCENT),
        })
    }
}
