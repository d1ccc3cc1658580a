//! Do the harmonics agree on one lattice?
//!
//! In: a finished fit. Out: χ² of the wave vectors that each strong harmonic would choose by itself
//! against those of the lattice.
//!
//! Where the lattice is not the same everywhere and the amplitudes are not either (steps, domains, a tip that
//! changes), every harmonic is the mean over another part of the frame. What noise leaves uncertain is
//! then much less than what "the lattice of the frame" leaves open; the scatter of the harmonics says how
//! much that is. One Gauss–Newton step from the fit gives each harmonic its own wave vector, with
//! background and amplitudes free.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::lattice::fit::model::Model;
use crate::lattice::fit::solve;
use crate::numbers::chi2::enlargement_by_estimated_noise;
use crate::numbers::exact;

/// Amplitude over noise from which a harmonic has a wave vector of its own: its phase is then good to
/// 0.14 rad.
const STRONG: f64 = 5.0;
/// By which the noise around harmonics may be underestimated, as a power: sixteen independent bins tell it to a
/// quarter.
const NOISE_KNOWN_TO: f64 = 1.25;

/// How well the harmonics agree on one lattice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Closure {
    /// χ² of the harmonics' own wave vectors about those of the lattice.
    #[serde(with = "exact")]
    pub chi_squared: f64,
    /// Its degrees of freedom: two for each strong harmonic, less four.
    pub degrees_of_freedom: usize,
}

impl Closure {
    /// The factor by which the variances of the lattice are enlarged: χ²/dof where it is no chance, else 1.
    pub fn enlargement(&self) -> f64 {
        let (chi2, freedom) = (self.chi_squared, self.degrees_of_freedom);
        enlargement_by_estimated_noise(chi2, freedom, NOISE_KNOWN_TO)
    }
}

/// Reads the closure off the last step: `gram` and `gradient` are those of the whole basis, `noise` is the
/// power around each harmonic along x and along y. `None` with fewer than three strong harmonics.
pub(crate) fn closure(
    model: &Model,
    gram: &DMatrix<f64>,
    gradient: &DVector<f64>,
    noise: &[[f64; 3]],
    signal_to_noise: &[f64],
) -> Option<Closure> {
    let strong: Vec<usize> = (0..model.waves.len())
        .filter(|&i| signal_to_noise[i] > STRONG)
        .collect();
    if strong.len() < 3 {
        return None;
    }
    let count = 2 * strong.len();
    let plain = each_its_own(model, &strong, |_, _| 1.0);
    let weighted = each_its_own(model, &strong, |i, axis| noise[i][axis].sqrt());
    let step = solve::solve(
        &(plain.transpose() * gram * &plain),
        &(plain.transpose() * gradient),
    )?;
    let own = step.rows(step.len() - count, count).into_owned();
    let bread = solve::inverse(&solve::projected(gram, &plain, count)?)?;
    let covariance = &bread * solve::projected(gram, &weighted, count)? * &bread;
    let weight = solve::inverse(&covariance)?;
    // What a change of the lattice does to each of them is not against it.
    let mut common = DMatrix::zeros(count, 4);
    for (row, &i) in strong.iter().enumerate() {
        for (vector, index) in model.basis.indices[i].into_iter().enumerate() {
            for axis in 0..2 {
                common[(2 * row + axis, 2 * vector + axis)] = f64::from(index);
            }
        }
    }
    let normal = common.transpose() * &weight * &common;
    let shared = solve::solve(&normal, &(common.transpose() * &weight * &own))?;
    let rest = own - common * shared;
    Some(Closure {
        chi_squared: rest.dot(&(weight * &rest)),
        degrees_of_freedom: count - 4,
    })
}

/// Columns: background, α and β of each harmonic, then the wave vector (x, y) of each strong one, each
/// derivative weighted by `weight(harmonic, axis)`.
fn each_its_own(
    model: &Model,
    strong: &[usize],
    weight: impl Fn(usize, usize) -> f64,
) -> DMatrix<f64> {
    let basis = &model.basis;
    let terms = basis.terms.len();
    let linear = terms + 2 * basis.indices.len();
    let mut map = DMatrix::zeros(basis.len(), linear + 2 * strong.len());
    for t in 0..terms {
        map[(t, t)] = 1.0;
    }
    for i in 0..model.waves.len() {
        let first = basis.cosine(i);
        map[(first, terms + 2 * i)] = 1.0;
        map[(first + 1, terms + 2 * i + 1)] = 1.0;
    }
    for (place, &i) in strong.iter().enumerate() {
        let ([alpha, beta], first) = (model.waves[i], basis.cosine(i));
        for axis in 0..2 {
            let (row, column) = (first + 2 + 2 * axis, linear + 2 * place + axis);
            map[(row, column)] = weight(i, axis) * beta;
            map[(row + 1, column)] = -weight(i, axis) * alpha;
        }
    }
    map
}
