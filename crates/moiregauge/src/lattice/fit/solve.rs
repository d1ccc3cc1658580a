//! The normal equations of a fit and its covariance.

use nalgebra::{DMatrix, DVector};

use crate::lattice::fit::model::Model;
use crate::numbers::normal_equations::NormalEquations;

/// Diagonal elements that fall below this share of themselves say that functions are the same: some way above
/// rounding.
const DEGENERATE: f64 = 1e-11;

/// Columns: what the basis functions are to a change of each parameter (background, α and β of each
/// harmonic, then p₁x, p₁y, p₂x, p₂y), each derivative weighted by `weight(harmonic, axis)`.
pub(crate) fn contraction(model: &Model, weight: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    let basis = &model.basis;
    let terms = basis.terms.len();
    let linear = terms + 2 * basis.indices.len();
    let mut map = DMatrix::zeros(basis.len(), linear + 4);
    for t in 0..terms {
        map[(t, t)] = 1.0;
    }
    for (i, [alpha, beta]) in model.waves.iter().enumerate() {
        let first = basis.cosine(i);
        map[(first, terms + 2 * i)] = 1.0;
        map[(first + 1, terms + 2 * i + 1)] = 1.0;
        for (vector, index) in basis.indices[i].into_iter().enumerate() {
            for axis in 0..2 {
                // d(α cos θ + β sin θ) = (β cos θ − α sin θ) dθ.
                let factor = f64::from(index) * weight(i, axis);
                let (row, column) = (first + 2 + 2 * axis, linear + 2 * vector + axis);
                map[(row, column)] = factor * beta;
                map[(row + 1, column)] = -factor * alpha;
            }
        }
    }
    map
}

/// The columns of [`contraction`] with the amplitudes of the `first` harmonics turned into (radius, phase):
/// columns for background, radii and the amplitudes of the others; then the phases of the first, and the four
/// derivatives. Every phase is weighted by `weight(harmonic)`.
pub(crate) fn by_phases(
    model: &Model,
    first: usize,
    contraction: &DMatrix<f64>,
    weight: impl Fn(usize) -> f64,
) -> DMatrix<f64> {
    let terms = model.basis.terms.len();
    let total = contraction.ncols();
    let linear = total - 4 - first;
    let mut map = DMatrix::zeros(contraction.nrows(), total);
    map.columns_mut(0, terms)
        .copy_from(&contraction.columns(0, terms));
    for (i, [alpha, beta]) in model.waves[..first].iter().enumerate() {
        let [cos, sin] = [0, 1].map(|part| contraction.column(terms + 2 * i + part));
        let size = alpha.hypot(*beta);
        map.set_column(terms + i, &((cos * *alpha + sin * *beta) / size));
        // A cos(θ + φ) with α = A cos φ and β = −A sin φ: dα/dφ = β, dβ/dφ = −α.
        let by_phase = (cos * *beta - sin * *alpha) * weight(i);
        map.set_column(linear + i, &by_phase);
    }
    let others = total - 4 - terms - 2 * first;
    map.columns_mut(terms + first, others)
        .copy_from(&contraction.columns(terms + 2 * first, others));
    map.columns_mut(total - 4, 4)
        .copy_from(&contraction.columns(total - 4, 4));
    map
}

/// Solves the normal equations; `None` where the parameters cannot be told apart.
pub(crate) fn solve(normal: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    Some(told_apart(normal)?.solve(right))
}

/// Inverse of a normal matrix.
pub(crate) fn inverse(normal: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    Some(told_apart(normal)?.inverse())
}

fn told_apart(normal: &DMatrix<f64>) -> Option<NormalEquations> {
    let scale = normal.diagonal().map(|d| d.max(0.0).sqrt().recip());
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    NormalEquations::new(normal, scale, |_| 0.0).filter(|n| n.least_pivot() > DEGENERATE)
}

/// `Dᵀ (W − W Φ (Φᵀ W Φ)⁻¹ Φᵀ W) D` for the derivatives D, the last `count` columns of `map`, weighted
/// as there: what is left of them when background and amplitudes are free.
pub(crate) fn projected(
    gram: &DMatrix<f64>,
    map: &DMatrix<f64>,
    count: usize,
) -> Option<DMatrix<f64>> {
    let normal = map.transpose() * gram * map;
    let linear = normal.nrows() - count;
    let phi = normal.view((0, 0), (linear, linear)).into_owned();
    let cross = normal.view((0, linear), (linear, count)).into_owned();
    let own = normal.view((linear, linear), (count, count)).into_owned();
    Some(own - cross.transpose() * inverse(&phi)? * &cross)
}

/// Derivatives of something beside the pair, when the pair is free, too.
pub(crate) struct Freed {
    /// `Dᵀ D` of what is left of them.
    pub(crate) information: DMatrix<f64>,
    /// Covariance of `Dᵀ u`.
    pub(crate) variance: DMatrix<f64>,
    /// A column for each of the four derivatives by the pair: by how much it moves, with the opposite sign, when something else changes by one.
    pub(crate) coupling: DMatrix<f64>,
}

/// From what [`projected`] gives for the four derivatives by the pair and those of something else, unweighted and weighted with the noise.
pub(crate) fn with_pair_free(bread: DMatrix<f64>, meat: DMatrix<f64>) -> Option<Freed> {
    let count = bread.nrows() - 4;
    let of_pair = bread.view((0, 0), (4, 4)).into_owned().try_inverse()?;
    let coupling = bread.view((4, 0), (count, 4)) * of_pair;
    let mut free = DMatrix::zeros(count, 4 + count);
    free.view_mut((0, 0), (count, 4)).copy_from(&-&coupling);
    free.view_mut((0, 4), (count, count)).fill_with_identity();
    Some(Freed {
        information: &free * bread * free.transpose(),
        variance: &free * meat * free.transpose(),
        coupling,
    })
}
