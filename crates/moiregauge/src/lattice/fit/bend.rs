//! Is the lattice the same everywhere in the frame, and if not, what is its mean?
//!
//! In: a finished fit, its residual and the noise around each harmonic. Out: by how much the wave vectors
//! change across the frame, whether that is more than noise, and how far their mean over the area is from what the fit says.
//!
//! A lattice that changes smoothly is a lattice with a bent phase, `θ_hk = (h p₁ + k p₂)·(X, Y) + h ψ₁ +
//! k ψ₂` with `ψ = a X² + b XY + c Y² + d X³ + e X²Y + f XY² + g Y³`. The fourteen numbers are not fitted; how the residual
//! correlates with them is enough (score test): χ² with fourteen degrees of freedom, and one Gauss–Newton step for their size.
//! A drift that gets faster or slower bends the phase along the slow axis just so.
//!
//! Of `p X + d X³` the fit sees `p + 3d/5`, since the slope in the middle weighs more in it than that at the ends, and the mean of the
//! slope over the area is `p + d`. The step has both.
//!
//! # References
//! Rao, Proc. Camb. Phil. Soc. 44, 50 (1948), score test.

use nalgebra::{DMatrix, DVector, Matrix2, Matrix4, Matrix6, Vector2, Vector4, Vector6};
use serde::{Deserialize, Serialize};

use crate::lattice::fit::folded::Bends;
use crate::lattice::fit::frame::{BENDS, BENT, Frame, ORDERS, wave};
use crate::lattice::fit::model::Model;
use crate::lattice::fit::solve::{self, Freed};
use crate::numbers::exact;
use crate::spectrum::shells::FIRST_SHELL;

/// χ² with fourteen degrees of freedom exceeds 36.1 once in a thousand; the noise that it is counted in is
/// known to a tenth, which makes it 43.
const THRESHOLD: f64 = 43.0;
/// The same for the eight numbers of the cubic terms: 26.1.
const CUBIC: f64 = 31.0;
/// Terms of the third order in both phases.
const THIRD_ORDER: f64 = 8.0;
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
    /// By how much the wave vectors' mean over the area exceeds that of the fit, rad per pixel, a column each.
    #[serde(with = "exact")]
    pub mean: Matrix2<f64>,
    /// What noise adds to the covariance of the wave vectors when that is added to them, as
    /// [`Pair`](heterostrain::lattice::Pair) has them.
    #[serde(with = "exact")]
    pub noise: Matrix4<f64>,
    /// χ² of the eight numbers of the third order, of which the mean is made.
    #[serde(with = "exact")]
    pub cubic: f64,
    /// The terms of the second order.
    #[serde(skip)]
    pub(crate) second: SecondOrder,
}

/// Second derivatives of the phases by the pixel, in single precision: each line of every frame keeps them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SecondOrder {
    /// Of ψ₁ by (xx, xy, yy), then of ψ₂, rad.
    pub(crate) values: Vector6<f32>,
    /// What noise makes of them.
    pub(crate) covariance: Matrix6<f32>,
}

/// Where fewer residuals than this share are cut off, three times what Gaussian noise has, the fit follows a lattice that bends, and
/// it is no matter of outliers.
pub(crate) const FOLLOWED: f64 = 0.01;
/// What powers beyond the third do to the mean, as a share of what the third does: a wave of the lattice one and a half times as long
/// as the frame makes it 0.08, one as long as the frame 0.19, one of two thirds of it 0.6.
const BEYOND: f64 = 0.2;

impl Inhomogeneity {
    /// Whether it is more than chance, and enough to matter.
    pub fn is_significant(&self) -> bool {
        self.chi_squared > self.threshold && self.wavelength.max(self.angle) > HARMLESS
    }

    /// Whether the mean over the area is to be added: it is more than chance, and the fit follows the lattice. `clipped`: the share of
    /// the pixels whose residuals are cut off. Of a lattice that bends more than the fit can follow, and of outliers, many are.
    fn tells_the_mean(&self, clipped: f64) -> bool {
        clipped < FOLLOWED && self.cubic > CUBIC
    }

