//! An image → its local lattices on nodes, in pixels.
//!
//! Order of things: blocks of all likely harmonics; a pilot with a narrow window; a carrier that follows
//! what the pilot saw; which harmonics tell something; how wide the window may be; the noise; then the
//! wave vectors with that window, and masks.

use nalgebra::{Matrix2, Vector2};

use super::blocks::{Blocks, Place, mix};
use super::carrier::{Carrier, MOST_CELLS, Slope, Turns};
use super::defects::{Blur, Mask, Setting, masks};
use super::median;
use super::noise::{Noise, PROBE_WINDOW, probes};
use super::smooth::{Nodes, Smoothed, smooth};
use super::waves::{Harmonics, LocalLattice, Nothing, local_lattices};
use super::window::{self, NARROWEST};
use crate::image::Image;

/// The likely harmonics, half of the first four shells of a pair at 60°.
const LIKELY: [[i32; 2]; 15] = [
    [1, 0],
    [0, 1],
    [-1, 1],
    [1, 1],
    [-1, 2],
    [-2, 1],
    [2, 0],
    [0, 2],
    [-2, 2],
    [2, 1],
    [1, 2],
    [-1, 3],
    [-2, 3],
    [-3, 2],
    [-3, 1],
];
/// Wave vectors beyond this (rad per pixel, each component) are too near the limit of sampling.
const FASTEST: f64 = 2.6;
/// Blocks per period.
const BLOCKS: f64 = 5.0;
/// The pilot's window in periods.
const PILOT: f64 = 0.65;
/// A harmonic that adds less than this share to what is known is not worth its time.
const WORTH: f64 = 0.02;
/// The carrier is near enough when what is left turns by less over a pilot window (rad, root mean square).
const NEAR_ENOUGH: f64 = 0.15;
/// Times the carrier is brought up to date.
const ROUNDS: usize = 3;
/// Cells of the first carrier along each axis; each round has twice as many.
const FIRST_CELLS: usize = 4;
/// Nodes along each axis to which the carrier is fitted, and by which windows and harmonics are chosen.
const FOLLOWED: usize = 100;
const LOOKED_AT: usize = 40;
/// Nodes per width of the window.
const NODES: f64 = 3.0;

/// How maps are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Width of the Gaussian window (standard deviation), nm; `None`: as wide as the lattice is straight.
    pub window_nm: Option<f64>,
    /// Distance of the nodes, nm; `None`: a third of the window.
    pub step_nm: Option<f64>,
    /// Margin at the edges of the frame, in window widths.
    pub margin: f64,
}

impl Default for Resolution {
    fn default() -> Self {
        Self {
            window_nm: None,
            step_nm: None,
            margin: 2.0,
        }
    }
}

/// The lattice of an image as a start, and the size of its pixels.
#[derive(Clone, Copy, Debug)]
pub struct Reference {
    /// q₁, q₂ as columns, 60° apart, rad per pixel.
    pub pair: Matrix2<f64>,
    /// Pixels from column to column and from row to row, nm.
    pub pitch: [f64; 2],
}

impl Reference {
    /// Distance of neighbouring spots, `4π/(√3|q|)` of the mean |q|, nm.
    pub fn period(&self) -> f64 {
        let metric = Matrix2::new(1.0 / self.pitch[0], 0.0, 0.0, 1.0 / self.pitch[1]);
        let pair = metric * self.pair;
        let third = pair.column(1) - pair.column(0);
        let mean = (pair.column(0).norm() + pair.column(1).norm() + third.norm()) / 3.0;
        2.0 * std::f64::consts::TAU / (3.0f64.sqrt() * mean)
    }

    fn in_pixels(&self, nm: f64) -> [f64; 2] {
        self.pitch.map(|p| nm / p)
    }

    fn wave(&self, [h, k]: [i32; 2]) -> Vector2<f64> {
        self.pair * Vector2::new(f64::from(h), f64::from(k))
    }
}

/// The local lattice at a node, or why there is none.
#[derive(Clone, Copy, Debug)]
pub struct WaveNode {
    /// Whether it is to be believed.
    pub mask: Mask,
    /// q₁, q₂ as columns, rad per pixel; NaN where there is none.
    pub pair: Matrix2<f64>,
    /// Covariance of `(h, k)` combinations: that of (q₁, q₂) is `indices ⊗ slope`.
    pub indices: Matrix2<f64>,
    /// Covariance of the two components, see `indices`.
    pub slope: Matrix2<f64>,
    /// χ² of the closure of all harmonics.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub freedom: usize,
    /// Signal power over noise power under the window, all harmonics.
    pub signal_to_noise: f64,
    /// Phases of the first three harmonics against the reference lattice, rad, modulo 2π.
    pub phases: [f64; 3],
}

