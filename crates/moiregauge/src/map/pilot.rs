//! A first look with a narrow window: the carrier, the harmonics that tell something, and how wide the
//! window may be.

use crate::map::demodulate::Work;
use crate::map::waves::level_of_ridge;
use crate::window::blocks::{Layer, stride_of};
use crate::window::carrier::{Carrier, MOST_CELLS, PILOT, Slope};
use crate::window::smooth::{Envelope, Smoothed, radius, smooth};
use crate::window::widths as window;
use crate::window::widths::of_difference;

/// A harmonic that adds less than this share to what is known is not worth its time: one per cent of the errors.
const WORTH: f64 = 0.02;
/// The carrier is near enough when what is left turns by less over a pilot window (rad, root mean square): that is
/// one per cent of the amplitude.
const NEAR_ENOUGH: f64 = 0.15;
/// Times the carrier is brought up to date: twice as many cells each time, 4, 8, 16.
const ROUNDS: usize = 3;
/// Cells of the first carrier along each axis; each round has twice as many. Few, since the pilot may be wrong in
/// places.
const FIRST_CELLS: usize = 4;
/// Nodes along each axis to which the carrier is fitted: six to each of its cells at most, ...
const FOLLOWED: usize = 100;
/// ... and by which windows and harmonics are chosen: 1600 tell a median to some per cent.
const LOOKED_AT: usize = 40;
/// Rows of nodes by which harmonics are chosen; no other lines are mixed for that.
const ROWS_LOOKED_AT: usize = 12;

