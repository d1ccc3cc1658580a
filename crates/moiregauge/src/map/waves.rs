//! Envelopes of all harmonics → the two local wave vectors, their covariance and how they close.
//!
//! Every harmonic (h, k) says `h q₁ + k q₂`; weighted least squares over all of them. For white or locally
//! white noise of level S the variance of a slope is `S/(2|c₀|²)` in units of the noise Γ of the window: one cosine of
//! amplitude A = 2|c₀| under a whole window has `σ_g = (σ/A)/(2√π w²)`. Offsets of lines that could not be taken off
//! (variance R per line, see [`crate::window::lines`]) add to a harmonic g under a window w, in units of the white noise:
//!
//! ```text
//! phase         (R/S) e^{−gₓ²wₓ²} 2√π wₓ
//! slope along x (R/S) e^{−gₓ²wₓ²} 4√π gₓ² wₓ³
//! slope along y (R/S) e^{−gₓ²wₓ²} 2√π wₓ
//! ```
//!
//! from the transforms `e^{−κ²w²/2}` and `κ e^{−κ²w²/2}` of the window and its slope. Both components have weights
//! of their own then.
//!
//! Two gradients and more over-determine q₁ and q₂: χ² of what is left is the closure test.

use std::f64::consts::{E, PI};

use nalgebra::{Matrix2, Matrix4, Vector2};
use rayon::prelude::*;

use crate::numbers::interrupt;
use crate::spectrum::shells::FIRST_SHELL;
use crate::window::blocks::Blocks;
use crate::window::leaks::{ROUNDING, pulls};
use crate::window::lines::Levelled;
use crate::window::mixed::Mixed;
use crate::window::noise::Noise;
use crate::window::smooth::{Smoothed, Support};

/// Blocks of a fifth of a period take waves for another that are 2π·5/|q₁|λ = 4.33 lengths of q₁ away: for those of the
/// first shell, waves of at least this length.
const ALIASED: f64 = 3.33;

/// The local lattice at a node, in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalLattice {
    /// q₁, q₂ as columns, rad per pixel.
    pub(crate) pair: Matrix2<f64>,
    /// Covariance of (q₁x, q₁y, q₂x, q₂y).
    pub(crate) covariance: Matrix4<f64>,
    /// One over the variances of the phases of the first three harmonics, 1/rad²; 0 for one that does not stand out.
    pub(crate) phase_weights: [f64; 3],
    /// χ² of the closure, and its degrees of freedom.
    pub(crate) chi2: f64,
    pub(crate) freedom: usize,
    /// Signal power over noise power of the window, all harmonics.
    pub(crate) signal_to_noise: f64,
}

impl LocalLattice {
    /// Variance of a component (0: x, 1: y) of a wave (0: q₁, 1: q₂).
    pub(crate) fn variance(&self, axis: usize, wave: usize) -> f64 {
        self.covariance[(2 * wave + axis, 2 * wave + axis)]
    }
}

/// Why a node has no lattice of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Nothing {
    /// The window holds no pixels.
    NoPixels,
    /// The signal does not stand out.
    Weak,
}

/// What the regression needs beside envelopes.
pub(crate) struct Harmonics<'a> {
    /// (h, k) of each envelope.
    indices: &'a [[i32; 2]],
    noise: &'a Noise,
    /// Variance of the offsets of lines that are left at each, see [`crate::window::lines`].
    ridges: Vec<f64>,
    /// Width of the window along x, pixels.
    width: f64,
    /// How far other harmonics that reach through the window can pull each slope, rad per pixel.
    leaks: Vec<f64>,
}

impl<'a> Harmonics<'a> {
    /// Of an image, under a window of `window` nm.
    pub(crate) fn new(mixed: &'a Mixed, noise: &'a Noise, image: &Levelled, window: f64) -> Self {
        let (indices, amplitudes) = (&mixed.indices, mixed.amplitudes());
        let width = mixed.reference.in_pixels(window);
        let beyond = beyond(indices, &amplitudes);
        // A wave that is off by δ from one whole turn per block comes through by δb/2π, and pulls by δ e^{−δ²w²/2} of
        // that: 2b/(2πe w²) at most.
        let pull = |i: usize| match mixed.blocks.block[i] {
            1 => 0.0,
            b => b as f64 / (PI * E * width[i] * width[i]),
        };
        let aliased = beyond * pull(0).max(pull(1));
        let wave = |i: usize| mixed.reference.wave(indices[i]);
        let leak = |i: usize| {
            let own = amplitudes[i].max(f64::MIN_POSITIVE);
            let apart = |j: usize, sign: i32| wave(i) - f64::from(sign) * wave(j);
            let least = ROUNDING / width[0].min(width[1]) + aliased / own;
            pulls(i, &amplitudes, width, apart).fold(least, |sum, pull| sum + pull)
        };
        let ridge = |&index: &[i32; 2]| image.ridge(mixed.reference.wave(index));
        Self {
            indices,
            noise,
            ridges: indices.iter().map(ridge).collect(),
            width: width[0],
            leaks: (0..indices.len()).map(leak).collect(),
        }
    }
}