/// A harmonic that the map used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsedHarmonic {
    /// (h, k).
    pub index: [i32; 2],
    /// Root mean square amplitude over the frame, units of the image.
    pub amplitude: f64,
    /// Noise level at it: variance per pixel of white noise of the same power.
    pub noise: f64,
}

/// The local lattices of an image.
#[derive(Clone, Debug)]
pub struct WaveMap {
    /// Columns and rows of nodes.
    pub size: [usize; 2],
    /// Place of node (0, 0) and the way to the next ones, pixels.
    pub first: Vector2<f64>,
    /// Pixels from node to node along columns and rows.
    pub step: [f64; 2],
    /// Width of the window, nm.
    pub window_nm: f64,
    /// What the phases count against.
    pub reference: Reference,
    /// Row by row.
    pub nodes: Vec<WaveNode>,
    /// The harmonics that were used, first shell first.
    pub harmonics: Vec<UsedHarmonic>,
}

/// Demodulates an image whose background is gone. `place` says which part of a larger image it is.
///
/// `None` where the frame is smaller than a few windows, or shows nothing.
pub(super) fn demodulate(
    image: &Image,
    place: Place,
    reference: &Reference,
    resolution: &Resolution,
) -> Option<WaveMap> {
    let mut work = Work::new(image, place, *reference, resolution)?;
    work.follow()?;
    work.choose_harmonics();
    let window = match resolution.window_nm {
        Some(window) => window.max(NARROWEST * work.period),
        None => work.choose_window(),
    };
    work.map(image, window, resolution)
}

/// A map under way.
struct Work {
    reference: Reference,
    place: Place,
    /// nm.
    period: f64,
    /// First and last pixel.
    frame: [Vector2<f64>; 2],
    indices: Vec<[i32; 2]>,
    blocks: Blocks,
    noise: Noise,
    carrier: Option<Carrier>,
    turns: Option<Turns>,
    /// Mean |c₀|² of each harmonic in the pilot, noise taken off.
    powers: Vec<f64>,
}

impl Work {
    fn new(
        image: &Image,
        place: Place,
        reference: Reference,
        resolution: &Resolution,
    ) -> Option<Self> {
        let period = reference.period();
        let narrowest = resolution.window_nm.unwrap_or(f64::INFINITY);
        let block = reference.in_pixels((period / BLOCKS).min(narrowest / 4.0));
        let block = block.map(|b| (b as usize).max(1));
        if image.columns < 4 * block[0] || image.rows < 4 * block[1] {
            return None;
        }
        let slow_enough = |g: Vector2<f64>| g.x.abs() < FASTEST && g.y.abs() < FASTEST;
        let indices: Vec<[i32; 2]> = LIKELY
            .into_iter()
            .enumerate()
            .filter(|&(i, index)| i < 3 || slow_enough(reference.wave(index)))
            .map(|(_, index)| index)
            .collect();
        let mut waves: Vec<Vector2<f64>> = indices.iter().map(|&i| reference.wave(i)).collect();
        let likely = waves.len();
        for index in &indices[..3] {
            waves.extend(probes(&reference.pair, *index, reference.pitch));
        }
        let mut blocks = mix(image, place, &waves, block);
        let beside = Blocks {
            layers: blocks.layers.split_off(likely),
            share: blocks.share.clone(),
            ..blocks
        };
        let noise = noise_of(&beside, &reference, period, image);
        let first = Vector2::new(0.0, place.row as f64);
        let last = Vector2::new(image.columns as f64 - 1.0, image.rows as f64 - 1.0);
        Some(Self {
            reference,
            place,
            period,
            frame: [first, first + last],
            powers: vec![0.0; indices.len()],
            indices,
            blocks,
            noise,
            carrier: None,
            turns: None,
        })
    }

    /// Smooths the first `harmonics` layers with a window of `width` nm, nodes `per_width` to a width.
    fn smoothed(&self, width: f64, stride: [usize; 2]) -> Smoothed {
        let nodes = Nodes::filling(self.blocks.size, stride);
        let turns = self.turns.as_ref().map(|t| (t, self.indices.as_slice()));
        smooth(&self.blocks, self.reference.in_pixels(width), nodes, turns)
    }

