//! Lattice and drift as one linear least-squares problem.

use heterostrain::lattice::{Lattice, both};
use nalgebra::{
    DMatrix, Matrix2, Matrix4, Matrix4x2, Matrix4x6, Matrix6, SMatrix, SVector, Vector2, Vector4,
    Vector6,
};

use crate::drift::shares::weighted_mean;

/// Condition number beyond which the scans are said not to determine the drift. Up and down scans have 2, two line
/// rates 8, trace and retrace of one scan 2000: a value between them.
const WORST_CONDITION: f64 = 100.0;
/// Without any noise there is nothing to weigh by: a femtometre keeps it solvable (nm²).
const FLOOR: f64 = 1e-12;

/// One measured lattice with the time gradient of its image.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    /// Lattice vectors in sensor coordinates, nm, all observations labelled alike.
    pub lattice: Lattice,
    /// Time gradient `u = J^{−T} τ`, s/nm.
    pub time_gradient: Vector2<f64>,
    /// Relative standard error of the tip speed along the fast and slow axes.
    pub speed_error: [f64; 2],
    /// The part of the lattice's covariance that comes from the position sensors, nm².
    pub sensor: Matrix4<f64>,
}

/// Lattice and drift common to all observations.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DriftSolution {
    /// Lattice free of drift, nm; its covariance includes that of the drift.
    pub lattice: Lattice,
    /// Drift velocity, nm/s.
    pub velocity: Vector2<f64>,
    /// Its covariance, (nm/s)².
    pub covariance: Matrix2<f64>,
    /// Rank of the problem: 6 where the drift is determined.
    pub rank: usize,
    /// Condition number of the column-scaled design matrix.
    pub condition: f64,
    /// Weighted sum of squared residuals.
    pub chi2: f64,
    /// Degrees of freedom: four per observation less six.
    pub degrees_of_freedom: usize,
}

/// Why the drift cannot be had.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DriftError {
    /// All scans saw the same time gradient, or nearly.
    #[error(
        "the scans cannot determine the drift (rank {rank} of 6, condition {condition:.0}). Needed are scans of both \
         slow directions (up and down), of both slow axes, or of two line rates. A drift known from another \
         measurement can be given"
    )]
    Undetermined {
        /// Numerical rank of the six-parameter problem.
        rank: usize,
        /// Condition number of the column-scaled design.
        condition: f64,
    },
    /// A covariance that is not positive definite.
    #[error("the lattice vectors of scan {index} have no usable covariance")]
    Covariance {
        /// Index of the observation.
        index: usize,
    },
}

impl Observation {
    /// `T = (t₁ I; t₂ I)`: how the drift enters the four components.
    fn elapsed(&self) -> Matrix4x2<f64> {
        let t = self.lattice.basis.transpose() * self.time_gradient;
        let mut m = Matrix4x2::zeros();
        for i in 0..2 {
            m[(i, i)] = t[0];
            m[(2 + i, i)] = t[1];
        }
        m
    }

    /// How `(R₁, R₂, D)` make the four components.
    fn design(&self) -> Matrix4x6<f64> {
        let mut design = Matrix4x6::identity();
        design.fixed_columns_mut::<2>(4).copy_from(&self.elapsed());
        design
    }

    /// The same with a velocity that changes at a constant rate, by the `age` of the image (s).
    pub(crate) fn design_with_acceleration(&self, age: f64) -> SMatrix<f64, 4, 8> {
        let mut design = SMatrix::<f64, 4, 8>::identity();
        design.fixed_columns_mut::<2>(4).copy_from(&self.elapsed());
        design
            .fixed_columns_mut::<2>(6)
            .copy_from(&(self.elapsed() * age));
        design
    }

    /// The lattice as it would be without the drift `velocity ± covariance`: `(I − D uᵀ) r`.
    pub fn corrected(&self, velocity: &Vector2<f64>, covariance: &Matrix2<f64>) -> Lattice {
        let map = Matrix2::identity() - velocity * self.time_gradient.transpose();
        let elapsed = self.elapsed();
        Lattice::new(
            map * self.lattice.basis,
            both(&map) * self.lattice.covariance * both(&map).transpose()
                + elapsed * covariance * elapsed.transpose(),
        )
    }
}

/// Solves for the common lattice and a constant drift.
///
/// # Errors
/// [`DriftError::Undetermined`] where the observations do not tell drift from lattice (all of one
/// direction and rate), [`DriftError::Covariance`] for an unusable input covariance.
pub fn solve(observations: &[Observation]) -> Result<DriftSolution, DriftError> {
    let (rank, condition) = rank_and_condition(observations);
    if rank < 6 || condition > WORST_CONDITION {
        return Err(DriftError::Undetermined { rank, condition });
    }
    let weights = weights(observations)?;
    let (x, covariance) = least_squares(observations, &weights)
        .ok_or(DriftError::Undetermined { rank, condition })?;
    let velocity = Vector2::new(x[4], x[5]);
    let lattice = Lattice::new(
        Matrix2::new(x[0], x[2], x[1], x[3]),
        covariance.fixed_view::<4, 4>(0, 0).into_owned(),
    );
    let chi2 = chi2(observations, &weights, &lattice.flat(), &velocity);
    Ok(DriftSolution {
        lattice,
        velocity,
        covariance: covariance.fixed_view::<2, 2>(4, 4).into_owned(),
        rank,
        condition,
        chi2,
        degrees_of_freedom: 4 * observations.len() - 6,
    })
}

