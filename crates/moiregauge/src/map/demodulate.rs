//! An image → its local lattices on nodes, in pixels.
//!
//! Order of things: blocks of all likely harmonics; a pilot with a narrow window; a carrier that follows
//! what the pilot saw; which harmonics tell something; how wide the window may be; the noise; then the
//! wave vectors with that window, and masks.

use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::frame::image::Image;
use crate::map::defects::{Blur, Setting, blur, masks};
use crate::map::phase_blur::{VARIANCE, blurs_of_phases};
use crate::map::waves::{Harmonics, LocalLattice, Nothing, local_lattices};
use crate::numbers::median::median;
use crate::spectrum::shells::{FIRST_SHELL, shells};
use crate::window::blocks::{Blocks, Place, block_of, mix_some, step_of, stride_of};
use crate::window::lines::Levelled;
use crate::window::mask::Mask;
use crate::window::mixed::{Mixed, is_slow};
use crate::window::noise::{Beside, Noise};
use crate::window::smooth::{Nodes, Smoothed};
use crate::window::types::{Reference, Resolution, WaveMap, WaveNode};
use crate::window::widths::NARROWEST;

/// The likely harmonics: four shells.
const LIKELY: &[[i32; 2]] = shells(4);
/// Likely harmonics looked at together, for speed; and where blocks are single pixels, for the memory's sake.
const AT_ONCE: [usize; 2] = [6, 1];
/// Distance from the edges (windows) of nodes that test whether the harmonics agree: nearer ones contain leakage.
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
        Some(window) => window.max(NARROWEST * work.mixed.period),
        None => work.choose_window(),
    };
    Some(work.map(window, resolution))
}

/// A map under way.
pub(crate) struct Work<'a> {
    pub(crate) image: Levelled<'a>,
    pub(crate) mixed: Mixed,
    beside: Beside,
    pub(crate) noise: Noise,
}

impl<'a> Work<'a> {
    fn new(image: &'a Image, place: Place, reference: Reference) -> Option<Self> {
        let block = block_of(&reference);
        if image.columns < 4 * block[0] || image.rows < 4 * block[1] {
            return None;
        }
        let indices = FIRST_SHELL.to_vec();
        let levelled = Levelled::new(image, &reference);
        let beside = Beside::new(&levelled, place, &reference, &indices);
        Some(Self {
            noise: Noise::new(&beside, levelled.variance()),
            mixed: Mixed::new(&levelled, place, reference, indices, block),
            image: levelled,
            beside,
        })
    }