    /// The stride of nodes `distance_nm` apart, or so far that few enough fit into the frame.
    fn sparse(&self, distance_nm: f64, most: usize) -> [usize; 2] {
        let stride = self.stride(distance_nm);
        [0, 1].map(|i| stride[i].max(self.blocks.size[i] / most))
    }

    fn stride(&self, distance_nm: f64) -> [usize; 2] {
        let pixels = self.reference.in_pixels(distance_nm);
        [0, 1].map(|i| ((pixels[i] / self.blocks.block[i] as f64).round() as usize).max(1))
    }

    /// What was taken off, as a window of `width` nm sees it.
    fn taken_off(&self, at: Vector2<f64>, width: f64) -> Matrix2<f64> {
        let pixels = self.reference.in_pixels(width);
        let slopes = self.carrier.as_ref().map(|c| c.mean_slopes(at, pixels));
        self.reference.pair + slopes.unwrap_or_else(Matrix2::zeros)
    }

    /// The local lattices of the harmonics in the blocks.
    fn lattices(
        &self,
        smoothed: &Smoothed,
        width: f64,
        absolute: bool,
    ) -> Vec<Result<LocalLattice, Nothing>> {
        let amplitudes: Vec<f64> = self.powers.iter().map(|p| p.max(0.0).sqrt()).collect();
        let harmonics = Harmonics::new(
            (&self.indices, &self.noise),
            &self.reference.pair,
            &amplitudes,
            self.reference.in_pixels(width),
        );
        local_lattices(&self.blocks, smoothed, &harmonics, |at| {
            if absolute {
                self.taken_off(at, width)
            } else {
                Matrix2::zeros()
            }
        })
    }

    /// Fits the carrier to what a narrow window sees, until little is left.
    fn follow(&mut self) -> Option<()> {
        let width = PILOT * self.period;
        // Only the first three for this: the others have no noise level yet.
        let all = std::mem::take(&mut self.blocks.layers);
        let indices = std::mem::take(&mut self.indices);
        let powers = std::mem::take(&mut self.powers);
        let mut all = all.into_iter();
        self.blocks.layers = all.by_ref().take(3).collect();
        self.indices = indices[..3].to_vec();
        self.powers = vec![0.0; 3];
        let mut found = None;
        for round in 0..ROUNDS {
            let smoothed = self.smoothed(width, self.sparse(width, FOLLOWED));
            let lattices = self.lattices(&smoothed, width, false);
            let mut slopes = Vec::new();
            // Turn over a window and what noise makes of it, squared.
            let (mut left, mut noise) = (0.0, 0.0);
            for (node, lattice) in lattices.iter().enumerate() {
                let whole = smoothed.support[node].is_some_and(|s| s.share > 0.9);
                let Some(lattice) = lattice.as_ref().ok().filter(|_| whole) else {
                    continue;
                };
                let at = smoothed.nodes.place(&self.blocks, node);
                for axis in 0..2 {
                    let scale = self.reference.in_pixels(width)[axis].powi(2);
                    left += scale * lattice.pair.row(axis).norm_squared();
                    noise += scale * lattice.slope[(axis, axis)] * lattice.indices.trace();
                }
                let before = self.taken_off(at, width) - self.reference.pair;
                slopes.push(Slope {
                    at,
                    slopes: lattice.pair + before,
                });
            }
            if slopes.len() < 4 {
                break;
            }
            found = Some(());
            let near = NEAR_ENOUGH.powi(2) * 2.0 * slopes.len() as f64;
            if left - noise < near {
                break;
            }
            let frame = (self.frame[0], self.frame[1]);
            let Some(carrier) = Carrier::fit(&slopes, frame, self.cells(round)) else {
                break;
            };
            self.turns = Some(carrier.turns(&self.blocks));
            self.carrier = Some(carrier);
        }
        self.blocks.layers.extend(all);
        self.indices = indices;
        self.powers = powers;
        found
    }

    /// Cells of the carrier: never shorter than twice the widest window, lest it bends under it.
    fn cells(&self, round: usize) -> [usize; 2] {
        let cell = self.reference.in_pixels(2.0 * window::WIDEST * self.period);
        [0, 1].map(|i| {
            let cells = (self.frame[1] - self.frame[0])[i] / cell[i];
            (cells as usize)
                .clamp(1, MOST_CELLS)
                .min(FIRST_CELLS << round)
        })
    }

