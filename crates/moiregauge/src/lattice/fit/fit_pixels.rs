//! The fit itself: Gauss–Newton on two wave vectors, harmonics added where they earn it.

use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector, Matrix2, SMatrix, Vector2};
use rustfft::num_complex::Complex64;

use crate::frame::background::Background;
use crate::frame::image::Image;
use crate::lattice::fit::bend::Inhomogeneity;
use crate::lattice::fit::first::at_first;
use crate::lattice::fit::folded::{Bends, Folded};
use crate::lattice::fit::frame::{BENT, Basis, Frame};
use crate::lattice::fit::gram::gram;
use crate::lattice::fit::leverage::Leverage;
use crate::lattice::fit::lines::LineStatistics;
use crate::lattice::fit::model::{Clip, LineOffsets, Model, look, settled};
use crate::lattice::fit::noise::ResidualNoise;
use crate::lattice::fit::places::{InPlaces, Places};
use crate::lattice::fit::tables::Tables;
use crate::lattice::fit::{bend, frame, solve};
use crate::numbers::MOST_ROUNDS;
use crate::numbers::dot::dot;
use crate::spectrum::harmonics::Harmonics;
use crate::spectrum::shells::FIRST_SHELL;

/// It stands still when what a step leaves is less than this, all parameters together, in units of their errors,
/// squared: 0.22 σ.
const STILL: f64 = 0.05;
/// The share of itself that a step leaves: this, that of the residuals cut off, and the phase by which
/// it turned the edges (the model is linear in it to that order).
const LEFT: f64 = 0.01;
/// Rounds of adding harmonics: as many as there are shells.
pub(crate) const ROUNDS: usize = 5;

/// A fit under way.
pub(crate) struct Fit<'a> {
    pub(crate) frame: Frame<'a>,
    pub(crate) model: Model,
    pub(crate) lines: LineOffsets,
    /// Each line's mean is gone already.
    free_lines: bool,
    pub(super) line_sigma: Option<f64>,
    /// Standard deviation of the residuals.
    pub(crate) sigma: f64,
    /// Residuals cut off.
    clipped: usize,
    /// The pair at the start, phase at the edges.
    origin: Matrix2<f64>,
    /// `Φᵀ W Φ` of the last step.
    pub(super) gram: DMatrix<f64>,
    /// `Φᵀ W` times the residual of the last step.
    pub(super) gradient: DVector<f64>,
    /// Nothing has changed since the last step.
    pub(crate) settled: bool,
}

/// The noise of a finished fit.
pub(crate) struct FinalNoise {
    pub(crate) residual: ResidualNoise,
    /// Noise power at each harmonic as it acts along x, along y and on the phase, where noise is the same everywhere.
    pub(crate) local: Vec<[f64; 3]>,
    /// Where it lies.
    pub(crate) places: InPlaces,
    /// Root mean square of the residual.
    pub(crate) rms: f64,
    /// What the residual says about a bent lattice, and about one whose contrast changes.
    pub(crate) bends: Bends,
    /// `Φᵀ W Φ` for that, once it was asked for.
    pub(crate) bent: OnceLock<DMatrix<f64>>,
}

impl FinalNoise {
    /// Noise power at each harmonic as it acts along x, along y and on the phase, wherever it lies.
    pub(crate) fn acting(&self) -> Vec<[f64; 3]> {
        let factors = self.places.factors;
        let acting = |local: &[f64; 3]| std::array::from_fn(|i| local[i] * factors[i]);
        self.local.iter().map(acting).collect()
    }

    /// Noise power at the first harmonics, in sum.
    pub(crate) fn power(&self) -> f64 {
        self.local.iter().take(FIRST_SHELL.len()).flatten().sum()
    }
}

