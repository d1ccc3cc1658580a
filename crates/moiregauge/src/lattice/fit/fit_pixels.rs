//! The fit itself: Gauss–Newton on two wave vectors, harmonics added where they earn it.

use heterostrain::lattice::{Lattice, Px, Waves};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, SMatrix, Vector2};
use rustfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};

use crate::frame::background::Background;
use crate::frame::image::Image;
use crate::lattice::fit::bend::{FOLLOWED, Inhomogeneity};
use crate::lattice::fit::closure::Closure;
use crate::lattice::fit::folded::{Bends, Folded};
use crate::lattice::fit::frame::{Basis, Frame};
use crate::lattice::fit::gram::gram;
use crate::lattice::fit::left::LeftOver;
use crate::lattice::fit::lines::LineStatistics;
use crate::lattice::fit::model::{Clip, LineOffsets, Model, Tables, look, residuals, settled};
use crate::lattice::fit::noise::{ForeignWave, Leverage, ResidualNoise};
use crate::lattice::fit::{bend, beside, choose, closure, frame, solve};
use crate::numbers::dot::dot;
use crate::numbers::exact;
use crate::spectrum::harmonics::Harmonics;
use crate::spectrum::phases::Phases;
use crate::spectrum::shells::FIRST_SHELL;

/// Steps until the fit has to stand still. Chosen by eye.
const MOST_STEPS: usize = 30;
/// It stands still when what a step leaves is less than this, all parameters together, in units of their errors,
/// squared: 0.22 σ.
const STILL: f64 = 0.05;
/// The share of itself that a step leaves: this, that of the residuals cut off, and the phase by which
/// it turned the edges (the model is linear in it to that order).
const LEFT: f64 = 0.01;
/// Rounds of adding harmonics: as many as there are shells.
pub(crate) const ROUNDS: usize = 5;

/// A lattice fitted to the pixels of an image.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LatticeFit {
    /// The wave vectors q₁, q₂ (about 60° apart), rad per pixel along columns and rows.
    #[serde(with = "exact")]
    pub wave_vectors: Waves<Px>,
    /// Where the phases hold, pixels (column, row): the centre of the frame.
    #[serde(with = "exact")]
    pub centre: Vector2<f64>,
    /// The harmonics, first shell first.
    pub harmonics: Vec<FittedHarmonic>,
    /// Covariance of the phases of the first three harmonics, rad². Where line offsets or neighbours take
    /// up a part of a harmonic its phase is less certain than its signal and noise say.
    #[serde(with = "exact")]
    pub phase_covariance: Matrix3<f64>,
    /// Residual over noise, root mean square: 1 for white noise and a model that is complete; more
    /// where the noise is coloured or the lattice is not the same everywhere.
    #[serde(with = "exact")]
    pub goodness: f64,
    /// Standard deviation of the line offsets, units of the image; `None` where none are used.
    #[serde(with = "exact")]
    pub line_offsets: Option<f64>,
    /// Lines left out because they went wrong or are mostly missing.
    pub lines_left_out: usize,
    /// Share of the pixels whose residuals are cut off; 0.3 % for Gaussian noise.
    #[serde(with = "exact")]
    pub clipped: f64,
    /// The strongest wave that is left and none of the lattice's: a second lattice, or pick-up.
    pub foreign_wave: Option<ForeignWave>,
    /// The transform of what is left, across the lines from each of the first three harmonics: two images tell by it what noise they
    /// share.
    #[serde(default)]
    pub(crate) residual: [LeftOver; 3],
    /// How the lattice changes across the frame; `None` where the frame is too small to tell.
    pub inhomogeneity: Option<Inhomogeneity>,
    /// Whether the harmonics agree on one lattice; `None` where too few of them are strong. The
    /// covariance of `wave_vectors` is enlarged already where they do not.
    pub closure: Option<Closure>,
}

/// One harmonic of a fitted lattice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FittedHarmonic {
    /// (h, k): the wave vector is `h q₁ + k q₂`.
    pub index: [i32; 2],
    /// A of `A cos(q·(n − centre) + φ)`, units of the image.
    #[serde(with = "exact")]
    pub amplitude: f64,
    /// φ, rad. Far from other harmonics and from line offsets its standard error is
    /// `1/(√2 · signal_to_noise)`.
    #[serde(with = "exact")]
    pub phase: f64,
    /// Amplitude over noise amplitude in one resolution cell.
    #[serde(with = "exact")]
    pub signal_to_noise: f64,
}

