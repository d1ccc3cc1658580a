//! Is the lattice the same everywhere in the frame?
//!
//! In: a finished fit, its residual and the noise around each harmonic. Out: by how much the wave vectors
//! change across the frame, and whether that is more than noise.
//!
//! A lattice that changes smoothly is a lattice with a bent phase, `θ_hk = (h p₁ + k p₂)·(X, Y) + h ψ₁ +
//! k ψ₂` with `ψ = a X² + b XY + c Y²`. The six numbers are not fitted; how the residual correlates with
//! them is enough (score test): χ² with six degrees of freedom, and one Gauss–Newton step for their size.
//! A drift that gets faster or slower bends the phase along the slow axis just so.
//!
//! # References
//! Rao, Proc. Camb. Phil. Soc. 44, 50 (1948), score test.

use nalgebra::{DMatrix, DVector, Matrix2, Matrix4, Vector2};
use serde::{Deserialize, Serialize};

use crate::lattice::fit::folded::Bends;
use crate::lattice::fit::frame::{BENT, Frame, wave};
use crate::lattice::fit::gram::gram;
use crate::lattice::fit::model::Model;
use crate::lattice::fit::solve;
use crate::numbers::exact;
use crate::spectrum::shells::FIRST_SHELL;

/// χ² with six degrees of freedom exceeds 22.5 once in a thousand; the noise that it is counted in is
/// known to a tenth, which makes it 27.
const THRESHOLD: f64 = 27.0;
/// Changes below this share across the frame harm nobody: a tenth of the calibration that is assumed.
const HARMLESS: f64 = 1e-3;

/// How the lattice changes across the frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Inhomogeneity {
    /// By how much the wavelength changes from one corner to the opposite one, as a share of it: the
    /// most of the three first harmonics. Counted in pixels, as the angle.
    #[serde(with = "exact")]
    pub wavelength: f64,
    /// By how much the direction changes, rad.
    #[serde(with = "exact")]
    pub angle: f64,
    /// χ² of the six numbers that say so.
    #[serde(with = "exact")]
    pub chi_squared: f64,
    /// What chance exceeds once in a thousand.
    #[serde(with = "exact")]
    pub threshold: f64,
}

/// What the fit makes of a lattice that changes is no area mean: of a wave vector that goes like `a x + b x²` over −1 … 1, the fit
/// sees 3b/5 and the mean is b/3. Where b is as large as a, 2/15 of the change from end to end.
const OF_THE_MEAN: f64 = 2.0 / 15.0;

impl Inhomogeneity {
    /// How far the waves (columns) may be from their mean over the area: covariance of the four numbers, as
    /// [`Pair`](heterostrain::lattice::Pair) has them.
    pub(crate) fn of_the_mean(&self, waves: &Matrix2<f64>) -> Matrix4<f64> {
        let mut covariance = Matrix4::zeros();
        for (i, wave) in waves.column_iter().enumerate() {
            let along = wave * (OF_THE_MEAN * self.wavelength);
            let across = Vector2::new(-wave.y, wave.x) * (OF_THE_MEAN * self.angle);
            let block = along * along.transpose() + across * across.transpose();
            covariance
                .fixed_view_mut::<2, 2>(2 * i, 2 * i)
                .copy_from(&block);
        }
        covariance
    }

    /// Whether it is more than chance, and enough to matter.
    pub fn stands_out(&self) -> bool {
        self.chi_squared > self.threshold && self.wavelength.max(self.angle) > HARMLESS
    }
}