    /// What is to be added to the wave vectors (rad per pixel, a column each), and to their covariance. `followed`: the mean of the bend that the fit
    /// was freed of.
    pub(crate) fn of_the_mean(
        &self,
        clipped: f64,
        followed: Option<Matrix2<f64>>,
    ) -> (Matrix2<f64>, Matrix4<f64>) {
        let doubt = self.beyond(clipped);
        if self.tells_the_mean(clipped) {
            (followed.unwrap_or(self.mean), self.noise + doubt)
        } else {
            (followed.unwrap_or_else(Matrix2::zeros), doubt)
        }
    }

    /// How far the mean of the waves may be from what is told of it: covariance of the four numbers. What the third order says and is more than
    /// noise makes of it, where that is not added (`E m mᵀ` of a measured shift is that of the true one and of noise, whose χ² is the number
    /// of its terms); all of it, where the fit does not follow the lattice.
    pub(crate) fn beyond(&self, clipped: f64) -> Matrix4<f64> {
        let share = if self.tells_the_mean(clipped) {
            BEYOND
        } else if clipped < FOLLOWED {
            (1.0 - THIRD_ORDER / self.cubic).max(0.0).sqrt()
        } else {
            1.0
        };
        let off = Vector4::from_column_slice(self.mean.as_slice()) * share;
        off * off.transpose()
    }

    /// How far the mean would be from what is told of it if the third order were all there is, or if more were: what images of one
    /// sample have in common of it is no noise.
    pub(crate) fn beside(&self, clipped: f64) -> Matrix2<f64> {
        let share = if self.tells_the_mean(clipped) {
            BEYOND
        } else {
            1.0
        };
        self.mean * share
    }
}

/// What is told of a bend, as a change of the phases.
pub(crate) struct Bend {
    /// By ψ₁, then by ψ₂: slopes along X and Y, which the fit would have with the bends.
    slopes: Vector4<f64>,
    bends: DVector<f64>,
}

impl Bend {
    /// By how much the mean of the waves over the area exceeds that of a fit without it, rad per pixel, a column each.
    pub(crate) fn mean(&self, frame: &Frame) -> Matrix2<f64> {
        let mean = self.slopes + mean_slopes() * &self.bends;
        let scale = frame.edge().map(|e| 1.0 / e);
        Matrix2::from_diagonal(&scale) * Matrix2::from_column_slice(mean.as_slice())
    }

    /// Second derivatives of the phases by the pixel.
    pub(crate) fn second(&self, frame: &Frame) -> Vector6<f64> {
        Vector6::from_fn(|i, _| self.bends[second_order()[i]] * second_derivatives(frame)[i])
    }

    /// No bend.
    pub(crate) fn none() -> Self {
        Self {
            slopes: Vector4::zeros(),
            bends: DVector::zeros(2 * BENDS),
        }
    }

    pub(crate) fn and(&self, other: &Self) -> Self {
        Self {
            slopes: self.slopes + other.slopes,
            bends: &self.bends + &other.bends,
        }
    }

    /// ψ₁ and ψ₂ at (X, Y), rad.
    pub(crate) fn phases(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|vector| {
            let straight = self.slopes[2 * vector] * x + self.slopes[2 * vector + 1] * y;
            let bent = powers().iter().enumerate().map(|(i, [a, b])| {
                self.bends[BENDS * vector + i] * x.powi(*a as i32) * y.powi(*b as i32)
            });
            straight + bent.sum::<f64>()
        })
    }
}

