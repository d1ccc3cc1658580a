//! Contrast that changes across the frame, and what it does to the wave vectors.
//!
//! Where the moiré fades the amplitudes of its waves fall. A fit with one amplitude for the whole frame leaves the lattice times a slow factor. That
//! is in quadrature to a change of the wave vectors, wave by wave, and would move none of them if the waves were orthogonal. Across a frame of few
//! periods, or one of which a part is missing, each wave leaks into the others, and they move.
//!
//! In: a finished fit, its residual and the noise around each harmonic. Model: all waves times `1 + Σ c_ab XᵃYᵇ`. Whether the contrast
//! changes is asked as for a [bend](super::bend): χ² of how the residual correlates with the nine functions with 1 ≤ a + b ≤ 3 (score test). Where it
//! does, those with a + b ≤ 5, or 3, are fitted together with all that the fit has (Gauss–Newton).
//!
//! # References
//! Rao, Proc. Camb. Phil. Soc. 44, 50 (1948), score test.

use nalgebra::{DMatrix, DVector, Matrix2, Matrix4, Vector2, Vector4};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};

use crate::explain::evidence::contrast as predicted_by;
use crate::frame::image::Image;
use crate::lattice::fit::fit_pixels::{FinalNoise, Fit};
use crate::lattice::fit::frame::{BENT, powers, turns, wave};
use crate::lattice::fit::model::{AT_ONCE, Model, settled};
use crate::lattice::fit::solve::{self, Freed};
use crate::lattice::fit::straight::without_bend;
use crate::lattice::fit::tables::Tables;
use crate::numbers::dot::dot;
use crate::numbers::exact;
use crate::numbers::three::three;

/// χ² with nine degrees of freedom exceeds 27.9 once in a thousand; the noise that it is counted in is known to a tenth.
const THRESHOLD: f64 = 34.0;
/// Contrast changes where that predicts blocks that were held out by so many standard errors. Few spots that differ by chance have 1 at most, contrast that
/// fades above 5.
const PREDICTS: f64 = 2.0;
/// The highest powers of X and Y, together, by which the waves are multiplied.
const HIGHEST: usize = 5;
/// All of them, [`BENT`] first.
const FADED: &[[usize; 2]; 21] = &powers();
/// Steps of the fit.
const STEPS: usize = 4;

/// Powers up to a degree, and what those beyond do to the wave vectors as a share of what these do. Of simulated edges of all widths the third degree leaves up
/// to nine tenths of a shift, the fifth mostly less than a tenth and at times the half: with three tenths the rms pull of 60 sets is 0.89.
struct Description {
    orders: &'static [[usize; 2]],
    beyond: f64,
}

const DESCRIPTIONS: [Description; 2] = [
    Description {
        orders: FADED,
        beyond: 0.3,
    },
    Description {
        orders: BENT,
        beyond: 1.0,
    },
];

/// What contrast that changes across the frame did to the wave vectors, rad per pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Contrast {
    /// What was added to them, a column each.
    #[serde(with = "exact")]
    pub(crate) shift: Matrix2<f64>,
    /// What noise added to their covariance by that.
    #[serde(with = "exact")]
    pub(crate) noise: Matrix4<f64>,
    /// How far they may be from what is told of them: all images of a sample have it alike.
    #[serde(with = "exact")]
    pub(crate) beside: Matrix2<f64>,
}

impl Contrast {
    /// Of the wave vectors, beside that of a fit with an even contrast. Each image has the doubt; the mean of a set keeps it
    /// ([`Common`](crate::lattice::common::Common)).
    pub(crate) fn covariance(&self) -> Matrix4<f64> {
        let beside = Vector4::from_column_slice(self.beside.as_slice());
        self.noise + beside * beside.transpose()
    }

    /// Whether it was fitted, and by how much the wave vectors of a fit with an even contrast are or may be off at most, as a share of them.
    pub(crate) fn told(&self, pair: &Matrix2<f64>) -> (bool, f64) {
        let fitted = self.shift != Matrix2::zeros();
        let moved = if fitted { &self.shift } else { &self.beside };
        let shares = three(moved).into_iter().zip(three(pair));
        let shares = shares.map(|(off, wave)| off.norm() / wave.norm());
        (fitted, shares.fold(0.0, f64::max))
    }