/// Reads the bend off the residual. `noise` is the power around each harmonic along x and along y.
pub(crate) fn inhomogeneity(
    frame: &Frame,
    model: &Model,
    lambda: &[f64],
    bends: &Bends,
    noise: &[[f64; 3]],
) -> Option<Inhomogeneity> {
    let mut basis = model.basis.clone();
    basis.orders = BENT;
    let gram = gram(frame, &basis, &model.pair, lambda);
    let bread = left(&gram, model, |_, _| 1.0)?;
    let meat = left(&gram, model, |i, [a, b]| {
        let [x, y, _] = noise[i];
        // What bends along an axis is moved by the noise along it.
        ((a as f64 * x + b as f64 * y) / (a + b) as f64).sqrt()
    })?;
    // The four derivatives are free.
    let of_pair = bread.view((0, 0), (4, 4)).into_owned().try_inverse()?;
    let mut free = DMatrix::zeros(6, 10);
    free.view_mut((0, 0), (6, 4))
        .copy_from(&(-bread.view((4, 0), (6, 4)) * of_pair));
    free.view_mut((0, 4), (6, 6)).fill_with_identity();
    let information = &free * bread * free.transpose();
    let variance = &free * meat * free.transpose();
    let score = score(model, bends);
    let chi_squared = score.dot(&solve::solve(&variance, &score)?);
    let bend = solve::solve(&information, &score)?;
    let [wavelength, angle] = changes(model, frame, &bend);
    Some(Inhomogeneity {
        wavelength,
        angle,
        chi_squared,
        threshold: THRESHOLD,
    })
}

/// `Σ D u` for the derivatives by the bends of ψ₁, then of ψ₂.
fn score(model: &Model, bends: &Bends) -> DVector<f64> {
    let mut score = DVector::zeros(6);
    for (i, sums) in bends.0.iter().enumerate() {
        let [alpha, beta] = model.waves[i];
        for (vector, index) in model.basis.indices[i].into_iter().enumerate() {
            for (j, sum) in sums.iter().enumerate() {
                score[3 * vector + j] += f64::from(index) * (beta * sum.re - alpha * sum.im);
            }
        }
    }
    score
}

/// What is left of the ten derivatives (pair, then bends), each weighted by `weight(harmonic, powers)`,
/// when background and amplitudes are free.
fn left(
    gram: &DMatrix<f64>,
    model: &Model,
    weight: impl Fn(usize, [usize; 2]) -> f64,
) -> Option<DMatrix<f64>> {
    let terms = model.basis.terms.len();
    let linear = terms + 2 * model.waves.len();
    let mut map = DMatrix::zeros(gram.nrows(), linear + 10);
    for t in 0..terms {
        map[(t, t)] = 1.0;
    }
    for (i, [alpha, beta]) in model.waves.iter().enumerate() {
        let first = terms + 2 * BENT.len() * i;
        map[(first, terms + 2 * i)] = 1.0;
        map[(first + 1, terms + 2 * i + 1)] = 1.0;
        for (vector, index) in model.basis.indices[i].into_iter().enumerate() {
            for (j, &powers) in BENT.iter().enumerate().skip(1) {
                let factor = f64::from(index) * weight(i, powers);
                // Two derivatives for each vector, then three bends for each.
                let column = match j {
                    1 | 2 => linear + 2 * vector + j - 1,
                    _ => linear + 4 + 3 * vector + j - 3,
                };
                map[(first + 2 * j, column)] = factor * beta;
                map[(first + 2 * j + 1, column)] = -factor * alpha;
            }
        }
    }
    solve::projected(gram, &map, 10)
}

/// The largest change of wavelength (share) and direction (rad) of the first harmonics from corner to
/// corner.
fn changes(model: &Model, frame: &Frame, bend: &DVector<f64>) -> [f64; 2] {
    let scale = frame.edge().map(|e| 1.0 / e);
    let mut most = [0.0f64; 2];
    for index in FIRST_SHELL {
        let q = wave(&model.pair, index).component_mul(&scale);
        // ψ of this harmonic.
        let [a, b, c] =
            [0, 1, 2].map(|j| f64::from(index[0]) * bend[j] + f64::from(index[1]) * bend[3 + j]);
        // Columns: how q changes with X and with Y.
        let slope = Matrix2::from_diagonal(&scale) * Matrix2::new(2.0 * a, b, b, 2.0 * c);
        let along = q / q.norm_squared();
        for (most, direction) in most
            .iter_mut()
            .zip([along, Vector2::new(-along.y, along.x)])
        {
            let change = slope.tr_mul(&direction);
            *most = most.max(2.0 * (change.x.abs() + change.y.abs()));
        }
    }
    most
}