/// Reads the bend off the residual. `gram`: sums of products of the waves times all powers; `noise`: the power around each harmonic along x and along y.
pub(crate) fn inhomogeneity(
    frame: &Frame,
    model: &Model,
    gram: &DMatrix<f64>,
    bends: &Bends,
    noise: &[[f64; 3]],
) -> Option<(Inhomogeneity, Bend)> {
    let bread = left(gram, model, |_, _| 1.0)?;
    let meat = left(gram, model, |i, [a, b]| {
        let [x, y, _] = noise[i];
        // What bends along an axis is moved by the noise along it.
        ((a as f64 * x + b as f64 * y) / (a + b) as f64).sqrt()
    })?;
    let Freed {
        information,
        variance,
        coupling,
    } = solve::with_pair_free(bread, meat)?;
    let score = score(model, bends);
    let chi_squared = score.dot(&solve::solve(&variance, &score)?);
    let inverse = solve::inverse(&information)?;
    let bend = &inverse * &score;
    let cubic = cubic_chi_squared(&score, &variance)?;
    let told = told(&bend, cubic);
    let [wavelength, angle] = changes(model, frame, &told);
    // The fit would be another one with the bends, and they have a mean slope.
    let scale = frame.edge().map(|e| 1.0 / e);
    let to_pixels = Matrix4::from_diagonal(&Vector4::new(scale.x, scale.y, scale.x, scale.y));
    let of_mean = to_pixels * (mean_slopes() - coupling.transpose());
    let shift = &of_mean * &bend;
    let spread = &inverse * variance * &inverse;
    let noise = &of_mean * &spread * of_mean.transpose();
    let slopes = -coupling.transpose() * &told;
    let derivatives = second_derivatives(frame);
    let second = |i: usize, j: usize| spread[(second_order()[i], second_order()[j])];
    let inhomogeneity = Inhomogeneity {
        second: SecondOrder {
            values: Vector6::from_fn(|i, _| (bend[second_order()[i]] * derivatives[i]) as f32),
            covariance: Matrix6::from_fn(|i, j| {
                (second(i, j) * derivatives[i] * derivatives[j]) as f32
            }),
        },
        wavelength,
        angle,
        chi_squared,
        threshold: THRESHOLD,
        mean: Matrix2::from_column_slice(shift.as_slice()),
        noise: Matrix4::from_column_slice(noise.as_slice()),
        cubic,
    };
    let slopes = Vector4::from_column_slice(slopes.as_slice());
    Some((
        inhomogeneity,
        Bend {
            slopes,
            bends: told,
        },
    ))
}

/// Which of the bends are of the second order: (xx, xy, yy) of ψ₁, then of ψ₂.
fn second_order() -> [usize; 6] {
    [0, 1, 2, BENDS, BENDS + 1, BENDS + 2]
}

/// What their derivatives by the pixel are.
fn second_derivatives(frame: &Frame) -> [f64; 6] {
    let [x, y] = frame.edge().map(|e| 1.0 / e).into();
    let of_one = [2.0 * x * x, x * y, 2.0 * y * y];
    [0, 1, 2, 3, 4, 5].map(|i| of_one[i % 3])
}

/// Which of the bends are of the third order.
fn cubic() -> Vec<usize> {
    let is_cubic = |i: &usize| powers()[i % BENDS].iter().sum::<usize>() == 3;
    (0..2 * BENDS).filter(is_cubic).collect()
}

/// χ² of those bends.
fn cubic_chi_squared(score: &DVector<f64>, variance: &DMatrix<f64>) -> Option<f64> {
    let score = score.select_rows(&cubic());
    let variance = variance.select_rows(&cubic()).select_columns(&cubic());
    Some(score.dot(&solve::solve(&variance, &score)?))
}

/// The bends of which a change is told: those of the third order only where they are more than chance themselves, since they are largest at
/// the corners and noise alone makes some.
fn told(bend: &DVector<f64>, chi_squared: f64) -> DVector<f64> {
    let mut told = bend.clone();
    if chi_squared < CUBIC {
        for i in cubic() {
            told[i] = 0.0;
        }
    }
    told
}

/// The powers of a bend.
fn powers() -> &'static [[usize; 2]] {
    &BENT[ORDERS - BENDS..]
}

/// Slopes of `XᵃYᵇ` at a place.
fn slopes([a, b]: [usize; 2], at: Vector2<f64>) -> Vector2<f64> {
    let power = |x: f64, n: usize| x.powi(n as i32);
    let slope = |x: f64, n: usize| match n {
        0 => 0.0,
        _ => n as f64 * power(x, n - 1),
    };
    Vector2::new(
        slope(at.x, a) * power(at.y, b),
        power(at.x, a) * slope(at.y, b),
    )
}