/// The common lattice for a drift known beforehand, with χ² and its degrees of freedom.
///
/// # Errors
/// [`DriftError::Covariance`] for an unusable input covariance.
pub(crate) fn common_lattice(
    observations: &[Observation],
    velocity: &Vector2<f64>,
    covariance: &Matrix2<f64>,
) -> Result<(Lattice, f64, usize), DriftError> {
    let weights = weights(observations)?;
    let (mut normal, mut right, mut lever) =
        (Matrix4::zeros(), Vector4::zeros(), Matrix4x2::zeros());
    for (observation, w) in observations.iter().zip(&weights) {
        let elapsed = observation.elapsed();
        normal += w;
        right += w * (observation.lattice.flat() - elapsed * velocity);
        lever += w * elapsed;
    }
    let inverse = normal
        .try_inverse()
        .ok_or(DriftError::Covariance { index: 0 })?;
    let flat = inverse * right;
    let lever = inverse * lever;
    let lattice = Lattice::new(
        Matrix2::new(flat[0], flat[2], flat[1], flat[3]),
        inverse + lever * covariance * lever.transpose(),
    );
    let chi2 = chi2(observations, &weights, &flat, velocity);
    Ok((lattice, chi2, 4 * (observations.len() - 1)))
}

/// The covariance that the common lattice would have if the drift were known, split into what images
/// and what sensors make of it, nm².
pub(crate) fn at_known_drift(observations: &[Observation]) -> Option<[Matrix4<f64>; 2]> {
    let parts: Vec<_> = observations
        .iter()
        .map(|o| (o.lattice.covariance, o.sensor))
        .collect();
    let (whole, sensor) = weighted_mean(&parts, FLOOR)?;
    Some([whole - sensor, sensor])
}

pub(crate) fn weights(observations: &[Observation]) -> Result<Vec<Matrix4<f64>>, DriftError> {
    observations
        .iter()
        .enumerate()
        .map(|(index, o)| {
            (o.lattice.covariance + Matrix4::identity() * FLOOR)
                .cholesky()
                .map(|c| c.inverse())
                .ok_or(DriftError::Covariance { index })
        })
        .collect()
}

/// Weighted least squares of `(R₁, R₂, D)`; the solution and its covariance.
pub(crate) fn least_squares(
    observations: &[Observation],
    weights: &[Matrix4<f64>],
) -> Option<(Vector6<f64>, Matrix6<f64>)> {
    let rows = observations.iter().zip(weights);
    let rows = rows.map(|(o, w)| (o.design(), o.lattice.flat(), *w));
    weighted(rows, Matrix6::zeros())
}

/// Least squares of (design, values, weight) with the information that is `known` before; the solution and its covariance.
pub(crate) fn weighted<const N: usize>(
    rows: impl Iterator<Item = (SMatrix<f64, 4, N>, Vector4<f64>, Matrix4<f64>)>,
    known: SMatrix<f64, N, N>,
) -> Option<(SVector<f64, N>, SMatrix<f64, N, N>)> {
    let (mut normal, mut right) = (known, SVector::<f64, N>::zeros());
    for (design, values, weight) in rows {
        let weighted = design.transpose() * weight;
        normal += weighted * design;
        right += weighted * values;
    }
    // Seconds and nanometres differ by orders of magnitude: scale before inverting.
    let size = |i: usize| normal[(i, i)];
    let scale = SVector::<f64, N>::from_fn(|i, _| match size(i) {
        d if d > 0.0 => 1.0 / d.sqrt(),
        _ => 1.0,
    });
    let scaled = SMatrix::<f64, N, N>::from_fn(|i, j| normal[(i, j)] * scale[i] * scale[j]);
    let inverse = scaled.cholesky()?.inverse();
    let covariance = SMatrix::<f64, N, N>::from_fn(|i, j| inverse[(i, j)] * scale[i] * scale[j]);
    Some((covariance * right, covariance))
}

pub(crate) fn chi2(
    observations: &[Observation],
    weights: &[Matrix4<f64>],
    lattice: &Vector4<f64>,
    velocity: &Vector2<f64>,
) -> f64 {
    observations
        .iter()
        .zip(weights)
        .map(|(o, w)| {
            let residual = o.lattice.flat() - lattice - o.elapsed() * velocity;
            (residual.transpose() * w * residual)[0]
        })
        .sum()
}

/// Numerical rank and condition of the design matrix with its columns scaled to unit length.
fn rank_and_condition(observations: &[Observation]) -> (usize, f64) {
    let mut design = DMatrix::<f64>::zeros(4 * observations.len().max(2), 6);
    for (i, o) in observations.iter().enumerate() {
        let elapsed = o.elapsed();
        for k in 0..4 {
            design[(4 * i + k, k)] = 1.0;
            design[(4 * i + k, 4)] = elapsed[(k, 0)];
            design[(4 * i + k, 5)] = elapsed[(k, 1)];
        }
    }
    for mut column in design.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column /= norm;
        }
    }
    // The decomposition of anything else does not end.
    if design.iter().any(|value| !value.is_finite()) {
        return (0, f64::INFINITY);
    }
    let values = design.singular_values();
    let largest = values.max();
    let rank = values.iter().filter(|v| **v > 1e-9 * largest).count();
    let smallest = values.min();
    (
        rank,
        if smallest > 0.0 {
            largest / smallest
        } else {
            f64::INFINITY
        },
    )
}

#[cfg(test)]
mod tests;