impl Work<'_> {
    /// Fits the carrier to what a narrow window sees, until little is left.
    pub(crate) fn follow(&mut self) {
        let width = PILOT * self.period;
        for round in 0..ROUNDS {
            let smoothed = self.smoothed(width, self.sparse(width, FOLLOWED));
            let lattices = self.lattices(&smoothed, width);
            let mut slopes = Vec::new();
            // Turn over a window and what noise makes of it, squared.
            let (mut left, mut noise) = (0.0, 0.0);
            for (node, lattice) in lattices.iter().enumerate() {
                let whole = smoothed.support[node].is_some_and(|s| s.share > 0.9);
                let Some(lattice) = lattice.as_ref().ok().filter(|_| whole) else {
                    continue;
                };
                let at = smoothed.nodes.place(&self.blocks, node);
                let change = lattice.pair - self.taken_off(at, width);
                for axis in 0..2 {
                    let scale = self.reference.in_pixels(width)[axis].powi(2);
                    left += scale * change.row(axis).norm_squared();
                    let of = |wave: usize| lattice.variance(axis, wave);
                    noise += scale * (of(0) + of(1));
                }
                slopes.push(Slope {
                    at,
                    slopes: lattice.pair - self.reference.pair,
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
            let mut layers = std::mem::take(&mut self.blocks.layers);
            let all = (layers.as_mut_slice(), self.indices.as_slice());
            carrier.take_off(self.carrier.as_ref(), all, &self.blocks);
            self.blocks.layers = layers;
            self.carrier = Some(carrier);
        }
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

    /// Adds the harmonics that tell something of the lattice to the first three.
    pub(crate) fn choose_harmonics(&mut self) {
        let width = PILOT * self.period;
        let [along, _] = self.sparse(width, LOOKED_AT);
        let [_, across] = self.sparse(width, ROWS_LOOKED_AT);
        let stride = [along, across];
        let level = self.noise.levels.iter().sum::<f64>() / self.noise.levels.len() as f64;
        let first = self.smoothed(width, stride);
        let in_pixels = self.reference.in_pixels(width);
        let told = |envelope: &Envelope, index: [i32; 2]| {
            let g = self.reference.wave(index);
            let ridge = level_of_ridge(self.image.ridge(g), g.x * in_pixels[0], in_pixels[0]);
            told(envelope, &first, [level, ridge], index)
        };
        let of_first = first.envelopes.iter().zip(&self.indices);
        let of_first: Vec<Told> = of_first.map(|(e, &index)| told(e, index)).collect();
        let mut most = of_first.iter().map(|t| t.worth).fold(0.0, f64::max);
        let reach = radius(in_pixels[1], self.blocks.block[1]);
        let mut found: Vec<([i32; 2], Told)> = Vec::new();
        let likely = self.likely();
        for (indices, blocks) in self.others(&likely, |row| first.nodes.see(row, reach)) {
            let smoothed = smooth(&blocks, in_pixels, first.nodes);
            let of_each = indices.iter().zip(&smoothed.envelopes);
            found.extend(of_each.map(|(&index, envelope)| (index, told(envelope, index))));
        }
        let all = found.iter().map(|(_, told)| told.worth);
        most = all.fold(most, f64::max);
        found.retain(|(_, told)| told.worth > WORTH * most);
        let kept: Vec<[i32; 2]> = found.iter().map(|(index, _)| *index).collect();
        let all = self.others(&kept, |_| true);
        let layers: Vec<Layer> = all.flat_map(|(_, blocks)| blocks.layers).collect();
        self.powers = of_first.iter().map(|t| t.power.max(0.0)).collect();
        for ((index, told), layer) in found.into_iter().zip(layers) {
            self.indices.push(index);
            self.powers.push(told.power.max(0.0));
            self.blocks.layers.push(layer);
            self.noise.levels.push(level);
        }
    }

    /// The widest window under which the lattice is straight, nm.
    pub(crate) fn choose_window(&self) -> f64 {
        let extent = self.frame[1] - self.frame[0];
        let sides = [0, 1].map(|i| extent[i] * self.reference.pitch[i] / self.period);
        let steps = window::ladder(sides[0].min(sides[1]));
        let mut chosen = steps[0];
        let of = |width: f64, stride| {
            let width = width * self.period;
            self.lattices(&self.smoothed(width, stride), width)
        };
        // What the last wider window saw, which is the next narrow one.
        let mut last = None;
        for &width in &steps {
            // Sparse nodes are enough, and all are independent.
            let stride = self.sparse(1.5 * width * self.period, LOOKED_AT);
            let wider = width * std::f64::consts::SQRT_2;
            let narrow = match last.take() {
                Some((before, seen)) if before == stride => seen,
                _ => of(width, stride),
            };
            let wide = of(wider, stride);
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
                    for (axis, wave) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                        let variance =
                            of_difference(a.variance(axis, wave), b.variance(axis, wave));
                        changes.push(change[(axis, wave)].powi(2) / variance);
                    }
                }
            }
            if changes.len() < 16 || !window::is_straight(&mut changes) {
                break;
            }
            chosen = width;
            last = Some((stride, wide));
        }
        chosen * self.period
    }
}

/// What a harmonic tells.
struct Told {
    /// Mean |c₀|², noise taken off.
    power: f64,
    /// That times h² + hk + k², if it is more than chance.
    worth: f64,
}

/// From the envelope of harmonic (h, k) at sparse nodes; the levels are those of white noise and of offsets of lines.
fn told(envelope: &Envelope, nodes: &Smoothed, levels: [f64; 2], [h, k]: [i32; 2]) -> Told {
    let (mut sum, mut noise, mut count) = (0.0, 0.0, 0.0);
    for (amplitude, support) in envelope.amplitude.iter().zip(&nodes.support) {
        if let Some(support) = support.filter(|s| s.share > 0.9) {
            sum += f64::from(amplitude.norm_sqr());
            noise += support.amplitude_noise;
            count += 1.0f64;
        }
    }
    let count = count.max(1.0);
    let units = levels.map(|level| level * noise / count);
    let power = sum / count - units[0] - units[1];
    // Chance of the mean: nodes a window apart are nearly independent, but offsets are the same all along a row.
    let rows = nodes.nodes.size[1] as f64;
    let chance = 4.0 * (units[0] / count.sqrt() + units[1] / rows.min(count).sqrt());
    let order = f64::from(h * h + h * k + k * k);
    let worth = if power > chance { power * order } else { 0.0 };
    Told { power, worth }
}