/// Fits the lattice, starting from what the spectrum of `image` says.
///
/// `None` where the fit does not settle within half a cycle over the frame of its start, or the
/// harmonics cannot be told apart on this frame. Everything counts in pixels of `image`.
pub(crate) fn measure(
    image: &Image,
    start: &Harmonics,
    background: Background,
) -> Option<(Lattice<Px>, LatticeFit)> {
    let (fit, noise) = finished(image, start, background)?;
    let foreign = noise.residual.foreign_wave(&fit.frame, &fit.model);
    let again = foreign.and_then(|wave| fit.again_without(&wave, &noise, start, background));
    again.or_else(|| fit.result(&noise, foreign))
}

/// The fit with all harmonics that earn their place, and the noise that it leaves.
fn finished<'a>(
    image: &'a Image,
    start: &Harmonics,
    background: Background,
) -> Option<(Fit<'a>, FinalNoise)> {
    let mut fit = Fit::new(image, start, background)?;
    if fit.worth_a_sketch(start) && fit.sketch().is_none() {
        fit = Fit::new(image, start, background)?;
    }
    let noise = fit.choose()?;
    Some((fit, noise))
}

/// A fit under way.
pub(crate) struct Fit<'a> {
    pub(crate) frame: Frame<'a>,
    pub(crate) model: Model,
    pub(crate) lines: LineOffsets,
    /// Each line's mean is gone already.
    free_lines: bool,
    line_sigma: Option<f64>,
    /// Standard deviation of the residuals.
    pub(crate) sigma: f64,
    /// Residuals cut off.
    clipped: usize,
    /// The pair at the start, phase at the edges.
    origin: Matrix2<f64>,
    /// `Φᵀ W Φ` of the last step.
    gram: DMatrix<f64>,
    /// `Φᵀ W` times the residual of the last step.
    gradient: DVector<f64>,
    /// Nothing has changed since the last step.
    pub(crate) settled: bool,
}

/// The noise of a finished fit.
pub(crate) struct FinalNoise {
    pub(crate) residual: ResidualNoise,
    /// Noise power at each harmonic as it acts along x, along y and on the phase.
    pub(crate) local: Vec<[f64; 3]>,
    /// Root mean square of the residual.
    rms: f64,
    /// What the residual says about a bent lattice.
    bends: Bends,
}

impl<'a> Fit<'a> {
    fn new(image: &'a Image, start: &Harmonics, background: Background) -> Option<Self> {
        let frame = Frame::new(image);
        let free_lines = background == Background::LineMean;
        let degree = match background {
            Background::Mean => 0,
            Background::Plane | Background::LineMean => 1,
            Background::Quadratic => 2,
            Background::Cubic => 3,
        };
        let starts = choose::at_first(start, frame.pixels())?;
        let indices: Vec<[i32; 2]> = starts.iter().map(|(index, _)| *index).collect();
        let basis = Basis::new(degree, free_lines, &indices);
        let origin = Matrix2::from_diagonal(&frame.edge()) * start.pair;
        let centre = frame.edge() - Vector2::repeat(0.5);
        // 2 Re(c e^{iθ}), the phase moved from pixel (0, 0) to the centre.
        let waves = starts.iter().map(|(_, harmonic)| {
            let c = 2.0 * harmonic.amplitude * Complex64::cis(harmonic.q.dot(&centre));
            [c.re, -c.im]
        });
        let all_of_it = if free_lines { 1.0 } else { 0.0 };
        Some(Self {
            model: Model {
                background: vec![0.0; basis.terms.len()],
                waves: waves.collect(),
                pair: origin,
                basis,
            },
            lines: LineOffsets {
                lambda: vec![all_of_it; image.rows],
                offset: vec![0.0; image.rows],
            },
            frame,
            free_lines,
            line_sigma: None,
            // Nothing is cut off at first.
            sigma: f64::INFINITY,
            clipped: 0,
            origin,
            gram: DMatrix::zeros(0, 0),
            gradient: DVector::zeros(0),
            settled: false,
        })
    }