    /// Keeps the harmonics that tell something of the lattice.
    fn choose_harmonics(&mut self) {
        let width = PILOT * self.period;
        let smoothed = self.smoothed(width, self.sparse(width, LOOKED_AT));
        let level = self.noise.levels.iter().sum::<f64>() / self.noise.levels.len() as f64;
        let mut told = Vec::new();
        for (envelope, [h, k]) in smoothed.envelopes.iter().zip(&self.indices) {
            let (mut sum, mut units, mut count) = (0.0, 0.0, 0.0);
            for (amplitude, support) in envelope.amplitude.iter().zip(&smoothed.support) {
                if let Some(support) = support.filter(|s| s.share > 0.9) {
                    sum += f64::from(amplitude.norm_sqr());
                    units += level * support.amplitude_noise;
                    count += 1.0f64;
                }
            }
            let power = (sum - units) / count.max(1.0);
            // Chance of the mean: nodes a window apart are nearly independent.
            let chance = 4.0 * units / count.max(1.0) / count.max(1.0).sqrt();
            let order = f64::from(h * h + h * k + k * k);
            told.push((power, if power > chance { power * order } else { 0.0 }));
        }
        let most = told.iter().map(|t| t.1).fold(0.0, f64::max);
        let keep: Vec<bool> = told
            .iter()
            .enumerate()
            .map(|(i, t)| i < 3 || t.1 > WORTH * most)
            .collect();
        let mut kept = keep.iter();
        self.blocks
            .layers
            .retain(|_| *kept.next().unwrap_or(&false));
        let mut kept = keep.iter();
        self.indices.retain(|_| *kept.next().unwrap_or(&false));
        let powers = told.iter().zip(&keep).filter(|(_, keep)| **keep);
        self.powers = powers.map(|(t, _)| t.0.max(0.0)).collect();
        while self.noise.levels.len() < self.indices.len() {
            self.noise.levels.push(level);
        }
    }

