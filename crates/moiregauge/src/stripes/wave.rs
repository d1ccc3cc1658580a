//! One pattern of stripes under a Gaussian window: the same as for lattices, with one wave and its overtones.
//!
//! Every harmonic n says `n q`; weighted least squares over all of them. One cosine of amplitude A in noise of σ
//! per pixel at ρ pixels per nm²: `σ_q = (σ/A)/(2√(πρ) w²)` for each component; with overtones A² becomes `Σ n² A_n²`.
//! What the harmonics leave, 2(N − 1) numbers, is the closure.

use nalgebra::{Matrix2, Rotation2, Vector2};
use rayon::prelude::*;

use crate::frame::image::Image;
use crate::window::blocks::Place;
use crate::window::leaks::{ROUNDING, pulls};
use crate::window::lines::Levelled;
use crate::window::mixed::{Mixed, is_slow};
use crate::window::smooth::Smoothed;
use crate::window::types::Reference;

/// Overtones that are looked for and used.
pub(crate) const ORDERS: i32 = 4;
/// Blocks per wavelength, more than of lattices: three overtones do not fold onto each other.
pub(crate) const BLOCKS: f64 = 8.0;
/// Smallest significant change of amplitude, noise units. On the scenes of docs/constants.md half and double change results by at most 0.01 σ.
const ENDS: f64 = 4.0;

/// A pattern in an image, mixed down.
pub(crate) struct Wave {
    /// Its harmonics n that are used, as (n, 0).
    pub(crate) mixed: Mixed,
    /// Noise at each harmonic: variance per pixel of white noise as strong.
    pub(crate) levels: Vec<f64>,
    /// Whether it was seen.
    pub(crate) noise_measured: bool,
}

/// The wave at a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Local {
    /// rad per pixel.
    pub(crate) wave: Vector2<f64>,
    /// Its variance in units of `slope`.
    pub(crate) variance: f64,
    pub(crate) slope: Matrix2<f64>,
    pub(crate) chi2: f64,
    pub(crate) freedom: usize,
    /// Power of all harmonics, and in units of noise.
    pub(crate) power: f64,
    pub(crate) signal_to_noise: f64,
}

/// The reference that stands for a wave: a second one of the same length at 60° to it, which nothing uses.
pub(crate) fn reference(wave: Vector2<f64>, pitch: [f64; 2]) -> Reference {
    let metric = Vector2::from(pitch);
    let turned = Rotation2::new(std::f64::consts::FRAC_PI_3) * wave.component_div(&metric);
    Reference {
        pair: Matrix2::from_columns(&[wave, turned.component_mul(&metric)]),
        pitch,
    }
}

impl Wave {
    /// Mixes an image (background gone) with a pattern and its overtones. `others` are the wave vectors of other
    /// patterns; `block`: pixels of a block.
    pub(crate) fn new(
        image: &Image,
        reference: Reference,
        others: &[Vector2<f64>],
        block: [usize; 2],
    ) -> Self {
        let (image, place) = (Levelled::as_is(image), Place::whole(image));
        let all = (1..=ORDERS).map(|n| [n, 0]);
        let indices: Vec<[i32; 2]> = all.filter(|&i| is_slow(&reference, i)).collect();
        let mut out = Self {
            levels: vec![image.variance(); indices.len()],
            noise_measured: false,
            mixed: Mixed::new(&image, place, reference, indices, block),
        };
        out.see_noise(&image, others);
        out.choose_harmonics();
        out.follow();
        out.choose_harmonics();
        out
    }

    /// nm.
    pub(crate) fn wavelength(&self) -> f64 {
        0.75f64.sqrt() * self.mixed.period
    }

    /// Wave vector of the pattern against which it is demodulated.
    pub(crate) fn first(&self) -> Vector2<f64> {
        self.mixed.reference.wave([1, 0])
    }

    /// Phase of the pattern at a node, rad.
    pub(crate) fn phase(&self, smoothed: &Smoothed, node: usize) -> f64 {
        let at = smoothed.nodes.place(&self.mixed.blocks, node);
        f64::from(smoothed.envelopes[0].amplitude[node].arg()) + self.mixed.carried(at).x
    }

    /// The wave at every node; `None` where no harmonic stands out. `others`: other patterns under the same window.
    pub(crate) fn locals(
        &self,
        smoothed: &Smoothed,
        width: f64,
        others: &[(&Self, &Smoothed)],
    ) -> Vec<Option<Local>> {
        let leaks = self.leaks(width);
        let pixels = Vector2::from(self.mixed.reference.in_pixels(width));
        let of_node = |node: usize| {
            let mut leaks = leaks.clone();
            self.beyond(smoothed, node, others, pixels, &mut leaks);
            let mut local = self.regression(smoothed, node, &leaks)?;
            let at = smoothed.nodes.place(&self.mixed.blocks, node);
            local.wave += self.mixed.taken_off(at, width).column(0);
            Some(local)
        };
        (0..smoothed.nodes.len())
            .into_par_iter()
            .map(of_node)
            .collect()
    }

