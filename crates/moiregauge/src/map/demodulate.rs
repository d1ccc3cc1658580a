//! An image → its local lattices on nodes, in pixels.
//!
//! Order of things: blocks of all likely harmonics; a pilot with a narrow window; a carrier that follows
//! what the pilot saw; which harmonics tell something; how wide the window may be; the noise; then the
//! wave vectors with that window, and masks.

use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::frame::image::Image;
use crate::map::defects::{Blur, Setting, masks};
use crate::map::waves::{Harmonics, LocalLattice, Nothing, local_lattices};
use crate::numbers::median::median;
use crate::spectrum::shells::{FIRST_SHELL, shells};
use crate::window::blocks::{Blocks, Place, block_of, mix, mix_some, step_of, stride_of};
use crate::window::carrier::Carrier;
use crate::window::leaks::clean;
use crate::window::lines::Levelled;
use crate::window::mask::Mask;
use crate::window::noise::{Beside, Noise};
use crate::window::smooth::{Nodes, Smoothed, smooth};
use crate::window::types::{Reference, Resolution, UsedHarmonic, WaveMap, WaveNode};
use crate::window::widths::NARROWEST;

/// The likely harmonics: four shells.
const LIKELY: &[[i32; 2]] = shells(4);
/// Wave vectors beyond this (rad per pixel, each component) are too near the limit of sampling, π. Chosen by eye.
const FASTEST: f64 = 2.6;

/// Likely harmonics looked at together, for speed; and where blocks are single pixels, for the memory's sake.
const AT_ONCE: [usize; 2] = [6, 1];
/// Nodes so many windows from the edges say how well the harmonics agree: nearer ones hold what edges leak.
const CLOSURE: f64 = 1.0;

/// Demodulates an image whose background is gone. `place` says which part of a larger image it is.
///
/// `None` where the frame is smaller than a few windows, or shows nothing.
pub(crate) fn demodulate(
    image: &Image,
    place: Place,
    reference: &Reference,
    resolution: &Resolution,
) -> Option<WaveMap> {
    let mut work = Work::new(image, place, *reference)?;
    work.follow();
    work.choose_harmonics();
    work.guess_noise();
    let window = match resolution.window_nm {
        Some(window) => window.max(NARROWEST * work.period),
        None => work.choose_window(),
    };
    Some(work.map(window, resolution))
}

/// A map under way.
pub(crate) struct Work<'a> {
    pub(crate) image: Levelled<'a>,
    pub(crate) reference: Reference,
    place: Place,
    /// nm.
    pub(crate) period: f64,
    /// First and last pixel of the part in hand.
    pub(crate) frame: [Vector2<f64>; 2],
    pub(crate) indices: Vec<[i32; 2]>,
    pub(crate) blocks: Blocks,
    beside: Beside,
    pub(crate) noise: Noise,
    /// What has been taken off the blocks.
    pub(crate) carrier: Option<Carrier>,
    /// Mean |c₀|² of each harmonic in the pilot, noise taken off.
    pub(crate) powers: Vec<f64>,
}

impl<'a> Work<'a> {
    fn new(image: &'a Image, place: Place, reference: Reference) -> Option<Self> {
        let period = reference.period();
        let block = block_of(&reference);
        if image.columns < 4 * block[0] || image.rows < 4 * block[1] {
            return None;
        }
        let indices = FIRST_SHELL.to_vec();
        let levelled = Levelled::new(image, &reference);
        let beside = Beside::new((&levelled, place), &reference, &indices);
        let noise = Noise::new(&beside, levelled.variance());
        let waves: Vec<Vector2<f64>> = indices.iter().map(|&i| reference.wave(i)).collect();
        let blocks = mix(&levelled, place, &waves, block);
        let first = Vector2::new(0.0, place.row as f64);
        let last = Vector2::new(image.columns as f64 - 1.0, image.rows as f64 - 1.0);
        Some(Self {
            image: levelled,
            reference,
            place,
            period,
            frame: [first, first + last],
            powers: vec![0.0; indices.len()],
            indices,
            blocks,
            beside,
            noise,
            carrier: None,
        })
    }

    /// Smooths all layers with a window of `width` nm.
    pub(crate) fn smoothed(&self, width: f64, stride: [usize; 2]) -> Smoothed {
        let nodes = self.nodes(stride);
        smooth(&self.blocks, self.reference.in_pixels(width), nodes)
    }