/// Amplitude of harmonics far beyond those used, which blocks take for others: where even the fourth shell is used, as the
/// amplitudes fall from the first to it.
fn beyond(indices: &[[i32; 2]], amplitudes: &[f64]) -> f64 {
    let of_shell = |order: i32| {
        let members = indices.iter().zip(amplitudes);
        let found = members.filter(|([h, k], _)| h * h + h * k + k * k == order);
        found.map(|(_, amplitude)| *amplitude).fold(0.0, f64::max)
    };
    let (first, fourth) = (of_shell(1), of_shell(7));
    if first <= 0.0 {
        return 0.0;
    }
    let shells = (ALIASED - 1.0) / (7f64.sqrt() - 1.0);
    first * (fourth / first).min(1.0).powf(shells)
}

/// Variances of a harmonic at a node, in units of the white noise of the window.
struct Variances {
    /// Of white noise, whatever the component.
    plain: f64,
    /// Of the phase and of the components of the slope.
    phase: f64,
    slope: [f64; 2],
}

/// Power that offsets of lines (variance `ridge`) add to an envelope, as the level of white noise that adds as much;
/// `turn` is gₓwₓ.
pub(crate) fn level_of_ridge(ridge: f64, turn: f64, width: f64) -> f64 {
    ridge * (-turn * turn).exp() * 2.0 * PI.sqrt() * width
}

/// The local lattice of every node. `taken` gives what was taken off at a place: the slopes of the carrier and the
/// mean pair together, rad per pixel.
pub(crate) fn local_lattices(
    blocks: &Blocks,
    smoothed: &Smoothed,
    harmonics: &Harmonics,
    taken: impl Fn(Vector2<f64>) -> Matrix2<f64> + Sync,
) -> Vec<Result<LocalLattice, Nothing>> {
    (0..smoothed.nodes.len())
        .into_par_iter()
        .map(|node| {
            interrupt::check();
            let support = smoothed.support[node].ok_or(Nothing::NoPixels)?;
            let at = smoothed.nodes.place(blocks, node);
            let taken = taken(at);
            let terms = Terms::new(smoothed, node, harmonics, at, &taken)?;
            terms.regression(&support, taken)
        })
        .collect()
}

/// A harmonic in the regression.
struct Term {
    index: Vector2<f64>,
    slope: Vector2<f64>,
    variances: Variances,
}

/// The harmonics that stand out at a node.
struct Terms {
    all: Vec<Term>,
    signal_to_noise: f64,
}

impl Terms {
    /// `taken` has been taken off at the node's place `at`. Two harmonics have to be strong, and not in line.
    fn new(
        smoothed: &Smoothed,
        node: usize,
        harmonics: &Harmonics,
        at: Vector2<f64>,
        taken: &Matrix2<f64>,
    ) -> Result<Self, Nothing> {
        let support = smoothed.support[node].ok_or(Nothing::NoPixels)?;
        let ratio = harmonics.noise.ratio(at);
        let spread = 0.5 * support.slope_noise.trace();
        let mut all = Vec::with_capacity(harmonics.indices.len());
        let mut strong = Vec::with_capacity(harmonics.indices.len());
        let mut signal_to_noise = 0.0;
        for (i, envelope) in smoothed.envelopes.iter().enumerate() {
            let index = Vector2::from(harmonics.indices[i].map(f64::from));
            let level = harmonics.noise.levels[i] * ratio;
            let turn = (taken * index).x * harmonics.width;
            let ridge = level_of_ridge(harmonics.ridges[i], turn, harmonics.width);
            let unit = (level + ridge) * support.amplitude_noise;
            let Some(standing) = envelope.standing(node, unit) else {
                continue;
            };
            if standing.is_strong {
                strong.push(harmonics.indices[i]);
            }
            signal_to_noise += standing.to_noise;
            let leaks = (harmonics.leaks[i].powi(2) + standing.unsure.powi(2)) / spread;
            let noise = harmonics.noise.disagreement * level / (2.0 * standing.signal);
            let plain = noise + leaks;
            let ridge = ridge / (2.0 * standing.signal);
            all.push(Term {
                index,
                slope: standing.slope,
                variances: Variances {
                    plain,
                    phase: plain + ridge,
                    slope: [plain + 2.0 * turn * turn * ridge, plain + ridge],
                },
            });
        }
        let in_line = |a: &[i32; 2], b: &[i32; 2]| a[0] * b[1] == a[1] * b[0];
        if strong.iter().all(|a| strong.iter().all(|b| in_line(a, b))) {
            return Err(Nothing::Weak);
        }
        Ok(Self {
            all,
            signal_to_noise,
        })
    }