    /// Blocks of other harmonics, the carrier off, a few at a time; only the rows of blocks that are `wanted`.
    pub(crate) fn others<'b>(
        &'b self,
        indices: &'b [[i32; 2]],
        wanted: impl Fn(usize) -> bool + Sync + 'b,
    ) -> impl Iterator<Item = (&'b [[i32; 2]], Blocks)> + 'b {
        let Mixed {
            reference,
            place,
            carrier,
            ..
        } = &self.mixed;
        let block = self.mixed.blocks.block;
        let at_once = AT_ONCE[usize::from(block == [1, 1])];
        indices.chunks(at_once).map(move |some| {
            let waves: Vec<Vector2<f64>> = some.iter().map(|&i| reference.wave(i)).collect();
            let mut blocks = mix_some(&self.image, *place, &waves, block, &wanted);
            if let Some(carrier) = carrier {
                carrier.take_off(None, some, &mut blocks);
            }
            (some, blocks)
        })
    }

    /// The likely harmonics beyond the first shell that are slow enough to be sampled.
    pub(crate) fn likely(&self) -> Vec<[i32; 2]> {
        let all = LIKELY[FIRST_SHELL.len()..].iter().copied();
        all.filter(|&index| is_slow(&self.mixed.reference, index))
            .collect()
    }

    /// The local lattices of the harmonics in the blocks.
    pub(crate) fn lattices(
        &self,
        smoothed: &Smoothed,
        width: f64,
    ) -> Vec<Result<LocalLattice, Nothing>> {
        let harmonics = Harmonics::new(&self.mixed, &self.noise, &self.image, width);
        local_lattices(&self.mixed.blocks, smoothed, &harmonics, |at| {
            self.mixed.taken_off(at, width)
        })
    }

    /// The map with its final window.
    fn map(mut self, window_nm: f64, resolution: &Resolution) -> WaveMap {
        self.see_noise_of_others();
        let mixed = &self.mixed;
        let Reference { pitch, .. } = mixed.reference;
        let apart = step_of(resolution, &mixed.reference, window_nm);
        let nodes = mixed.nodes(stride_of(&mixed.reference, mixed.blocks.block, apart));
        let smoothed = mixed.cleaned(window_nm, nodes);
        let mut lattices = self.lattices(&smoothed, window_nm);
        if !self.noise.is_measured() {
            self.noise.disagreement = self.disagreement(&lattices, nodes, window_nm);
            lattices = self.lattices(&smoothed, window_nm);
        }
        let wider = window_nm * std::f64::consts::SQRT_2;
        let wide = self.mixed.cleaned(wider, nodes);
        let blurs = self.blurs(&lattices, &wide, wider);
        for (lattice, blur) in lattices.iter_mut().zip(&blurs) {
            if let Ok(lattice) = lattice {
                lattice.covariance *= blur.factor();
            }
        }
        let mixed = &self.mixed;
        let places = mixed.places(nodes);
        let width = mixed.reference.in_pixels(window_nm);
        let frame = self.whole();
        let sides = [0, 1].map(|i| ((frame[1] - frame[0])[i] + 1.0) * pitch[i]);
        let margin = resolution.margin_of(window_nm, sides);
        let setting = Setting {
            smoothed: &smoothed,
            places: &places,
            width,
            margin: width.map(|w| w * margin),
            frame,
        };
        let masks = masks(&setting, &lattices, &blurs, &self.noise_shares(&smoothed));
        let step = nodes.step(&mixed.blocks);
        let steps = [0, 1].map(|axis| step[axis] / width[axis]);
        let bent = blurs_of_phases(&smoothed, &wide, &masks, steps);
        let nodes_out = (0..nodes.len()).map(|n| {
            let carried = mixed.carried(places[n]);
            let phases = [0, 1, 2].map(|i| {
                let [h, k] = mixed.indices[i].map(f64::from);
                let amplitude = smoothed.envelopes[i].amplitude[n];
                f64::from(amplitude.arg()) - bent[n][i] + h * carried.x + k * carried.y
            });
            node_of(lattices[n].as_ref().ok(), masks[n], phases)
        });
        WaveMap {
            size: nodes.size,
            first: nodes.place(&mixed.blocks, 0),
            step: nodes.step(&mixed.blocks),
            window_nm,
            margin,
            reference: mixed.reference,
            centre: mixed.place.centre,
            noise_measured: self.noise.is_measured(),
            nodes: nodes_out.collect(),
            harmonics: mixed.used(&self.noise.levels),
        }
    }

    /// The noise of harmonics beyond the first shell, if there are any.
    fn see_noise_of_others(&mut self) {
        let Mixed {
            reference,
            place,
            indices,
            ..
        } = &self.mixed;
        if indices.len() > 3 {
            let others = Beside::new(&self.image, *place, reference, &indices[3..]);
            self.beside.extend(others);
            self.noise = Noise::new(&self.beside, self.image.variance());
            self.guess_noise();
        }
    }

    /// First and last pixel of the whole image.
    fn whole(&self) -> [Vector2<f64>; 2] {
        let [first, last] = self.mixed.frame;
        match self.mixed.place.rows {
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
        let signal: f64 = self.mixed.powers.iter().map(|power| 2.0 * power).sum();
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
        let away = self.mixed.reference.in_pixels(CLOSURE * width);
        let inside = |node: &usize| {
            let at = nodes.place(&self.mixed.blocks, *node);
            self.mixed.is_inside(at, away)
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

    /// What a window of `wider` nm, under which the blocks are `wide`, changes at each node.
    fn blurs(
        &self,
        lattices: &[Result<LocalLattice, Nothing>],
        wide: &Smoothed,
        wider: f64,
    ) -> Vec<Blur> {
        let wide = self.lattices(wide, wider);
        let pairs = lattices.iter().zip(&wide);
        pairs
            .map(|pair| match pair {
                (Ok(narrow), Ok(wide)) => blur(narrow, wide),
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
        phase_weights: lattice.map_or([0.0; 3], |l| l.phase_weights.map(|w| w / VARIANCE)),
        chi2: lattice.map_or(f64::NAN, |l| l.chi2),
        freedom: lattice.map_or(0, |l| l.freedom),
        signal_to_noise: lattice.map_or(0.0, |l| l.signal_to_noise),
        phases,
    }
}