    /// Blocks of other harmonics, the carrier off, a few at a time; only the rows of blocks that are `wanted`.
    pub(crate) fn others<'b>(
        &'b self,
        indices: &'b [[i32; 2]],
        wanted: impl Fn(usize) -> bool + Sync + 'b,
    ) -> impl Iterator<Item = (&'b [[i32; 2]], Blocks)> + 'b {
        let at_once = AT_ONCE[usize::from(self.blocks.block == [1, 1])];
        indices.chunks(at_once).map(move |some| {
            let waves: Vec<Vector2<f64>> = some.iter().map(|&i| self.reference.wave(i)).collect();
            let block = self.blocks.block;
            let mut blocks = mix_some(&self.image, self.place, &waves, block, &wanted);
            if let Some(carrier) = &self.carrier {
                carrier.take_off(None, (&mut blocks.layers, some), &self.blocks);
            }
            (some, blocks)
        })
    }

    /// The likely harmonics beyond the first shell that are slow enough to be sampled.
    pub(crate) fn likely(&self) -> Vec<[i32; 2]> {
        let slow_enough = |index: &[i32; 2]| self.reference.wave(*index).amax() < FASTEST;
        LIKELY[FIRST_SHELL.len()..]
            .iter()
            .copied()
            .filter(slow_enough)
            .collect()
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

    /// The same without what leaks through cut windows.
    fn cleaned(&self, width: f64, stride: [usize; 2]) -> Smoothed {
        let mut smoothed = self.smoothed(width, stride);
        let window = self.reference.in_pixels(width);
        let taken = |at: Vector2<f64>| {
            let slopes = self.taken_off(at, width);
            let carrier = self.carrier.as_ref().map(|c| c.at(at).0);
            let phases = self.reference.pair.tr_mul(&(at - self.place.centre));
            (phases + carrier.unwrap_or_default(), slopes)
        };
        clean(&mut smoothed, (&self.blocks, window), &self.indices, taken);
        smoothed
    }

    /// What was taken off, as a window of `width` nm sees it.
    pub(crate) fn taken_off(&self, at: Vector2<f64>, width: f64) -> Matrix2<f64> {
        let pixels = self.reference.in_pixels(width);
        let slopes = self.carrier.as_ref().map(|c| c.mean_slopes(at, pixels));
        self.reference.pair + slopes.unwrap_or_else(Matrix2::zeros)
    }

    /// The local lattices of the harmonics in the blocks.
    pub(crate) fn lattices(
        &self,
        smoothed: &Smoothed,
        width: f64,
    ) -> Vec<Result<LocalLattice, Nothing>> {
        let amplitudes: Vec<f64> = self.powers.iter().map(|p| p.max(0.0).sqrt()).collect();
        let ridge = |&index: &[i32; 2]| self.image.ridge(self.reference.wave(index));
        let harmonics = Harmonics::new(
            (&self.indices, &self.noise),
            self.indices.iter().map(ridge).collect(),
            &self.reference.pair,
            &amplitudes,
            (self.reference.in_pixels(width), self.blocks.block),
        );
        local_lattices(&self.blocks, smoothed, &harmonics, |at| {
            self.taken_off(at, width)
        })
    }

    /// The map with its final window.
    fn map(mut self, window_nm: f64, resolution: &Resolution) -> WaveMap {
        if self.indices.len() > 3 {
            let others = &self.indices[3..];
            let others = Beside::new((&self.image, self.place), &self.reference, others);
            self.beside.extend(others);
            self.noise = Noise::new(&self.beside, self.image.variance());
            self.guess_noise();
        }
        let stride = stride_of(
            &self.reference,
            step_of(resolution, &self.reference, window_nm),
        );
        let smoothed = self.cleaned(window_nm, stride);
        let mut lattices = self.lattices(&smoothed, window_nm);
        if !self.noise.is_measured() {
            self.noise.disagreement = self.disagreement(&lattices, smoothed.nodes, window_nm);
            lattices = self.lattices(&smoothed, window_nm);
        }
        let blurs = self.blurs(
            &lattices,
            window_nm * std::f64::consts::SQRT_2,
            smoothed.nodes,
        );
        for (lattice, blur) in lattices.iter_mut().zip(&blurs) {
            if let Ok(lattice) = lattice {
                lattice.covariance *= blur.factor();
            }
        }
        let nodes = smoothed.nodes;
        let places: Vec<Vector2<f64>> = (0..nodes.len())
            .map(|n| nodes.place(&self.blocks, n))
            .collect();
        let width = self.reference.in_pixels(window_nm);
        let shares = self.noise_shares(&smoothed);
        let [first, last] = self.whole();
        let sides = [0, 1].map(|i| ((last - first)[i] + 1.0) * self.reference.pitch[i]);
        let margin = resolution.margin_of(window_nm, sides);
        let masks = masks(
            &Setting {
                smoothed: &smoothed,
                places: &places,
                width,
                margin: width.map(|w| w * margin),
                frame: self.whole(),
                noise_share: &shares,
                blurs: &blurs,
            },
            &lattices,
        );
        let nodes_out = (0..nodes.len()).map(|n| {
            let carried = self.carrier.as_ref().map(|c| c.at(places[n]).0);
            let carried = carried.unwrap_or_default();
            let phases = [0, 1, 2].map(|i| {
                let [h, k] = self.indices[i].map(f64::from);
                let amplitude = smoothed.envelopes[i].amplitude[n];
                f64::from(amplitude.arg()) + h * carried.x + k * carried.y
            });
            node_of(lattices[n].as_ref().ok(), masks[n], phases)
        });
        let harmonics = self
            .indices
            .iter()
            .zip(&self.powers)
            .zip(&self.noise.levels);
        WaveMap {
            size: nodes.size,
            first: nodes.place(&self.blocks, 0),
            step: [0, 1].map(|i| (nodes.stride[i] * self.blocks.block[i]) as f64),
            window_nm,
            margin,
            reference: self.reference,
            centre: self.place.centre,
            noise_measured: self.noise.is_measured(),
            nodes: nodes_out.collect(),
            harmonics: harmonics
                .map(|((&index, power), &noise)| UsedHarmonic {
                    index,
                    amplitude: 2.0 * power.sqrt(),
                    noise,
                })
                .collect(),
        }
    }

    /// First and last pixel of the whole image.
    fn whole(&self) -> [Vector2<f64>; 2] {
        let [first, last] = self.frame;
        match self.place.rows {
            Some(rows) => [Vector2::zeros(), Vector2::new(last.x, rows as f64 - 1.0)],
            None => [first, last],
        }
    }

    /// Where the frame is too small to see noise between the harmonics: what is left of the variance of the image
    /// when they are taken off, or a hundredth of it.
    fn guess_noise(&mut self) {
        if self.noise.is_measured() {
            return;
        }
        let variance = self.image.variance();
        let signal: f64 = self.powers.iter().map(|power| 2.0 * power).sum();
        self.noise
            .levels
            .fill((variance - signal).max(0.01 * variance));
    }

    /// χ² per degree of freedom of the closure as it is typical of the frame, 1 at least: noise that is only guessed,
    /// and as if it were white, is corrected by what the harmonics say of each other.
    fn disagreement(
        &self,
        lattices: &[Result<LocalLattice, Nothing>],
        nodes: Nodes,
        width: f64,
    ) -> f64 {
        let away = self.reference.in_pixels(CLOSURE * width);
        let inside = |node: &usize| {
            let at = nodes.place(&self.blocks, *node);
            let [low, high] = self.frame;
            (0..2).all(|i| (at - low)[i].min((high - at)[i]) > away[i])
        };
        let reduced = |node: usize| {
            let lattice = lattices[node].as_ref().ok()?;
            let n = lattice.freedom as f64;
            // The median of χ² is n (1 − 2/(9n))³.
            (lattice.freedom > 0).then(|| lattice.chi2 / (n * (1.0 - 2.0 / (9.0 * n)).powi(3)))
        };
        let all = (0..nodes.len()).filter(inside).filter_map(reduced);
        median(&mut all.collect::<Vec<f64>>()).max(1.0)
    }

    /// What a window of `wider` nm changes at each node.
    fn blurs(
        &self,
        lattices: &[Result<LocalLattice, Nothing>],
        wider: f64,
        nodes: Nodes,
    ) -> Vec<Blur> {
        let wide = self.lattices(&self.cleaned(wider, nodes.stride), wider);
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

/// A node of the map; NaN where there is no lattice.
fn node_of(lattice: Option<&LocalLattice>, mask: Mask, phases: [f64; 3]) -> WaveNode {
    let unknown = Matrix2::repeat(f64::NAN);
    WaveNode {
        mask,
        pair: lattice.map_or(unknown, |l| l.pair),
        covariance: lattice.map_or(Matrix4::repeat(f64::NAN), |l| l.covariance),
        phase_covariance: lattice.map_or(unknown, |l| l.phase_covariance),
        chi2: lattice.map_or(f64::NAN, |l| l.chi2),
        freedom: lattice.map_or(0, |l| l.freedom),
        signal_to_noise: lattice.map_or(0.0, |l| l.signal_to_noise),
        phases,
    }
}
