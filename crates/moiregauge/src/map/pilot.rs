//! A first look with a narrow window: the carrier, the harmonics that tell something, and how wide the
//! window may be.

use crate::map::demodulate::Work;
use crate::map::waves::{LocalLattice, level_of_ridge};
use crate::window::blocks::Layer;
use crate::window::carrier::{Carrier, MOST_CELLS, PILOT, Slope};
use crate::window::mixed::{FOLLOWED, LOOKED_AT, Mixed, ROUNDS, WORTH};
use crate::window::smooth::{Envelope, Nodes, Smoothed, radius, smooth};
use crate::window::widths::{WIDEST, of_difference};

/// The carrier is near enough when what is left turns by less over a pilot window (rad, root mean square): that is
/// one per cent of the amplitude.
const NEAR_ENOUGH: f64 = 0.15;
/// Cells of the first carrier along each axis; each round has twice as many. Few, since the pilot may be wrong in
/// places.
const FIRST_CELLS: usize = 4;
/// Rows of nodes by which harmonics are chosen; no other lines are mixed for that.
const ROWS_LOOKED_AT: usize = 12;

impl Work<'_> {
    /// Fits the carrier to what a narrow window sees, until little is left.
    pub(crate) fn follow(&mut self) {
        let width = PILOT * self.mixed.period;
        for round in 0..ROUNDS {
            let nodes = self.mixed.sparse(width, FOLLOWED);
            let smoothed = self.mixed.smoothed(width, nodes);
            let lattices = self.lattices(&smoothed, width);
            let mut slopes = Vec::new();
            // Turn over a window and what noise makes of it, squared.
            let (mut left, mut noise) = (0.0, 0.0);
            for (node, lattice) in lattices.iter().enumerate() {
                let whole = smoothed.support[node].is_some_and(|s| s.share > 0.9);
                let Some(lattice) = lattice.as_ref().ok().filter(|_| whole) else {
                    continue;
                };
                let at = nodes.place(&self.mixed.blocks, node);
                let change = lattice.pair - self.mixed.taken_off(at, width);
                for axis in 0..2 {
                    let scale = self.mixed.reference.in_pixels(width)[axis].powi(2);
                    left += scale * change.row(axis).norm_squared();
                    let of = |wave: usize| lattice.variance(axis, wave);
                    noise += scale * (of(0) + of(1));
                }
                slopes.push(Slope {
                    at,
                    slopes: lattice.pair - self.mixed.reference.pair,
                });
            }
            if slopes.len() < 4 {
                break;
            }
            let near = NEAR_ENOUGH.powi(2) * 2.0 * slopes.len() as f64;
            if left - noise < near {
                break;
            }
            let cells = self.cells(round);
            let Some(carrier) = Carrier::fit(&slopes, self.mixed.frame, cells) else {
                break;
            };
            self.mixed.carry(carrier);
        }
    }

    /// Cells of the carrier: never shorter than twice the widest window, lest it bends under it.
    fn cells(&self, round: usize) -> [usize; 2] {
        let Mixed {
            reference,
            period,
            frame,
            ..
        } = &self.mixed;
        let cell = reference.in_pixels(2.0 * WIDEST * period);
        [0, 1].map(|i| {
            let cells = (frame[1] - frame[0])[i] / cell[i];
            (cells as usize)
                .clamp(1, MOST_CELLS)
                .min(FIRST_CELLS << round)
        })
    }

    /// Adds the harmonics that tell something of the lattice to the first three.
    pub(crate) fn choose_harmonics(&mut self) {
        let width = PILOT * self.mixed.period;
        let [along, _] = self.mixed.sparse(width, LOOKED_AT).stride;
        let [_, across] = self.mixed.sparse(width, ROWS_LOOKED_AT).stride;
        let nodes = self.mixed.nodes([along, across]);
        let level = self.noise.levels.iter().sum::<f64>() / self.noise.levels.len() as f64;
        let first = self.mixed.smoothed(width, nodes);
        let in_pixels = self.mixed.reference.in_pixels(width);
        let told = |envelope: &Envelope, index: [i32; 2]| {
            let g = self.mixed.reference.wave(index);
            let ridge = level_of_ridge(self.image.ridge(g), g.x * in_pixels[0], in_pixels[0]);
            told(envelope, &first, [level, ridge], index)
        };
        let of_first = first.envelopes.iter().zip(&self.mixed.indices);
        let of_first: Vec<Told> = of_first.map(|(e, &index)| told(e, index)).collect();
        let mut most = of_first.iter().map(|t| t.worth).fold(0.0, f64::max);
        let reach = radius(in_pixels[1], self.mixed.blocks.block[1]);
        let mut found: Vec<([i32; 2], Told)> = Vec::new();
        let likely = self.likely();
        for (indices, blocks) in self.others(&likely, |row| nodes.see(row, reach)) {
            let smoothed = smooth(&blocks, in_pixels, nodes);
            let of_each = indices.iter().zip(&smoothed.envelopes);
            found.extend(of_each.map(|(&index, envelope)| (index, told(envelope, index))));
        }
        let all = found.iter().map(|(_, told)| told.worth);
        most = all.fold(most, f64::max);
        found.retain(|(_, told)| told.worth > WORTH * most);
        let kept: Vec<[i32; 2]> = found.iter().map(|(index, _)| *index).collect();
        let all = self.others(&kept, |_| true);
        let layers: Vec<Layer> = all.flat_map(|(_, blocks)| blocks.layers).collect();
        self.mixed.powers = of_first.iter().map(|t| t.power.max(0.0)).collect();
        for ((index, told), layer) in found.into_iter().zip(layers) {
            self.mixed.indices.push(index);
            self.mixed.powers.push(told.power.max(0.0));
            self.mixed.blocks.layers.push(layer);
            self.noise.levels.push(level);
        }
    }

    /// The widest window under which the lattice is straight, nm.
    pub(crate) fn choose_window(&self) -> f64 {
        let see = |width: f64, nodes: Nodes| {
            let lattices = self.lattices(&self.mixed.smoothed(width, nodes), width);
            lattices.into_iter().map(Result::ok).collect()
        };
        self.mixed
            .choose_window(see, |a: &LocalLattice, b: &LocalLattice| {
                let change = b.pair - a.pair;
                let of = |(axis, wave)| {
                    let variance = of_difference(a.variance(axis, wave), b.variance(axis, wave));
                    change[(axis, wave)].powi(2) / variance
                };
                [(0, 0), (1, 0), (0, 1), (1, 1)].map(of).to_vec()
            })
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