    /// Where nothing was added to the wave vectors: the doubt is what might have been.
    pub(crate) fn untold(self) -> Self {
        Self {
            shift: Matrix2::zeros(),
            noise: Matrix4::zeros(),
            beside: self.shift,
        }
    }

    /// The same in pixels of which `binning` make one bin along each axis.
    pub(crate) fn in_pixels(self, binning: f64) -> Self {
        Self {
            shift: self.shift / binning,
            noise: self.noise / (binning * binning),
            beside: self.beside / binning,
        }
    }
}

/// A fit with contrast that changes.
pub(crate) struct Faded {
    pub(crate) contrast: Contrast,
    model: Model,
    /// Of the powers.
    factors: Vec<f64>,
    /// Of the powers and of all that the fit has.
    gram: DMatrix<f64>,
}

/// The fit of an image with a contrast that was made the same everywhere.
pub(crate) struct Even<'a> {
    pub(crate) fit: Fit<'a>,
    pub(crate) noise: FinalNoise,
    pub(crate) contrast: Contrast,
}

impl Fit<'_> {
    /// Whether a contrast that changes predicts blocks that were held out. The heights of disordered spots do not.
    fn contrast_predicts(&self) -> Option<bool> {
        let edge = self.frame.edge();
        let pair = Matrix2::from_fn(|i, j| self.model.pair[(i, j)] / edge[i]);
        Some(predicted_by(self.frame.image, &pair)? > PREDICTS)
    }

    /// The fit with contrast that changes, where it does by more than chance. The finest description is taken whose noise costs no more than noise does
    /// already; where all cost more there are no powers, and the doubt is what might have been.
    pub(crate) fn faded(&self, noise: &FinalNoise) -> Option<Faded> {
        if !(self.contrast_changes(noise)? > THRESHOLD) {
            return None;
        }
        if !self.contrast_predicts()? {
            return None;
        }
        let acting = noise.acting();
        let covariance = self.covariance(noise)?.fixed_view::<4, 4>(3, 3).trace();
        let mut dear = None;
        for description in DESCRIPTIONS {
            let Some(faded) = self.described(&description, &acting) else {
                continue;
            };
            if in_edges(&faded.contrast.noise, self.frame.edge()) <= covariance {
                return Some(faded);
            }
            dear = Some(faded);
        }
        let dear = dear?;
        Some(Faded {
            contrast: dear.contrast.untold(),
            model: self.model.clone(),
            factors: Vec::new(),
            ..dear
        })
    }

    /// The image with a contrast that is the same everywhere.
    pub(crate) fn evened(&self, faded: &Faded) -> Image {
        self.even(&faded.model, &faded.factors)
    }

    /// The fit of that image.
    pub(crate) fn of_even<'b>(&self, faded: Faded, even: &'b Image) -> Option<Even<'b>> {
        let mut fit = self.in_image(even);
        fit.model = faded.model;
        fit.converge()?;
        let noise = fit.noise()?;
        let noise = without_bend(&fit, noise);
        let mut contrast = faded.contrast;
        if !faded.factors.is_empty() {
            let orders = &FADED[..faded.factors.len()];
            contrast.noise = fit.added(&faded.gram, orders, &noise.acting())?;
        }
        Some(Even {
            fit,
            noise,
            contrast,
        })
    }

    /// The same by such powers.
    fn described(&self, description: &Description, acting: &[[f64; 3]]) -> Option<Faded> {
        let orders = description.orders;
        let gram = self.gram_of(orders);
        let noise = self.added(&gram, orders, acting)?;
        let map = derivatives(&self.model, orders, |_, _| 1.0);
        let normal = map.transpose() * &gram * &map;
        let mut model = self.model.clone();
        model.basis.orders = orders;
        let mut factors = vec![0.0; orders.len()];
        for _ in 0..STEPS {
            let gradient = self.gradient(&model, &factors);
            let step = solve::solve(&normal, &(map.transpose() * gradient))?;
            // The factors come last; that of the constant is in the amplitudes.
            let (of_fit, of_factors) = step.as_slice().split_at(step.len() - (orders.len() - 1));
            model.add(of_fit, 1.0);
            for (factor, change) in factors[1..].iter_mut().zip(of_factors) {
                *factor += change;
            }
        }
        let scale = self.frame.edge().map(|e| 1.0 / e);
        let shift = Matrix2::from_diagonal(&scale) * (model.pair - self.model.pair);
        model.basis.orders = self.model.basis.orders;
        shift.iter().all(|value| value.is_finite()).then(|| Faded {
            contrast: Contrast {
                shift,
                noise,
                beside: shift * description.beyond,
            },
            model,
            factors,
            gram,
        })
    }

    /// What noise adds to the covariance of the wave vectors with contrast of such powers.
    fn added(
        &self,
        gram: &DMatrix<f64>,
        orders: &[[usize; 2]],
        acting: &[[f64; 3]],
    ) -> Option<Matrix4<f64>> {
        let Freed {
            information,
            variance,
            coupling,
        } = self.of_contrast(gram, orders, acting)?;
        let scale = self.frame.edge().map(|e| 1.0 / e);
        let to_pixels = Matrix4::from_diagonal(&Vector4::new(scale.x, scale.y, scale.x, scale.y));
        let moved = to_pixels * coupling.transpose() * solve::inverse(&information)?;
        let noise = &moved * variance * moved.transpose();
        Some(Matrix4::from_column_slice(noise.as_slice()))
    }

    /// χ² of the nine numbers that say whether the contrast changes.
    fn contrast_changes(&self, noise: &FinalNoise) -> Option<f64> {
        let gram = self.bent_gram(noise);
        let Freed { variance, .. } = self.of_contrast(gram, BENT, &noise.acting())?;
        let mut score = DVector::zeros(BENT.len() - 1);
        for ([alpha, beta], sums) in self.model.waves.iter().zip(&noise.bends.0) {
            for (score, sum) in score.iter_mut().zip(&sums[1..]) {
                *score += alpha * sum.re + beta * sum.im;
            }
        }
        Some(score.dot(&solve::solve(&variance, &score)?))
    }

    /// Of the factors of some powers, when background, amplitudes and wave vectors are free.
    fn of_contrast(
        &self,
        gram: &DMatrix<f64>,
        orders: &[[usize; 2]],
        acting: &[[f64; 3]],
    ) -> Option<Freed> {
        let count = orders.len() - 1;
        let plain = derivatives(&self.model, orders, |_, _| 1.0);
        let noisy = derivatives(&self.model, orders, |i, [a, b]| {
            let [x, y, _] = acting[i];
            ((a as f64 * x + b as f64 * y) / (a + b) as f64).sqrt()
        });
        let bread = solve::projected(gram, &plain, 4 + count)?;
        let meat = solve::projected(gram, &noisy, 4 + count)?;
        solve::with_pair_free(bread, meat)
    }

    /// `Φᵀ u` for the background and all waves times all powers, u what a model with such factors leaves.
    fn gradient(&self, model: &Model, factors: &[f64]) -> DVector<f64> {
        let flat = self.even(model, factors);
        let frame = self.frame.with(&flat);
        let tables = Tables::new(&frame, &model.pair, &model.basis.indices);
        let highest = model.basis.highest();
        let raised = |index: &[i32; 2]| {
            let turns = turns(wave(&model.pair, *index).x, &frame.x);
            let times = |power: usize| {
                let terms = turns.iter().zip(&frame.x);
                let terms = terms.map(|(turn, x)| turn * x.powi(power as i32));
                let (cos, sin) = terms.map(|turn| (turn.re, turn.im)).unzip();
                [cos, sin]
            };
            (0..=highest).map(times).collect()
        };
        let along: Vec<Vec<[Vec<f64>; 2]>> = model.basis.indices.iter().map(raised).collect();
        let clip = self.clip();
        let of_row = |line: &mut Vec<f64>, row: usize| {
            settled(&frame, model, &tables, &self.lines, clip, row, line);
            let (y, line) = (frame.y[row], &*line);
            let mut sums = Vec::with_capacity(model.basis.len());
            for [a, b] in &model.basis.terms {
                let terms = line.iter().zip(&frame.x);
                let moment: f64 = terms.map(|(value, x)| value * x.powi(*a as i32)).sum();
                sums.push(moment * y.powi(*b as i32));
            }
            for (along, up) in along.iter().zip(&tables.up) {
                let product =
                    |[cos, sin]: &[Vec<f64>; 2]| Complex64::new(dot(line, cos), dot(line, sin));
                let products: Vec<_> = along.iter().map(|wave| product(wave) * up[row]).collect();
                for [a, b] in model.basis.orders {
                    let sum = products[*a] * y.powi(*b as i32);
                    sums.extend([sum.re, sum.im]);
                }
            }
            DVector::from_vec(sums)
        };
        let rows: Vec<usize> = (0..frame.image.rows)
            .filter(|&row| frame.present[row] > 0)
            .collect();
        let rows = rows.into_par_iter().with_min_len(AT_ONCE);
        let each = rows.map_init(|| vec![0.0; frame.image.columns], of_row);
        let each: Vec<DVector<f64>> = each.collect();
        let none = DVector::zeros(model.basis.len());
        each.into_iter().fold(none, |sum, of_row| sum + of_row)
    }

    /// The image with a contrast that is the same everywhere, by the factors of the powers.
    fn even(&self, model: &Model, factors: &[f64]) -> Image {
        let (frame, image) = (&self.frame, self.frame.image);
        let nothing = Image::new(image.rows, image.columns, vec![0.0; image.values.len()]);
        let mut lattice = self.in_image(&nothing);
        lattice.model = model.clone();
        lattice.model.background.fill(0.0);
        let negative = lattice.left();
        let mut even = image.clone();
        let lines = even.values.par_chunks_exact_mut(image.columns);
        let lines = lines.zip(negative.par_chunks_exact(image.columns));
        lines.enumerate().for_each(|(row, (line, negative))| {
            let mut along = [0.0; HIGHEST + 1];
            for ([a, b], factor) in FADED.iter().zip(factors) {
                along[*a] += factor * frame.y[row].powi(*b as i32);
            }
            for ((value, negative), x) in line.iter_mut().zip(negative).zip(&frame.x) {
                let factor = along.iter().rev().fold(0.0, |sum, part| sum * x + part);
                *value += factor * negative;
            }
        });
        even
    }
}

