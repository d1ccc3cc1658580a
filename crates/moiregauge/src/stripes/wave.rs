//! One pattern of stripes under a Gaussian window: the same as for lattices, with one wave and its overtones.
//!
//! Every harmonic n says `n q`; weighted least squares over all of them. One cosine of amplitude A in noise of σ
//! per pixel at ρ pixels per nm²: `σ_q = (σ/A)/(2√(πρ) w²)` for each component; with overtones A² becomes `Σ n² A_n²`.
//! What the harmonics leave, 2(N − 1) numbers, is the closure.

use nalgebra::{Matrix2, Rotation2, Vector2};
use rayon::prelude::*;

use crate::frame::image::Image;
use crate::window::blocks::{Blocks, Place, mix};
use crate::window::carrier::Carrier;
use crate::window::leaks::clean;
use crate::window::lines::Levelled;
use crate::window::smooth::{Nodes, Smoothed, smooth};
use crate::window::types::Reference;

/// Overtones that may be used: as many as are looked for, ...
const ORDERS: i32 = 4;
/// ... and the limit of their components, rad per pixel: 83 % of π, as for lattices.
const FASTEST: f64 = 2.6;
/// Blocks per wavelength: three overtones do not fold onto each other.
pub(crate) const BLOCKS: f64 = 8.0;
/// Harmonics below this many noise units (amplitude) are left out of a node: as for lattices.
const FAINT: f64 = 3.0;
/// Nodes without a harmonic above this many are none. Chosen by eye; see docs/constants.md.
const WEAKEST: f64 = 4.0;
/// A change of amplitude of so many noise units is no noise. Chosen by eye; see docs/constants.md.
const ENDS: f64 = 4.0;
/// Relative error of slopes from single precision, times the inverse of the window.
const ROUNDING: f64 = 3e-6;