    /// `Σ weight (h, k)(h, k)ᵀ`.
    fn normal(&self, weight: impl Fn(&Variances) -> f64) -> Matrix2<f64> {
        let outer = |t: &Term| weight(&t.variances) * t.index * t.index.transpose();
        self.all.iter().map(outer).sum()
    }

    /// Weighted least squares over all of them.
    fn regression(&self, support: &Support, taken: Matrix2<f64>) -> Result<LocalLattice, Nothing> {
        let inverse = |m: Matrix2<f64>| m.try_inverse().ok_or(Nothing::Weak);
        let indices = [
            inverse(self.normal(|v| 1.0 / v.slope[0]))?,
            inverse(self.normal(|v| 1.0 / v.slope[1]))?,
        ];
        let mut pair = Matrix2::zeros();
        for (axis, indices) in indices.iter().enumerate() {
            let terms = self.all.iter();
            let right = terms.map(|t| t.index * t.slope[axis] / t.variances.slope[axis]);
            let row: Vector2<f64> = indices * right.sum::<Vector2<f64>>();
            pair.set_row(axis, &row.transpose());
        }
        let noise = &support.slope_noise;
        let both = self.normal(|v| v.plain / (v.slope[0] * v.slope[1]));
        let mixed = indices[0] * both * indices[1];
        let covariance = Matrix4::from_fn(|a, b| match (a % 2, b % 2) {
            (0, 1) => mixed[(a / 2, b / 2)] * noise[(0, 1)],
            (1, 0) => mixed[(b / 2, a / 2)] * noise[(0, 1)],
            (axis, _) => indices[axis][(a / 2, b / 2)] * noise[(axis, axis)],
        });
        let chi2 = self.closure(&pair, noise).ok_or(Nothing::NoPixels)?;
        Ok(LocalLattice {
            pair: pair + taken,
            covariance,
            phase_weights: self.phase_weights().map(|w| w / support.amplitude_noise),
            chi2,
            freedom: 2 * self.all.len() - 4,
            signal_to_noise: self.signal_to_noise,
        })
    }

    /// One over the variances of the phases of the first three harmonics, in units of the noise of the window.
    fn phase_weights(&self) -> [f64; 3] {
        let mut weights = [0.0; 3];
        for (weight, index) in weights.iter_mut().zip(FIRST_SHELL) {
            let index = Vector2::from(index.map(f64::from));
            let term = self.all.iter().find(|t| t.index == index);
            *weight = term.map_or(0.0, |t| 1.0 / t.variances.phase);
        }
        weights
    }

    /// χ² of what a pair leaves of the slopes.
    fn closure(&self, pair: &Matrix2<f64>, noise: &Matrix2<f64>) -> Option<f64> {
        let mut chi2 = 0.0;
        for term in &self.all {
            let miss = term.slope - pair * term.index;
            let Variances { plain, slope, .. } = term.variances;
            let of_term = Matrix2::new(
                slope[0] * noise[(0, 0)],
                plain * noise[(0, 1)],
                plain * noise[(0, 1)],
                slope[1] * noise[(1, 1)],
            );
            chi2 += (miss.transpose() * of_term.try_inverse()? * miss)[0];
        }
        Some(chi2)
    }
}

#[cfg(test)]
mod tests {
    use crate::map::local::local_lattices;
    use crate::map::tests::{pulls, rms};
    use crate::simulate::field::FieldScene;
    use crate::window::mask::Mask;
    use crate::window::types::{Reference, Resolution};

    /// Peaks so sharp that harmonics beyond those used come through the blocks, with little noise: that makes no defects,
    /// nor scatter beyond the errors.
    #[test]
    fn sharp_peaks_have_no_defects() {
        let mut scene = FieldScene::hexagonal([900, 900], 60.0, 0.2);
        let mut image = scene.image();
        scene.harmonics.clear();
        (scene.white, scene.seed) = (0.3, 4);
        for (value, noise) in image.values.iter_mut().zip(scene.image().values) {
            *value = (1.6 * (*value - 1.5)).exp() - 0.5 + noise;
        }
        for window in [36.0, 60.0] {
            let reference = Reference {
                pair: scene.pair,
                pitch: [1.0; 2],
            };
            let resolution = Resolution {
                window_nm: Some(window),
                ..Resolution::default()
            };
            let map = local_lattices(&image, &reference, &resolution).unwrap();
            let good = map.nodes.iter().filter(|n| n.mask == Mask::Good).count();
            let flagged = map.nodes.iter().filter(|n| n.mask > Mask::Margin).count();
            assert!(50 * flagged < good, "{window}: {flagged} of {good}");
            let [stated, _] = pulls(&scene, &map, 1.0);
            assert!(rms(&stated) < 1.2, "{window}: {}", rms(&stated));
        }
    }
}