/// The trace of a covariance of two wave vectors, given in rad per pixel, for phases at the edges.
fn in_edges(covariance: &Matrix4<f64>, edge: Vector2<f64>) -> f64 {
    let squares = [edge.x, edge.y, edge.x, edge.y].map(|edge| edge * edge);
    let variances = covariance.diagonal();
    variances.iter().zip(squares).map(|(v, e)| v * e).sum()
}

/// Columns: what the functions are to a change of background, amplitudes, pair, and of the factors of the powers but the first, each weighted by
/// `weight(harmonic, powers)`.
fn derivatives(
    model: &Model,
    orders: &[[usize; 2]],
    weight: impl Fn(usize, [usize; 2]) -> f64,
) -> DMatrix<f64> {
    let terms = model.basis.terms.len();
    let linear = terms + 2 * model.waves.len();
    let each = 2 * orders.len();
    let mut map = DMatrix::zeros(terms + each * model.waves.len(), linear + 3 + orders.len());
    for t in 0..terms {
        map[(t, t)] = 1.0;
    }
    for (i, [alpha, beta]) in model.waves.iter().enumerate() {
        let first = terms + each * i;
        map[(first, terms + 2 * i)] = 1.0;
        map[(first + 1, terms + 2 * i + 1)] = 1.0;
        // The constant is the amplitude itself.
        for (j, &powers) in orders.iter().enumerate().skip(1) {
            let weight = weight(i, powers);
            let (cosine, sine) = (first + 2 * j, first + 2 * j + 1);
            map[(cosine, linear + 3 + j)] = weight * alpha;
            map[(sine, linear + 3 + j)] = weight * beta;
            // X and Y.
            if j < 3 {
                for (vector, index) in model.basis.indices[i].into_iter().enumerate() {
                    let (factor, column) = (f64::from(index) * weight, linear + 2 * vector + j - 1);
                    map[(cosine, column)] = factor * beta;
                    map[(sine, column)] = -factor * alpha;
                }
            }
        }
    }
    map
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::background::Background;
    use crate::lattice::fit::fitted::LatticeFit;
    use crate::lattice::fit::measure::measure;
    use crate::numbers::rng::normals;
    use crate::spectrum::harmonics::Windowed;
    use crate::spectrum::shells::shells;

    const SIZE: [usize; 2] = [112, 96];
    const SEEDS: u64 = 30;

    /// Seven periods across.
    fn pair() -> Matrix2<f64> {
        Matrix2::new(0.39, -0.02, 0.17, 0.45)
    }

    /// A lattice whose contrast falls along a diagonal by the logistic function of such a width (share of half the frame), with white noise.
    fn fitted(seed: u64, width: f64, noise: f64) -> LatticeFit {
        let mut normal = normals(seed, "contrast", 0);
        let value = |i: usize| {
            let at = Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
            let [a, b] = [0, 1].map(|j| pair().column(j).dot(&at));
            let [x, y] = [0, 1].map(|axis| 2.0 * at[axis] / SIZE[axis] as f64 - 1.0);
            let contrast = 1.0 / (1.0 + ((0.8 * x + 0.6 * y - 0.5) / width).exp());
            contrast * (a.cos() + b.cos() + (b - a).cos()) + noise * normal()
        };
        let values = (0..SIZE[0] * SIZE[1]).map(value).collect();
        let image = Image::new(SIZE[1], SIZE[0], values);
        let start = Windowed::new(&image).fit(&image, &pair(), Background::Plane, shells(3));
        let found = measure(&image, &start.unwrap(), Background::Plane);
        found.unwrap().fit
    }

    /// Mean square of the errors of the four numbers over what noise makes of their variances.
    fn square_pull(fit: &LatticeFit, added: &Matrix2<f64>) -> f64 {
        let off = fit.wave_vectors.basis - added - pair();
        let doubt = fit.contrast.map_or_else(Matrix4::zeros, |c| {
            let beside = Vector4::from_column_slice(c.beside.as_slice());
            beside * beside.transpose()
        });
        let variances = (fit.wave_vectors.covariance - doubt).diagonal();
        let squares = off.iter().zip(variances.iter()).map(|(d, v)| d * d / v);
        squares.sum::<f64>() / 4.0
    }

    /// Where contrast falls slowly the errors cover what wave vectors are off, by noise alone; without what was added they would not.
    #[test]
    fn fading_contrast_moves_no_wave_vector() {
        let (mut with, mut without, mut added) = (0.0, 0.0, 0);
        for seed in 0..SEEDS {
            let fit = fitted(seed, 0.3, 0.1);
            let shift = fit.contrast.map_or_else(Matrix2::zeros, |c| c.shift);
            added += usize::from(shift != Matrix2::zeros());
            // A single image has the doubt, too.
            let variances = fit.wave_vectors.covariance.diagonal();
            let doubts = shift.iter().zip(variances.iter());
            assert!(doubts.fold(true, |all, (s, v)| all && *v > (0.3 * s).powi(2)));
            with += square_pull(&fit, &Matrix2::zeros()) / SEEDS as f64;
            without += square_pull(&fit, &shift) / SEEDS as f64;
        }
        assert!(added as u64 > SEEDS * 9 / 10, "{added}");
        let [with, without] = [with, without].map(f64::sqrt);
        assert!(
            (0.7..1.3).contains(&with) && without > 2.0,
            "{with} {without}"
        );
    }

    /// Contrast that is the same everywhere is said to change once in a thousand images.
    #[test]
    fn even_contrast_is_left_alone() {
        let changed = (0..SEEDS).filter(|seed| fitted(*seed, 1e4, 0.5).contrast.is_some());
        assert_eq!(changed.count(), 0);
    }
}