    /// Steps until nothing moves any more.
    pub(crate) fn converge(&mut self) -> Option<()> {
        for _ in 0..MOST_STEPS {
            // The first step of all knows nothing of what is to be cut off.
            let blind = self.sigma.is_infinite();
            let (step, decrement) = self.step()?;
            let n = step.len();
            let turn = step.rows(n - 4, 4).amax();
            // Never by more than a quarter of the radius of convergence at once.
            let share = (std::f64::consts::FRAC_PI_8 / turn).min(1.0);
            self.apply(&step, share);
            let change = self.model.pair - self.origin;
            let third = change.column(1) - change.column(0);
            if !(change.amax().max(third.amax()) < std::f64::consts::FRAC_PI_2) {
                return None;
            }
            let left = LEFT + turn + self.clipped as f64 / self.frame.pixels() as f64;
            let still = decrement * left * left < STILL * self.sigma.powi(2) && !blind;
            if share == 1.0 && (still || turn < 1e-13) {
                self.settled = true;
                return Some(());
            }
        }
        None
    }

    /// The change of all parameters by the normal equations, and how much it lowers the sum of
    /// squares.
    fn step(&mut self) -> Option<(DVector<f64>, f64)> {
        let (model, frame) = (&self.model, &self.frame);
        let tables = Tables::new(frame, &model.pair, &model.basis.indices);
        let clip = Clip::at(self.sigma);
        let lines = &mut self.lines;
        let seen = look(frame, model, &tables, &model.basis, &tables, lines, clip);
        let gram = gram(frame, &model.basis, &model.pair, &self.lines.lambda);
        let map = solve::contraction(model, |_, _| 1.0);
        let right = map.transpose() * &seen.gradient;
        let step = solve::solve(&(map.transpose() * &gram * map), &right)?;
        self.gram = gram;
        self.gradient = seen.gradient;
        self.sigma = seen.sigma;
        self.clipped = seen.clipped;
        let decrement = step.dot(&right);
        Some((step, decrement))
    }

    fn apply(&mut self, step: &DVector<f64>, share: f64) {
        let terms = self.model.background.len();
        for (value, change) in self.model.background.iter_mut().zip(step.iter()) {
            *value += share * change;
        }
        for (i, wave) in self.model.waves.iter_mut().enumerate() {
            wave[0] += share * step[terms + 2 * i];
            wave[1] += share * step[terms + 2 * i + 1];
        }
        for (i, value) in self.model.pair.iter_mut().enumerate() {
            *value += share * step[step.len() - 4 + i];
        }
    }

    /// Looks at the lines: leaves out bad ones, gives them offsets where these matter. Whether that
    /// changes anything.
    pub(crate) fn mind_the_lines(&mut self) -> bool {
        let statistics = LineStatistics::new(&self.frame, &self.model);
        let bad = statistics.bad(&self.frame);
        if !bad.is_empty() {
            let gone: Vec<bool> = self.frame.present.iter().map(|n| *n == 0).collect();
            self.frame.leave_out(|row| gone[row] || bad.contains(&row));
        }
        if self.free_lines {
            return !bad.is_empty();
        }
        let before = self.line_sigma;
        if statistics.offsets_matter(&self.frame) {
            self.lines.lambda = statistics.lambda(&self.frame);
            self.line_sigma = Some(statistics.sigma);
        } else {
            self.lines.lambda.fill(0.0);
            self.lines.offset.fill(0.0);
            self.line_sigma = None;
        }
        !bad.is_empty() || before != self.line_sigma
    }

    /// The noise that is left around each harmonic.
    pub(crate) fn noise(&mut self) -> Option<FinalNoise> {
        let clip = Clip::at(self.sigma);
        let tables = Tables::new(&self.frame, &self.model.pair, &self.model.basis.indices);
        let (frame, model) = (&self.frame, &self.model);
        let lines = &self.lines;
        let residual = |folded: &mut Folded, row: usize, line: &mut [f64]| {
            let settled = settled(frame, model, &tables, lines, clip, row, line);
            let bends = (frame.present[row] > 0).then(|| {
                folded.take(line);
                Bends::of_line(frame, &tables, row, folded)
            });
            for (value, pixel) in line.iter_mut().zip(frame.image.row(row)) {
                *value = if pixel.is_finite() {
                    *value + settled.kept
                } else {
                    0.0
                };
            }
            (settled.offset, bends, dot(line, line))
        };
        let room = || Folded::new(frame);
        let (residual, seen) = ResidualNoise::new(frame, self.free_lines, room, residual);
        let (mut bends, mut squares) = (Bends::new(model.waves.len()), 0.0);
        for (row, (offset, of_line, square)) in seen.into_iter().enumerate() {
            self.lines.offset[row] = offset;
            squares += square;
            if let Some(of_line) = of_line {
                bends.add(&of_line);
            }
        }
        let parameters = self.model.background.len() + 2 * self.model.waves.len() + 4;
        let lost = if self.free_lines {
            self.frame.lines()
        } else {
            0
        };
        let freedom = self.frame.pixels().saturating_sub(parameters + lost).max(1);
        let leverage = self.leverage()?;
        let level = residual.level();
        let lambda = self.lines.lambda.iter().sum::<f64>() / self.lines.lambda.len() as f64;
        let local = (0..self.model.waves.len())
            .map(|i| {
                let p = frame::wave(&self.model.pair, self.model.basis.indices[i]);
                residual.around(p, lambda, &leverage).unwrap_or([level; 3])
            })
            .collect();
        Some(FinalNoise {
            residual,
            local,
            rms: (squares / freedom as f64).sqrt(),
            bends,
        })
    }