/// Means over the frame of the slopes along X and Y of ψ₁, then of ψ₂, for each of the bends.
fn mean_slopes() -> DMatrix<f64> {
    // Simpson's rule is exact for cubics.
    const NODES: [[f64; 2]; 3] = [[-1.0, 1.0 / 6.0], [0.0, 4.0 / 6.0], [1.0, 1.0 / 6.0]];
    let mut means = DMatrix::zeros(4, 2 * BENDS);
    for (j, &powers) in powers().iter().enumerate() {
        let places = NODES.iter().flat_map(|x| NODES.iter().map(move |y| (x, y)));
        let mean: Vector2<f64> = places
            .map(|([x, p], [y, q])| slopes(powers, Vector2::new(*x, *y)) * (p * q))
            .sum();
        for vector in 0..2 {
            means[(2 * vector, BENDS * vector + j)] = mean.x;
            means[(2 * vector + 1, BENDS * vector + j)] = mean.y;
        }
    }
    means
}

/// `Σ D u` for the derivatives by the bends of ψ₁, then of ψ₂.
fn score(model: &Model, bends: &Bends) -> DVector<f64> {
    let mut score = DVector::zeros(2 * BENDS);
    for (i, sums) in bends.0.iter().enumerate() {
        let [alpha, beta] = model.waves[i];
        for (vector, index) in model.basis.indices[i].into_iter().enumerate() {
            for (j, sum) in sums[ORDERS - BENDS..].iter().enumerate() {
                score[BENDS * vector + j] += f64::from(index) * (beta * sum.re - alpha * sum.im);
            }
        }
    }
    score
}

/// What is left of the derivatives (pair, then bends), each weighted by `weight(harmonic, powers)`,
/// when background and amplitudes are free.
fn left(
    gram: &DMatrix<f64>,
    model: &Model,
    weight: impl Fn(usize, [usize; 2]) -> f64,
) -> Option<DMatrix<f64>> {
    let terms = model.basis.terms.len();
    let linear = terms + 2 * model.waves.len();
    let mut map = DMatrix::zeros(gram.nrows(), linear + 4 + 2 * BENDS);
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
                // Two derivatives for each vector, then its bends.
                let column = match j {
                    1 | 2 => linear + 2 * vector + j - 1,
                    _ => linear + 4 + BENDS * vector + j - 3,
                };
                map[(first + 2 * j, column)] = factor * beta;
                map[(first + 2 * j + 1, column)] = -factor * alpha;
            }
        }
    }
    solve::projected(gram, &map, 4 + 2 * BENDS)
}

/// The largest change of wavelength (share) and direction (rad) of the first harmonics between two of nine places: the corners, the
/// middles of the edges and that of the frame.
fn changes(model: &Model, frame: &Frame, bend: &DVector<f64>) -> [f64; 2] {
    let scale = frame.edge().map(|e| 1.0 / e);
    let places = [-1.0, 0.0, 1.0].map(|x| [-1.0, 0.0, 1.0].map(|y| Vector2::new(x, y)));
    let mut most = [0.0f64; 2];
    for index in FIRST_SHELL {
        let q = wave(&model.pair, index).component_mul(&scale);
        let along = q / q.norm_squared();
        let directions = [along, Vector2::new(-along.y, along.x)];
        let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for &at in places.as_flattened() {
            let of_place = |(j, powers): (usize, &[usize; 2])| {
                let size = f64::from(index[0]) * bend[j] + f64::from(index[1]) * bend[BENDS + j];
                slopes(*powers, at).component_mul(&scale) * size
            };
            let change: Vector2<f64> = powers().iter().enumerate().map(of_place).sum();
            for ([low, high], direction) in range.iter_mut().zip(&directions) {
                *low = low.min(change.dot(direction));
                *high = high.max(change.dot(direction));
            }
        }
        for (most, [low, high]) in most.iter_mut().zip(range) {
            *most = most.max(high - low);
        }
    }
    most
}