impl<'a> Fit<'a> {
    pub(crate) fn new(image: &'a Image, start: &Harmonics, background: Background) -> Option<Self> {
        let frame = Frame::new(image);
        let free_lines = background == Background::LineMean;
        let degree = match background {
            Background::Mean => 0,
            Background::Plane | Background::LineMean => 1,
            Background::Quadratic => 2,
            Background::Cubic => 3,
        };
        let starts = at_first(start, frame.pixels())?;
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
        for _ in 0..MOST_ROUNDS {
            // The first step of all knows nothing of what is to be cut off.
            let blind = self.sigma.is_infinite();
            let (step, decrement) = self.step()?;
            let n = step.len();
            let turn = step.rows(n - 4, 4).amax();
            // Never by more than a quarter of the radius of convergence at once.
            let share = (std::f64::consts::FRAC_PI_8 / turn).min(1.0);
            self.model.add(step.as_slice(), share);
            let change = self.model.pair - self.origin;
            let third = change.column(1) - change.column(0);
            if !(change.amax().max(third.amax()) < std::f64::consts::FRAC_PI_2) {
                return None;
            }
            // The normal equations are those of straight waves.
            let left = match self.frame.displacement {
                Some(_) => 1.0,
                None => LEFT + turn + self.clipped(),
            };
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
        let clip = self.clip();
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
        let clip = self.clip();
        let tables = Tables::new(&self.frame, &self.model.pair, &self.model.basis.indices);
        let (frame, model) = (&self.frame, &self.model);
        let lines = &self.lines;
        let places = Places::new(frame, model, self.has_offsets());
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
            let of_places =
                (frame.present[row] > 0).then(|| places.of_line(row, line, frame.image.row(row)));
            (settled.offset, bends, of_places, dot(line, line))
        };
        let room = || Folded::new(frame);
        let (residual, seen) = ResidualNoise::new(frame, self.free_lines, room, residual);
        let (mut bends, mut squares) = (Bends::new(model.waves.len()), 0.0);
        let mut of_places = Vec::with_capacity(seen.len());
        for (row, (offset, of_line, in_places, square)) in seen.into_iter().enumerate() {
            self.lines.offset[row] = offset;
            of_places.push(in_places);
            squares += square;
            if let Some(of_line) = of_line {
                bends.add(&of_line);
            }
        }
        let places = places.of_lines(&self.frame, &self.model, &of_places);
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
            places,
            rms: (squares / freedom as f64).sqrt(),
            bends,
            bent: OnceLock::new(),
        })
    }

    /// Where residuals are cut off.
    pub(crate) fn clip(&self) -> Clip {
        Clip::at(self.sigma)
    }

    /// Whether lines have offsets, which take up what whole lines do.
    fn has_offsets(&self) -> bool {
        self.free_lines || self.line_sigma.is_some()
    }

    /// The same fit of another image with the same pixels.
    pub(crate) fn in_image<'b>(&self, image: &'b Image) -> Fit<'b> {
        Fit {
            frame: self.frame.with(image),
            model: self.model.clone(),
            lines: self.lines.clone(),
            gram: self.gram.clone(),
            gradient: self.gradient.clone(),
            ..*self
        }
    }

    /// Takes the waves of the fit to another image with the same pixels.
    pub(crate) fn refit(&mut self, image: &Image) -> Option<()> {
        let mut again = self.in_image(image);
        again.converge()?;
        let (model, gram, gradient) = (again.model, again.gram, again.gradient);
        (self.model, self.gram, self.gradient) = (model, gram, gradient);
        Some(())
    }

    /// The share of the pixels whose residuals are cut off.
    pub(crate) fn clipped(&self) -> f64 {
        self.clipped as f64 / self.frame.pixels() as f64
    }

    fn leverage(&self) -> Option<Leverage<'_>> {
        let map = solve::contraction(&self.model, |_, _| 1.0);
        Leverage::new(
            &self.frame,
            &self.model,
            &(map.transpose() * &self.gram * map),
        )
    }

    /// Covariance of the phases of the first three harmonics and of (p₁, p₂): what the local noise does to
    /// the seven derivatives when background and amplitudes are free.
    pub(crate) fn covariance(&self, noise: &FinalNoise) -> Option<SMatrix<f64, 7, 7>> {
        const FIRST: usize = FIRST_SHELL.len();
        let model = &self.model;
        let plain = solve::contraction(model, |_, _| 1.0);
        let plain = solve::by_phases(model, FIRST, &plain, |_| 1.0);
        let bread = solve::projected(&self.gram, &plain, FIRST + 4)?;
        let acting = noise.acting();
        let weight = |i: usize, axis: usize| acting[i][axis].sqrt();
        let noisy = solve::contraction(model, weight);
        let noisy = solve::by_phases(model, FIRST, &noisy, |i| weight(i, 2));
        let meat = solve::projected(&self.gram, &noisy, FIRST + 4)?;
        let inverse = solve::inverse(&bread)?;
        // Pixels whose residuals are cut off do not follow the model.
        let follow = 1.0 - self.clipped();
        let covariance = &inverse * meat * &inverse / (follow * follow);
        Some(covariance.fixed_view::<7, 7>(0, 0).into_owned())
    }

    /// `Φᵀ W Φ` of the waves times such powers.
    pub(crate) fn gram_of(&self, orders: &'static [[usize; 2]]) -> DMatrix<f64> {
        let (frame, model) = (&self.frame, &self.model);
        let basis = Basis {
            orders,
            ..model.basis.clone()
        };
        gram(frame, &basis, &model.pair, &self.lines.lambda)
    }

    /// The same times the powers that bend a lattice, and that its contrast has.
    pub(crate) fn bent_gram<'n>(&self, noise: &'n FinalNoise) -> &'n DMatrix<f64> {
        noise.bent.get_or_init(|| self.gram_of(BENT))
    }

    /// How the lattice changes across the frame.
    pub(crate) fn inhomogeneity(&self, noise: &FinalNoise) -> Option<Inhomogeneity> {
        let (bends, acting) = (&noise.bends, noise.acting());
        let gram = self.bent_gram(noise);
        let found = bend::inhomogeneity(&self.frame, &self.model, gram, bends, &acting);
        found.map(|(inhomogeneity, _)| inhomogeneity)
    }
}