    fn leverage(&self) -> Option<Leverage<'_>> {
        let map = solve::contraction(&self.model, |_, _| 1.0);
        Leverage::new(
            &self.frame,
            &self.model,
            &(map.transpose() * &self.gram * map),
        )
    }

    /// The same in the image without perfect waves beside the lattice, of which `strongest` is one; `None` where there are none. What is
    /// told of it is how it stands out of the noise that is then left.
    fn again_without(
        &self,
        strongest: &ForeignWave,
        noise: &FinalNoise,
        start: &Harmonics,
        background: Background,
    ) -> Option<(Lattice<Px>, LatticeFit)> {
        if !beside::is_strong(strongest) {
            return None;
        }
        let (frame, model) = (&self.frame, &self.model);
        let seen = |seen: &ResidualNoise| seen.foreign_wave(frame, model);
        let image = beside::without_waves(frame, &model.pair, self.left(), seen)?;
        let (fit, left) = finished(&image, start, background)?;
        let k = strongest.wave_vector.component_mul(&frame.edge()) / std::f64::consts::PI;
        let quieter = noise.residual.noise_near(k) / left.residual.noise_near(k);
        let told = ForeignWave {
            significance: strongest.significance * quieter.max(1.0),
            ..*strongest
        };
        fit.result(&left, Some(told))
    }

    /// What is left of all pixels, 0 where they do not count; offsets of lines are in it.
    fn left(&self) -> Vec<f64> {
        let (frame, model) = (&self.frame, &self.model);
        let tables = Tables::new(frame, &model.pair, &model.basis.indices);
        let mut left = vec![0.0; frame.image.values.len()];
        residuals(frame, model, &tables, |row, line| {
            let there = left[row * line.len()..].iter_mut().zip(line.iter());
            for (left, value) in there.filter(|(_, value)| value.is_finite()) {
                *left = *value;
            }
        });
        left
    }

    /// Covariance of the phases of the first three harmonics and of (p₁, p₂): what the local noise does to
    /// the seven derivatives when background and amplitudes are free.
    fn covariance(&self, noise: &FinalNoise) -> Option<SMatrix<f64, 7, 7>> {
        const FIRST: usize = FIRST_SHELL.len();
        let model = &self.model;
        let plain = solve::contraction(model, |_, _| 1.0);
        let plain = solve::by_phases(model, FIRST, &plain, |_| 1.0);
        let bread = solve::projected(&self.gram, &plain, FIRST + 4)?;
        let weight = |i: usize, axis: usize| noise.local[i][axis].sqrt();
        let noisy = solve::contraction(model, weight);
        let noisy = solve::by_phases(model, FIRST, &noisy, |i| weight(i, 2));
        let meat = solve::projected(&self.gram, &noisy, FIRST + 4)?;
        let inverse = solve::inverse(&bread)?;
        // Pixels whose residuals are cut off do not follow the model.
        let follow = 1.0 - self.clipped as f64 / self.frame.pixels() as f64;
        let covariance = &inverse * meat * &inverse / (follow * follow);
        Some(covariance.fixed_view::<7, 7>(0, 0).into_owned())
    }

    fn harmonics(&self, noise: &FinalNoise) -> Vec<FittedHarmonic> {
        let pixels = self.frame.pixels() as f64;
        let waves = self.model.waves.iter().zip(&self.model.basis.indices);
        waves
            .zip(&noise.local)
            .map(|((&[alpha, beta], &index), local)| {
                let amplitude = alpha.hypot(beta);
                FittedHarmonic {
                    index,
                    amplitude,
                    phase: (-beta).atan2(alpha),
                    signal_to_noise: 0.5 * amplitude * (pixels / local[2]).sqrt(),
                }
            })
            .collect()
    }

    fn result(
        &self,
        noise: &FinalNoise,
        foreign_wave: Option<ForeignWave>,
    ) -> Option<(Lattice<Px>, LatticeFit)> {
        let scale = self.frame.edge().map(|e| 1.0 / e);
        let harmonics = self.harmonics(noise);
        let strengths: Vec<f64> = harmonics.iter().map(|h| h.signal_to_noise).collect();
        let closure = closure::closure(
            &self.model,
            &self.gram,
            &self.gradient,
            &noise.local,
            &strengths,
        );
        let covariance = self.covariance(noise)?;
        let enlargement = closure.map_or(1.0, |closure| closure.enlargement());
        let inhomogeneity = bend::inhomogeneity(
            &self.frame,
            &self.model,
            &self.lines.lambda,
            &noise.bends,
            &noise.local,
        );
        let mut wave_vectors = Waves::new(
            self.model.pair,
            covariance.fixed_view::<4, 4>(3, 3) * enlargement,
        )
        .mapped(&Matrix2::from_diagonal(&scale));
        let clipped = self.clipped as f64 / self.frame.pixels() as f64;
        if let Some(change) = inhomogeneity.filter(Inhomogeneity::stands_out) {
            let (mean, covariance) = change.of_the_mean(clipped);
            wave_vectors.basis += mean;
            wave_vectors.covariance += covariance;
        }
        let [columns, rows] = [
            self.frame.image.columns as f64,
            self.frame.image.rows as f64,
        ];
        let fit = LatticeFit {
            wave_vectors,
            centre: Vector2::new(columns - 1.0, rows - 1.0) / 2.0,
            harmonics,
            phase_covariance: covariance.fixed_view::<3, 3>(0, 0).into_owned(),
            goodness: noise.rms / noise.residual.level().sqrt(),
            line_offsets: self.line_sigma,
            lines_left_out: self.frame.image.rows - self.frame.lines(),
            clipped,
            foreign_wave,
            residual: [0, 1, 2].map(|i| {
                let index = self.model.basis.indices[i];
                let offsets = self.free_lines || self.line_sigma.is_some();
                let p = frame::wave(&self.model.pair, index);
                noise.residual.samples(p, offsets)
            }),
            inhomogeneity,
            closure,
        };
        Some((wave_vectors.lattice()?, fit))
    }
}