    /// The widest window under which the lattice is straight, nm.
    fn choose_window(&self) -> f64 {
        let extent = self.frame[1] - self.frame[0];
        let sides = [0, 1].map(|i| extent[i] * self.reference.pitch[i] / self.period);
        let steps = window::ladder(sides[0].min(sides[1]));
        let mut chosen = steps[0];
        let of = |width: f64, stride| {
            let width = width * self.period;
            self.lattices(&self.smoothed(width, stride), width, true)
        };
        for &width in &steps {
            // Sparse nodes are enough, and all are independent.
            let stride = self.sparse(1.5 * width * self.period, LOOKED_AT);
            let wider = width * std::f64::consts::SQRT_2;
            let (narrow, wide) = (of(width, stride), of(wider, stride));
            let nodes = Nodes::filling(self.blocks.size, stride);
            let away = self.reference.in_pixels(3.0 * wider * self.period);
            let mut changes = Vec::new();
            for (node, (a, b)) in narrow.iter().zip(&wide).enumerate() {
                let at = nodes.place(&self.blocks, node);
                let inside = (0..2).all(|i| {
                    at[i] - self.frame[0][i] > away[i] && self.frame[1][i] - at[i] > away[i]
                });
                if let (true, Ok(a), Ok(b)) = (inside, a, b) {
                    let change = b.pair - a.pair;
                    for (component, wave) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                        let variance = a.slope[(component, component)] * a.indices[(wave, wave)];
                        changes.push(change[(component, wave)].powi(2) / variance);
                    }
                }
            }
            if changes.len() < 16 || !window::is_straight(&mut changes) {
                break;
            }
            chosen = width;
        }
        chosen * self.period
    }

    /// The map with its final window.
    fn map(mut self, image: &Image, window_nm: f64, resolution: &Resolution) -> Option<WaveMap> {
        if self.indices.len() > 3 {
            let waves: Vec<Vector2<f64>> = self
                .indices
                .iter()
                .flat_map(|index| probes(&self.reference.pair, *index, self.reference.pitch))
                .collect();
            let beside = mix(image, self.place, &waves, self.blocks.block);
            self.noise = noise_of(&beside, &self.reference, self.period, image);
        }
        let step = resolution.step_nm.unwrap_or(window_nm / NODES);
        let smoothed = self.smoothed(window_nm, self.stride(step));
        let mut lattices = self.lattices(&smoothed, window_nm, true);
        let blurs = self.blurs(
            &lattices,
            window_nm * std::f64::consts::SQRT_2,
            smoothed.nodes,
        );
        for (lattice, blur) in lattices.iter_mut().zip(&blurs) {
            if let Ok(lattice) = lattice {
                lattice.slope *= blur.factor();
            }
        }
        let nodes = smoothed.nodes;
        let places: Vec<Vector2<f64>> = (0..nodes.len())
            .map(|n| nodes.place(&self.blocks, n))
            .collect();
        let width = self.reference.in_pixels(window_nm);
        let shares = self.noise_shares(&smoothed);
        let masks = masks(
            &Setting {
                smoothed: &smoothed,
                places: &places,
                width,
                margin: width.map(|w| w * resolution.margin),
                frame: self.frame,
                noise_share: &shares,
                blurs: &blurs,
            },
            &lattices,
        );
        let unknown = Matrix2::repeat(f64::NAN);
        let nodes_out = lattices
            .iter()
            .zip(&masks)
            .enumerate()
            .map(|(n, (lattice, &mask))| {
                let carried = self
                    .carrier
                    .as_ref()
                    .map(|c| c.at(places[n]).0)
                    .unwrap_or_default();
                let phases = [0, 1, 2].map(|i| {
                    let [h, k] = self.indices[i].map(f64::from);
                    let amplitude = smoothed.envelopes[i].amplitude[n];
                    f64::from(amplitude.arg()) + h * carried.x + k * carried.y
                });
                match lattice {
                    Ok(l) => WaveNode {
                        mask,
                        pair: l.pair,
                        indices: l.indices,
                        slope: l.slope,
                        chi2: l.chi2,
                        freedom: l.freedom,
                        signal_to_noise: l.signal_to_noise,
                        phases,
                    },
                    Err(_) => WaveNode {
                        mask,
                        pair: unknown,
                        indices: unknown,
                        slope: unknown,
                        chi2: f64::NAN,
                        freedom: 0,
                        signal_to_noise: 0.0,
                        phases,
                    },
                }
            });
        let harmonics = self
            .indices
            .iter()
            .zip(&self.powers)
            .zip(&self.noise.levels);
        Some(WaveMap {
            size: nodes.size,
            first: nodes.place(&self.blocks, 0),
            step: [0, 1].map(|i| (nodes.stride[i] * self.blocks.block[i]) as f64),
            window_nm,
            reference: self.reference,
            nodes: nodes_out.collect(),
            harmonics: harmonics
                .map(|((&index, power), &noise)| UsedHarmonic {
                    index,
                    amplitude: 2.0 * power.sqrt(),
                    noise,
                })
                .collect(),
        })
    }

    /// What a window of `wider` nm changes at each node.
    fn blurs(
        &self,
        lattices: &[Result<LocalLattice, Nothing>],
        wider: f64,
        nodes: Nodes,
    ) -> Vec<Blur> {
        let wide = self.lattices(&self.smoothed(wider, nodes.stride), wider, true);
        let pairs = lattices.iter().zip(&wide);
        pairs
            .map(|pair| match pair {
                (Ok(narrow), Ok(wide)) => Blur::between(narrow, wide),
                _ => Blur::default(),
            })
            .collect()
    }

    /// Noise amplitude over the median amplitude of each wave.
    fn noise_shares(&self, smoothed: &Smoothed) -> Vec<f64> {
        let shares = smoothed
            .envelopes
            .iter()
            .zip(&self.noise.levels)
            .map(|(envelope, level)| {
                let nodes = envelope.amplitude.iter().zip(&smoothed.support);
                let of_node = nodes.filter_map(|(amplitude, support)| {
                    let unit = (level * support.as_ref()?.amplitude_noise).sqrt();
                    Some(unit / f64::from(amplitude.norm()))
                });
                median(&mut of_node.collect::<Vec<f64>>())
            });
        shares.collect()
    }
}

/// Noise from blocks mixed with two probes for each harmonic; where the frame is too small for probes, the
/// image's own variance, which is too much and not too little.
fn noise_of(beside: &Blocks, reference: &Reference, period: f64, image: &Image) -> Noise {
    let finite = image.values.iter().filter(|v| v.is_finite());
    let (sum, count) = finite.fold((0.0, 0.0f64), |(s, n), v| (s + v * v, n + 1.0));
    let fallback = vec![sum / count.max(1.0); beside.layers.len() / 2];
    let width = reference.in_pixels(PROBE_WINDOW * period);
    Noise::new(beside, width, &fallback)
}
