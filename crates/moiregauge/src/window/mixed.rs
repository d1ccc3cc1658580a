//! Harmonics of one image, mixed down, and the carrier that was taken off them: what maps are made of.

use nalgebra::{Matrix2, Vector2};

use crate::spectrum::shells::FASTEST;
use crate::window::blocks::{Blocks, Place, mix, stride_of};
use crate::window::carrier::Carrier;
use crate::window::leaks::clean;
use crate::window::lines::Levelled;
use crate::window::smooth::{Nodes, Smoothed, smooth};
use crate::window::types::{Reference, UsedHarmonic};
use crate::window::widths;

/// A harmonic that adds less than this share to what is known is not worth its time: one per cent of the errors.
pub(crate) const WORTH: f64 = 0.02;
/// Times the carrier is brought up to date: twice as many cells each time, 4, 8, 16.
pub(crate) const ROUNDS: usize = 3;
/// Nodes along each axis to which the carrier is fitted: six to each of its cells at most, ...
pub(crate) const FOLLOWED: usize = 100;
/// ... and by which windows and harmonics are chosen: 1600 tell a median to some per cent.
pub(crate) const LOOKED_AT: usize = 40;
/// Changes by a wider window that have to be seen.
const FEWEST: usize = 16;

/// Harmonics of an image in blocks.
pub(crate) struct Mixed {
    pub(crate) reference: Reference,
    pub(crate) place: Place,
    /// nm.
    pub(crate) period: f64,
    /// First and last pixel of the part in hand.
    pub(crate) frame: [Vector2<f64>; 2],
    pub(crate) indices: Vec<[i32; 2]>,
    pub(crate) blocks: Blocks,
    /// What has been taken off the blocks.
    pub(crate) carrier: Option<Carrier>,
    /// Mean |c₀|² of each harmonic in the pilot, noise taken off.
    pub(crate) powers: Vec<f64>,
}

/// Whether a harmonic is slow enough to be sampled.
pub(crate) fn is_slow(reference: &Reference, index: [i32; 2]) -> bool {
    reference.wave(index).amax() < FASTEST
}

impl Mixed {
    pub(crate) fn new(
        image: &Levelled,
        place: Place,
        reference: Reference,
        indices: Vec<[i32; 2]>,
        block: [usize; 2],
    ) -> Self {
        let waves: Vec<Vector2<f64>> = indices.iter().map(|&i| reference.wave(i)).collect();
        let first = Vector2::new(0.0, place.row as f64);
        let [columns, rows] = [image.image.columns, image.image.rows];
        let last = Vector2::new(columns as f64 - 1.0, rows as f64 - 1.0);
        Self {
            period: reference.period(),
            frame: [first, first + last],
            blocks: mix(image, place, &waves, block),
            powers: vec![0.0; indices.len()],
            carrier: None,
            indices,
            reference,
            place,
        }
    }

    /// Nodes in the middle of the blocks; in a part of an image from its first line on, so that those of
    /// neighbouring parts go on.
    pub(crate) fn nodes(&self, stride: [usize; 2]) -> Nodes {
        let mut nodes = Nodes::filling(self.blocks.size, stride);
        if self.place.rows.is_some() {
            nodes.first[1] = 0;
        }
        nodes
    }

    /// Nodes `distance_nm` apart, or farther, so that their number along each axis is limited.
    pub(crate) fn sparse(&self, distance_nm: f64, most: usize) -> Nodes {
        let stride = stride_of(&self.reference, self.blocks.block, distance_nm);
        self.nodes([0, 1].map(|i| stride[i].max(self.blocks.size[i] / most)))
    }

    /// Places of nodes, pixels.
    pub(crate) fn places(&self, nodes: Nodes) -> Vec<Vector2<f64>> {
        let all = 0..nodes.len();
        all.map(|n| nodes.place(&self.blocks, n)).collect()
    }

    /// Envelopes under a window of `width` nm.
    pub(crate) fn smoothed(&self, width: f64, nodes: Nodes) -> Smoothed {
        smooth(&self.blocks, self.reference.in_pixels(width), nodes)
    }

