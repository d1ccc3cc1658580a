//! One pattern of stripes under a Gaussian window: the same as for lattices, with one wave and its overtones.
//!
//! Every harmonic n says `n q`; weighted least squares over all of them. One cosine of amplitude A in noise of σ
//! per pixel at ρ pixels per nm²: `σ_q = (σ/A)/(2√(πρ) w²)` for each component; with overtones A² becomes `Σ n² A_n²`.
//! What the harmonics leave, 2(N − 1) numbers, is the closure.

use nalgebra::{Matrix2, Rotation2, Vector2};
use rayon::prelude::*;

use super::super::blocks::{Blocks, Place, mix};
use super::super::carrier::{Carrier, Slope};
use super::super::leaks::clean;
use super::super::median;
use super::super::smooth::{Nodes, Smoothed, smooth};
use super::super::types::Reference;
use super::super::window;
use crate::image::Image;

/// Overtones that may be used, and the limit of their components, rad per pixel.
const ORDERS: i32 = 4;
const FASTEST: f64 = 2.6;
/// Blocks per wavelength: three overtones do not fold onto each other.
pub(super) const BLOCKS: f64 = 8.0;
/// The pilot's window in wavelengths.
const PILOT: f64 = 0.75;
/// A harmonic that adds less than this share to what is known is left out.
const WORTH: f64 = 0.02;
/// Harmonics below this many noise units (amplitude) are left out of a node, and nodes without one above this many.
const FAINT: f64 = 3.0;
pub(super) const WEAKEST: f64 = 4.0;
/// The carrier is for frames of so many periods, its cells as long.
const CARRIED: f64 = 12.0;
const ROUNDS: usize = 3;
/// Nodes along each axis to which the carrier is fitted, and by which windows are chosen.
const FOLLOWED: usize = 100;
const LOOKED_AT: usize = 40;
/// Window of the probes for noise in wavelengths; nodes nearer to edges than so many of them are not looked at, and
/// so many have to be left.
const PROBE: f64 = 1.3;
const AWAY: f64 = 2.5;
const FEWEST: usize = 12;
/// Relative error of slopes from single precision, times the inverse of the window.
const ROUNDING: f64 = 3e-6;

/// A pattern in an image, mixed down.
pub(super) struct Wave {
    pub(super) reference: Reference,
    centre: Vector2<f64>,
    frame: Vector2<f64>,
    /// Harmonics n that are used, as (n, 0).
    pub(super) indices: Vec<[i32; 2]>,
    pub(super) blocks: Blocks,
    carrier: Option<Carrier>,
    /// Noise at each harmonic: variance per pixel of white noise as strong.
    pub(super) levels: Vec<f64>,
    /// Whether it was seen.
    pub(super) noise_measured: bool,
    /// Mean |c₀|² of each harmonic where the pattern is.
    pub(super) powers: Vec<f64>,
}

/// The wave at a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Local {
    /// rad per pixel.
    pub(super) wave: Vector2<f64>,
    /// Its variance in units of `slope`.
    pub(super) variance: f64,
    pub(super) slope: Matrix2<f64>,
    pub(super) chi2: f64,
    pub(super) freedom: usize,
    /// Power of all harmonics, and in units of noise.
    pub(super) power: f64,
    pub(super) signal_to_noise: f64,
}