/// A pattern in an image, mixed down.
pub(crate) struct Wave {
    pub(crate) reference: Reference,
    centre: Vector2<f64>,
    /// Last pixel.
    pub(crate) frame: Vector2<f64>,
    /// Harmonics n that are used, as (n, 0).
    pub(crate) indices: Vec<[i32; 2]>,
    pub(crate) blocks: Blocks,
    pub(crate) carrier: Option<Carrier>,
    /// Noise at each harmonic: variance per pixel of white noise as strong.
    pub(crate) levels: Vec<f64>,
    /// Whether it was seen.
    pub(crate) noise_measured: bool,
    /// Mean |c₀|² of each harmonic where the pattern is.
    pub(crate) powers: Vec<f64>,
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
        let centre = Vector2::new(image.columns as f64 - 1.0, image.rows as f64 - 1.0) / 2.0;
        let place = Place {
            row: 0,
            rows: None,
            centre,
        };
        let indices: Vec<[i32; 2]> = (1..=ORDERS)
            .map(|n| [n, 0])
            .filter(|&index| reference.wave(index).amax() < FASTEST)
            .collect();
        let waves: Vec<_> = indices.iter().map(|&i| reference.wave(i)).collect();
        let mut out = Self {
            centre,
            frame: 2.0 * centre,
            blocks: mix(&Levelled::as_is(image), place, &waves, block),
            levels: vec![variance(image); indices.len()],
            noise_measured: false,
            powers: vec![0.0; indices.len()],
            indices,
            reference,
            carrier: None,
        };
        out.see_noise((image, place), others);
        out.choose_harmonics();
        out.follow();
        out.choose_harmonics();
        out
    }

    /// nm.
    pub(crate) fn wavelength(&self) -> f64 {
        0.75f64.sqrt() * self.reference.period()
    }

    /// Nodes about so far apart (nm), at most so many along each axis.
    pub(crate) fn sparse(&self, distance_nm: f64, most: usize) -> Nodes {
        let pixels = self.reference.in_pixels(distance_nm);
        let stride = [0, 1].map(|i| {
            let blocks = (pixels[i] / self.blocks.block[i] as f64).round() as usize;
            blocks.max(self.blocks.size[i] / most).max(1)
        });
        Nodes::filling(self.blocks.size, stride)
    }

    /// Envelopes under a window of `width` nm, without what leaks through windows that are cut.
    pub(crate) fn smoothed(&self, width: f64, nodes: Nodes) -> Smoothed {
        let window = self.reference.in_pixels(width);
        let mut smoothed = smooth(&self.blocks, window, nodes);
        let taken = |at: Vector2<f64>| {
            let phases = self.reference.pair.tr_mul(&(at - self.centre));
            let carrier = self.carrier.as_ref().map(|c| c.at(at).0);
            let slopes = self.taken_off(at, width);
            (phases + carrier.unwrap_or_default(), slopes)
        };
        clean(&mut smoothed, (&self.blocks, window), &self.indices, taken);
        smoothed
    }

    /// What was taken off, as a window of `width` nm sees it.
    fn taken_off(&self, at: Vector2<f64>, width: f64) -> Matrix2<f64> {
        let pixels = self.reference.in_pixels(width);
        let slopes = self.carrier.as_ref().map(|c| c.mean_slopes(at, pixels));
        self.reference.pair + slopes.unwrap_or_else(Matrix2::zeros)
    }

    /// Phase of the pattern at a node, rad.
    pub(crate) fn phase(&self, smoothed: &Smoothed, node: usize) -> f64 {
        let at = smoothed.nodes.place(&self.blocks, node);
        let carried = self.carrier.as_ref().map_or(0.0, |c| c.at(at).0.x);
        f64::from(smoothed.envelopes[0].amplitude[node].arg()) + carried
    }

    /// The wave at every node; `None` where no harmonic stands out. `others`: other patterns under the same window.
    pub(crate) fn locals(
        &self,
        smoothed: &Smoothed,
        width: f64,
        others: &[(&Self, &Smoothed)],
    ) -> Vec<Option<Local>> {
        let leaks = self.leaks(width);
        let of_node = |node: usize| {
            let mut leaks = leaks.clone();
            self.beyond(smoothed, node, (others, width), &mut leaks);
            let mut local = self.regression(smoothed, node, &leaks)?;
            let at = smoothed.nodes.place(&self.blocks, node);
            local.wave += self.taken_off(at, width).column(0);
            Some(local)
        };
        (0..smoothed.nodes.len())
            .into_par_iter()
            .map(of_node)
            .collect()
    }

    /// How far other harmonics that reach through the window can pull each slope, rad per pixel.
    fn leaks(&self, width: f64) -> Vec<f64> {
        let pixels = Vector2::from(self.reference.in_pixels(width));
        let amplitude = |i: usize| self.powers[i].max(0.0).sqrt();
        let of = |i: usize| {
            let n = self.indices[i][0];
            let all = (0..self.indices.len()).flat_map(|j| [(j, 1), (j, -1)]);
            all.filter(|&(j, sign)| (j, sign) != (i, 1))
                .map(|(j, sign)| {
                    let apart = self.reference.wave([n - sign * self.indices[j][0], 0]);
                    let share = (-0.5 * apart.component_mul(&pixels).norm_squared()).exp();
                    share * apart.norm() * amplitude(j) / amplitude(i).max(f64::MIN_POSITIVE)
                })
                .sum::<f64>()
                + ROUNDING / pixels.min()
        };
        (0..self.indices.len()).map(of).collect()
    }

    /// Adds what harmonics that end nearby, those of other patterns and its own, leave in each slope. Of a wave that ends
    /// at a line across the window a Gaussian lets through `|∇c|` times what is left of the beat along that line, with a
    /// phase that is not known. Changes of amplitude that noise makes are none.
    fn beyond(
        &self,
        smoothed: &Smoothed,
        node: usize,
        (others, width): (&[(&Self, &Smoothed)], f64),
        leaks: &mut [f64],
    ) {
        let pixels = Vector2::from(self.reference.in_pixels(width));
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
                let foreign = other.reference.wave(other.indices[from]);
                for (into, leak) in leaks.iter_mut().enumerate() {
                    let own = f64::from(smoothed.envelopes[into].amplitude[node].norm());
                    let mine = self.reference.wave(self.indices[into]);
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
        let (mut total, mut signal_to_noise, mut strongest) = (0.0, 0.0, 0.0f64);
        let mut terms = Vec::with_capacity(self.indices.len());
        for (i, envelope) in smoothed.envelopes.iter().enumerate() {
            let power = f64::from(envelope.amplitude[node].norm_sqr());
            let unit = self.levels[i] * support.amplitude_noise;
            if power <= FAINT * FAINT * unit || power <= 0.0 {
                continue;
            }
            // Noise adds to the power.
            let signal = power - unit;
            strongest = strongest.max(power / unit.max(f64::MIN_POSITIVE));
            total += signal;
            signal_to_noise += signal / unit.max(f64::MIN_POSITIVE);
            let unsure = envelope.unsure.get(node).copied().map_or(0.0, f64::from);
            let leak = leaks[i].powi(2) + unsure * unsure;
            let weight = 1.0 / (self.levels[i] / (2.0 * signal) + leak / spread);
            let n = f64::from(self.indices[i][0]);
            let slope = Vector2::from(envelope.slope[node].map(f64::from));
            normal += weight * n * n;
            right += weight * n * slope;
            terms.push((weight, n, slope));
        }
        if strongest <= WEAKEST * WEAKEST {
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

/// Mean square of the pixels; the background is gone.
fn variance(image: &Image) -> f64 {
    let (sum, count) = image
        .values
        .iter()
        .filter(|v| v.is_finite())
        .fold((0.0, 0.0f64), |(s, n), v| (s + v * v, n + 1.0));
    sum / count.max(1.0)
}