    /// The same without what leaks through cut windows.
    pub(crate) fn cleaned(&self, width: f64, nodes: Nodes) -> Smoothed {
        let mut smoothed = self.smoothed(width, nodes);
        let pixels = self.reference.in_pixels(width);
        let taken = |at: Vector2<f64>| {
            let phases = self.reference.pair.tr_mul(&(at - self.place.centre));
            (phases + self.carried(at), self.taken_off(at, width))
        };
        clean(&mut smoothed, &self.blocks, pixels, &self.indices, taken);
        smoothed
    }

    /// Phases of the carrier.
    pub(crate) fn carried(&self, at: Vector2<f64>) -> Vector2<f64> {
        let phases = self.carrier.as_ref().map(|c| c.at(at).0);
        phases.unwrap_or_default()
    }

    /// The slopes that were taken off, as a window of `width` nm sees them.
    pub(crate) fn taken_off(&self, at: Vector2<f64>, width: f64) -> Matrix2<f64> {
        let pixels = self.reference.in_pixels(width);
        let slopes = self.carrier.as_ref().map(|c| c.mean_slopes(at, pixels));
        self.reference.pair + slopes.unwrap_or_else(Matrix2::zeros)
    }

    /// Takes another carrier off instead of that which was.
    pub(crate) fn carry(&mut self, carrier: Carrier) {
        carrier.take_off(self.carrier.as_ref(), &self.indices, &mut self.blocks);
        self.carrier = Some(carrier);
    }

    /// Mean amplitudes |c₀| of the harmonics.
    pub(crate) fn amplitudes(&self) -> Vec<f64> {
        self.powers.iter().map(|p| p.max(0.0).sqrt()).collect()
    }

    /// Whether a place is farther than `away` (pixels) from all edges.
    pub(crate) fn is_inside(&self, at: Vector2<f64>, away: [f64; 2]) -> bool {
        let [low, high] = self.frame;
        (0..2).all(|i| (at - low)[i].min((high - at)[i]) > away[i])
    }

    /// The widest window (nm) under which the waves are straight. `see` gives what is at each node under a window of
    /// nm; `changes` the squared changes from one window to the next over the variances that noise gives them.
    pub(crate) fn choose_window<T>(
        &self,
        see: impl Fn(f64, Nodes) -> Vec<Option<T>>,
        changes: impl Fn(&T, &T) -> Vec<f64>,
    ) -> f64 {
        let extent = self.frame[1] - self.frame[0];
        let sides = [0, 1].map(|i| extent[i] * self.reference.pitch[i] / self.period);
        let steps = widths::ladder(sides[0].min(sides[1]));
        let mut chosen = steps[0];
        // What the last wider window saw, which is the next narrow one.
        let mut last = None;
        for &width in &steps {
            // Sparse nodes are enough, and all are independent.
            let nodes = self.sparse(1.5 * width * self.period, LOOKED_AT);
            let wider = width * std::f64::consts::SQRT_2;
            let narrow = match last.take() {
                Some((before, seen)) if before == nodes => seen,
                _ => see(width * self.period, nodes),
            };
            let wide = see(wider * self.period, nodes);
            let away = self.reference.in_pixels(3.0 * wider * self.period);
            let mut seen = Vec::new();
            for (node, pair) in narrow.iter().zip(&wide).enumerate() {
                let inside = self.is_inside(nodes.place(&self.blocks, node), away);
                if let (true, (Some(a), Some(b))) = (inside, pair) {
                    seen.extend(changes(a, b));
                }
            }
            if seen.len() < FEWEST || !widths::is_straight(&mut seen) {
                break;
            }
            chosen = width;
            last = Some((nodes, wide));
        }
        chosen * self.period
    }

    /// The harmonics, with the noise at each.
    pub(crate) fn used(&self, levels: &[f64]) -> Vec<UsedHarmonic> {
        let all = self.indices.iter().zip(&self.powers).zip(levels);
        all.map(|((&index, power), &noise)| UsedHarmonic {
            index,
            amplitude: 2.0 * power.sqrt(),
            noise,
        })
        .collect()
    }
}