/// The reference that stands for a wave: a second one of the same length at 60° to it, which nothing uses.
pub(super) fn reference(wave: Vector2<f64>, pitch: [f64; 2]) -> Reference {
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
    pub(super) fn new(
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
            blocks: mix(image, place, &waves, block),
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
    pub(super) fn wavelength(&self) -> f64 {
        0.75f64.sqrt() * self.reference.period()
    }

    /// Nodes about so far apart (nm), at most so many along each axis.
    fn sparse(&self, distance_nm: f64, most: usize) -> Nodes {
        let pixels = self.reference.in_pixels(distance_nm);
        let stride = [0, 1].map(|i| {
            let blocks = (pixels[i] / self.blocks.block[i] as f64).round() as usize;
            blocks.max(self.blocks.size[i] / most).max(1)
        });
        Nodes::filling(self.blocks.size, stride)
    }

    /// Envelopes under a window of `width` nm, without what leaks through windows that are cut.
    pub(super) fn smoothed(&self, width: f64, nodes: Nodes) -> Smoothed {
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
    pub(super) fn phase(&self, smoothed: &Smoothed, node: usize) -> f64 {
        let at = smoothed.nodes.place(&self.blocks, node);
        let carried = self.carrier.as_ref().map_or(0.0, |c| c.at(at).0.x);
        f64::from(smoothed.envelopes[0].amplitude[node].arg()) + carried
    }

    /// The wave at every node; `None` where no harmonic stands out. `others`: other patterns under the same window.
    pub(super) fn locals(
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

    /// Adds what other patterns that end nearby leave in each slope. Of a wave that ends at a line across the window a
    /// Gaussian lets through `|∇c|` times what is left of the beat along that line, with a phase that is not known.
    fn beyond(
        &self,
        smoothed: &Smoothed,
        node: usize,
        (others, width): (&[(&Self, &Smoothed)], f64),
        leaks: &mut [f64],
    ) {
        let pixels = Vector2::from(self.reference.in_pixels(width));
        for (other, envelopes) in others {
            for (envelope, index) in envelopes.envelopes.iter().zip(&other.indices) {
                let amplitude = f64::from(envelope.amplitude[node].norm());
                let growth = Vector2::from(envelope.growth[node].map(f64::from));
                let growth = growth.component_mul(&pixels);
                let ends = amplitude * growth.norm();
                if !(ends > 0.0) {
                    continue;
                }
                let foreign = other.reference.wave(*index);
                for (leak, (own, mine)) in
                    leaks.iter_mut().zip(smoothed.envelopes.iter().zip(&self.indices))
                {
                    let own = f64::from(own.amplitude[node].norm()).max(f64::MIN_POSITIVE);
                    for sign in [1.0, -1.0] {
                        let beat = self.reference.wave(*mine) - foreign * sign;
                        let along = growth.perp(&beat.component_mul(&pixels)) / growth.norm();
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

    /// Reads the noise beside the harmonics, above and below along ky (noise in time is a function of kx).
    fn see_noise(&mut self, (image, place): (&Image, Place), others: &[Vector2<f64>]) {
        let waves: Vec<Vector2<f64>> = self
            .indices
            .iter()
            .flat_map(|&index| self.beside(index, others))
            .collect();
        let width = self.reference.in_pixels(PROBE * self.wavelength());
        let nodes = self.sparse(0.5 * PROBE * self.wavelength(), FOLLOWED);
        let (low, high) = (Vector2::zeros(), self.frame);
        let mut levels = Vec::with_capacity(self.indices.len());
        for pair in waves.chunks(2) {
            let blocks = mix(image, place, pair, self.blocks.block);
            let smoothed = smooth(&blocks, width, nodes);
            let whole = |n: &usize| {
                let at = nodes.place(&blocks, *n);
                let inside = (0..2).all(|i| (at - low)[i].min((high - at)[i]) > AWAY * width[i]);
                inside && smoothed.support[*n].is_some_and(|s| s.share > 0.85)
            };
            let whole: Vec<usize> = (0..nodes.len()).filter(whole).collect();
            if whole.len() < FEWEST {
                return;
            }
            let mut powers: Vec<f64> = smoothed
                .envelopes
                .iter()
                .flat_map(|e| whole.iter().map(|&n| (e.amplitude[n], n)))
                .filter_map(|(a, n)| {
                    let unit = smoothed.support[n]?.amplitude_noise;
                    Some(f64::from(a.norm_sqr()) / unit)
                })
                .collect();
            levels.push(median(&mut powers) / std::f64::consts::LN_2);
        }
        self.levels = levels;
        self.noise_measured = true;
    }

    /// Two wave vectors beside a harmonic, as far from all harmonics of all patterns as can be.
    fn beside(&self, index: [i32; 2], others: &[Vector2<f64>]) -> [Vector2<f64>; 2] {
        let harmonic = self.reference.wave(index);
        let q = self.reference.wave([1, 0]);
        let metric = |v: Vector2<f64>| {
            v.component_div(&Vector2::from(self.reference.pitch)).norm()
        };
        let distance = |g: Vector2<f64>| {
            let all = others.iter().chain([&q]);
            let all = all.flat_map(|q| (-5..=5).map(move |m| g - q * f64::from(m)));
            all.map(metric).fold(f64::INFINITY, f64::min)
        };
        let up = Vector2::new(0.0, metric(q) * self.reference.pitch[1]);
        let aside = Rotation2::new(std::f64::consts::FRAC_PI_2) * q.component_div(&Vector2::from(self.reference.pitch));
        let aside = aside.component_mul(&Vector2::from(self.reference.pitch));
        [1.0, -1.0].map(|side| {
            let tried = [0.5, 0.6, 0.7, 0.8, 0.9].map(|share| side * share);
            let along = tried.map(|share| harmonic + up * share);
            let best = |all: &[Vector2<f64>]| {
                all.iter()
                    .copied()
                    .max_by(|a, b| distance(*a).total_cmp(&distance(*b)))
            };
            match best(&along) {
                Some(g) if distance(g) > 0.45 * metric(q) => g,
                _ => best(&tried.map(|share| harmonic + aside * share)).unwrap_or(harmonic + up),
            }
        })
    }

    /// Keeps the harmonics that tell something where the pattern is.
    fn choose_harmonics(&mut self) {
        let width = PILOT * self.wavelength();
        let smoothed = self.smoothed(width, self.sparse(width, LOOKED_AT));
        let present = self.present(&smoothed);
        let power = |i: usize| {
            let (mut sum, mut units) = (0.0, 0.0);
            for &n in &present {
                sum += f64::from(smoothed.envelopes[i].amplitude[n].norm_sqr());
                units += smoothed.support[n].map_or(0.0, |s| self.levels[i] * s.amplitude_noise);
            }
            let count = (present.len() as f64).max(1.0);
            let chance = 4.0 * units / count / count.sqrt();
            let power = (sum - units) / count;
            if power > chance { power } else { 0.0 }
        };
        let powers: Vec<f64> = (0..self.indices.len()).map(power).collect();
        let worth = |i: usize| powers[i] * f64::from(self.indices[i][0].pow(2));
        let most = (0..powers.len()).map(worth).fold(0.0, f64::max);
        let keep: Vec<bool> = (0..powers.len())
            .map(|i| i == 0 || worth(i) > WORTH * most)
            .collect();
        self.powers = powers;
        let mut kept = keep.iter();
        self.powers.retain(|_| kept.next().is_some_and(|k| *k));
        let mut kept = keep.iter();
        self.levels.retain(|_| kept.next().is_some_and(|k| *k));
        let mut kept = keep.iter();
        self.indices.retain(|_| kept.next().is_some_and(|k| *k));
        let mut kept = keep.iter();
        self.blocks.layers.retain(|_| kept.next().is_some_and(|k| *k));
    }

    /// Nodes where the pattern is: a quarter of its power at the best twentieth, all harmonics together.
    fn present(&self, smoothed: &Smoothed) -> Vec<usize> {
        let power = |n: usize| -> f64 {
            let all = smoothed.envelopes.iter();
            all.map(|e| f64::from(e.amplitude[n].norm_sqr())).sum()
        };
        let whole: Vec<usize> = (0..smoothed.nodes.len())
            .filter(|&n| smoothed.support[n].is_some_and(|s| s.share > 0.9))
            .collect();
        let mut powers: Vec<f64> = whole.iter().map(|&n| power(n)).collect();
        powers.sort_by(f64::total_cmp);
        let best = powers.get(powers.len() * 19 / 20).copied().unwrap_or(0.0);
        whole.into_iter().filter(|&n| power(n) > 0.25 * best).collect()
    }

    /// Fits the carrier to what a narrow window sees.
    fn follow(&mut self) {
        let wavelength = self.wavelength();
        let cells = [0, 1].map(|i| {
            let periods = self.frame[i] * self.reference.pitch[i] / wavelength;
            ((periods / CARRIED) as usize).min(super::super::carrier::MOST_CELLS)
        });
        if cells[0].min(cells[1]) == 0 {
            return;
        }
        let width = PILOT * wavelength;
        for _ in 0..ROUNDS {
            let smoothed = self.smoothed(width, self.sparse(width, FOLLOWED));
            let locals = self.locals(&smoothed, width, &[]);
            let present = self.present(&smoothed);
            let slopes: Vec<Slope> = present
                .iter()
                .filter_map(|&n| {
                    let change = locals[n].as_ref()?.wave - self.reference.wave([1, 0]);
                    Some(Slope {
                        at: smoothed.nodes.place(&self.blocks, n),
                        slopes: Matrix2::from_columns(&[change, Vector2::zeros()]),
                    })
                })
                .collect();
            // A pattern that is only here and there is not followed into what is none.
            if slopes.len() < 16 || slopes.len() * 2 < smoothed.nodes.len() {
                return;
            }
            let Some(carrier) = Carrier::fit(&slopes, (Vector2::zeros(), self.frame), cells) else {
                return;
            };
            let mut layers = std::mem::take(&mut self.blocks.layers);
            let all = (layers.as_mut_slice(), self.indices.as_slice());
            carrier.take_off(self.carrier.as_ref(), all, &self.blocks);
            self.blocks.layers = layers;
            self.carrier = Some(carrier);
        }
    }

    /// The widest window (nm) under which the stripes are straight, where the pattern is.
    pub(super) fn choose_window(&self) -> f64 {
        let period = self.reference.period();
        let sides = [0, 1].map(|i| self.frame[i] * self.reference.pitch[i] / period);
        let steps = window::ladder(sides[0].min(sides[1]));
        let mut chosen = steps[0];
        for &width in &steps {
            let width_nm = width * period;
            let wider = width_nm * std::f64::consts::SQRT_2;
            let nodes = self.sparse(1.5 * width_nm, LOOKED_AT);
            let narrow = self.smoothed(width_nm, nodes);
            let present = self.present(&narrow);
            let (a, b) = (
                self.locals(&narrow, width_nm, &[]),
                self.locals(&self.smoothed(wider, nodes), wider, &[]),
            );
            let away = self.reference.in_pixels(3.0 * wider);
            let mut changes = Vec::new();
            for n in present {
                let at = nodes.place(&self.blocks, n);
                let inside = (0..2).all(|i| at[i].min(self.frame[i] - at[i]) > away[i]);
                if let (true, Some(a), Some(b)) = (inside, &a[n], &b[n]) {
                    let change = b.wave - a.wave;
                    for i in 0..2 {
                        changes.push(change[i].powi(2) / (a.slope[(i, i)] * a.variance));
                    }
                }
            }
            if changes.len() < 16 || !window::is_straight(&mut changes) {
                break;
            }
            chosen = width;
        }
        chosen * period
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