    /// How far other harmonics that reach through the window can pull each slope, rad per pixel.
    fn leaks(&self, width: f64) -> Vec<f64> {
        let Mixed {
            reference, indices, ..
        } = &self.mixed;
        let (pixels, amplitudes) = (reference.in_pixels(width), self.mixed.amplitudes());
        let of = |i: usize| {
            let apart =
                |j: usize, sign: i32| reference.wave([indices[i][0] - sign * indices[j][0], 0]);
            pulls(i, &amplitudes, pixels, apart).sum::<f64>() + ROUNDING / pixels[0].min(pixels[1])
        };
        (0..indices.len()).map(of).collect()
    }

    /// Adds what harmonics that end nearby, those of other patterns and its own, leave in each slope. Of a wave that ends
    /// at a line across the window a Gaussian lets through `|∇c|` times what is left of the beat along that line, with a
    /// phase that is not known. Changes of amplitude within the noise do not count.
    fn beyond(
        &self,
        smoothed: &Smoothed,
        node: usize,
        others: &[(&Self, &Smoothed)],
        pixels: Vector2<f64>,
        leaks: &mut [f64],
    ) {
        let Some(support) = &smoothed.support[node] else {
            return;
        };
        let all = others.iter().copied().chain([(self, smoothed)]);
        for (other, envelopes) in all {
            let itself = std::ptr::eq(other, self);
            for (from, envelope) in envelopes.envelopes.iter().enumerate() {
                let amplitude = f64::from(envelope.amplitude[node].norm());
                let growth = Vector2::from(envelope.growth[node].map(f64::from));
                let noise = 0.5 * other.levels[from] * support.slope_noise.trace();
                if !((amplitude * growth.norm()).powi(2) > ENDS * ENDS * noise) {
                    continue;
                }
                let growth = growth.component_mul(&pixels);
                let ends = amplitude * growth.norm();
                let foreign = other.mixed.reference.wave(other.mixed.indices[from]);
                for (into, leak) in leaks.iter_mut().enumerate() {
                    let own = f64::from(smoothed.envelopes[into].amplitude[node].norm());
                    let mine = self.mixed.reference.wave(self.mixed.indices[into]);
                    for sign in [1.0, -1.0] {
                        if itself && from == into && sign > 0.0 {
                            continue;
                        }
                        let beat = (mine - foreign * sign).component_mul(&pixels);
                        let along = growth.perp(&beat) / growth.norm();
                        let left = (-0.5 * along * along).exp();
                        *leak = leak.hypot(ends * left / (own * pixels.min()));
                    }
                }
            }
        }
    }

    fn regression(&self, smoothed: &Smoothed, node: usize, leaks: &[f64]) -> Option<Local> {
        let support = smoothed.support[node]?;
        let spread = 0.5 * support.slope_noise.trace();
        let inverse = support.slope_noise.try_inverse()?;
        let (mut normal, mut right) = (0.0, Vector2::zeros());
        let (mut total, mut signal_to_noise, mut is_seen) = (0.0, 0.0, false);
        let mut terms = Vec::with_capacity(self.levels.len());
        for (i, envelope) in smoothed.envelopes.iter().enumerate() {
            let unit = self.levels[i] * support.amplitude_noise;
            let Some(standing) = envelope.standing(node, unit) else {
                continue;
            };
            is_seen |= standing.is_strong;
            total += standing.signal;
            signal_to_noise += standing.to_noise;
            let leak = leaks[i].powi(2) + standing.unsure.powi(2);
            let weight = 1.0 / (self.levels[i] / (2.0 * standing.signal) + leak / spread);
            let n = f64::from(self.mixed.indices[i][0]);
            normal += weight * n * n;
            right += weight * n * standing.slope;
            terms.push((weight, n, standing.slope));
        }
        if !is_seen {
            return None;
        }
        let wave = right / normal;
        let chi2 = terms.iter().map(|(weight, n, slope)| {
            let miss = slope - wave * *n;
            weight * (miss.transpose() * inverse * miss)[0]
        });
        Some(Local {
            wave,
            variance: 1.0 / normal,
            slope: support.slope_noise,
            chi2: chi2.sum(),
            freedom: 2 * terms.len() - 2,
            power: total,
            signal_to_noise,
        })
    }
}