impl LatticeFit {
    /// Phases of the first shell at the centre: q₁, q₂, q₂ − q₁.
    pub(crate) fn first_phases(&self) -> Phases {
        Phases {
            values: [0, 1, 2].map(|i| self.harmonics[i].phase),
            covariance: self.phase_covariance,
        }
    }

    /// How the lattice changes, where that is more than chance.
    pub(crate) fn change(&self) -> Option<&Inhomogeneity> {
        self.inhomogeneity.as_ref().filter(|c| c.stands_out())
    }

    /// Whether the lattice may bend more than the fit can follow.
    pub(crate) fn may_bend_more(&self) -> bool {
        self.change().is_some() && self.clipped >= FOLLOWED
    }

    /// Of the first shell.
    pub(crate) fn weakest_signal_to_noise(&self) -> f64 {
        let first = self.harmonics.iter().take(3);
        first.fold(f64::INFINITY, |least, h| least.min(h.signal_to_noise))
    }

    /// The same in pixels of which `binning` make one bin along each axis.
    pub(crate) fn in_pixels(mut self, binning: usize) -> Self {
        let size = binning as f64;
        self.wave_vectors = self.wave_vectors.mapped(&(Matrix2::identity() / size));
        self.centre = self.centre * size + Vector2::repeat((size - 1.0) / 2.0);
        for harmonic in &mut self.harmonics {
            let q = frame::wave(&self.wave_vectors.basis, harmonic.index);
            // The mean over a bin lowers the amplitude, and so it does the noise in a cell.
            harmonic.amplitude /= mean_over_bin(q.x, size) * mean_over_bin(q.y, size);
        }
        if let Some(foreign) = &mut self.foreign_wave {
            foreign.wave_vector /= size;
        }
        if let Some(change) = &mut self.inhomogeneity {
            change.mean /= size;
            change.noise /= size * size;
        }
        self
    }
}

/// Mean of `cos(q x)` over `size` pixels around 0.
fn mean_over_bin(q: f64, size: f64) -> f64 {
    let half = (q / 2.0).sin();
    if half.abs() < 1e-12 {
        1.0
    } else {
        (size * q / 2.0).sin() / (size * half)
    }
}
