//! A first look with a narrow window: the carrier, the harmonics that tell something, and how wide the
//! window may be.

use super::carrier::{Carrier, MOST_CELLS, Slope};
use super::demodulate::{PILOT, Work, stride_of};
use super::window;

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

impl Work {
    /// Fits the carrier to what a narrow window sees, until little is left.
    pub(super) fn follow(&mut self) {
        let width = PILOT * self.period;
        // Only the first three for this: the others have no noise level yet.
        let all = std::mem::take(&mut self.blocks.layers);
        let indices = std::mem::take(&mut self.indices);
        let powers = std::mem::take(&mut self.powers);
        let mut all = all.into_iter();
        self.blocks.layers = all.by_ref().take(3).collect();
        self.indices = indices[..3].to_vec();
        self.powers = vec![0.0; 3];
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
    }

    /// The stride of nodes `distance_nm` apart, or so far that few enough fit into the frame.
    fn sparse(&self, distance_nm: f64, most: usize) -> [usize; 2] {
        let stride = stride_of(&self.reference, distance_nm);
        [0, 1].map(|i| stride[i].max(self.blocks.size[i] / most))
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
    pub(super) fn choose_harmonics(&mut self) {
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
    pub(super) fn choose_window(&self) -> f64 {
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
            let nodes = self.nodes(stride);
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
}
