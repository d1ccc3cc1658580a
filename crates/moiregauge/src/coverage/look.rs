//! What a window that is slid over a frame sees of three waves: where they are, how strong they are, and how strong noise is.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::coverage::cells::{Cells, Window};
use crate::coverage::hollows::hollows;
use crate::coverage::patch::LatticeRegion;
use crate::frame::image::Image;
use crate::numbers::median::median;
use crate::numbers::three::three;

/// Wide enough: noise in the weighted sum, which is 1 where the lattice is, is below this. Five times it fits between
/// half and one.
const QUIET: f64 = 0.1;

/// Cells with more than this share of what is typical are the patch: an edge is where the window sees half.
pub(crate) const INSIDE: f64 = 0.5;

/// What is typical of a wave is less than in this share of the cells has more of it: half of the windows of a small patch see its
/// edge, which does not count.
const TYPICAL: f64 = 0.75;

/// Cells whose window is missing for the most part tell nothing.
const SUPPORT: f64 = 0.15;

/// Power over noise that each wave has under the window, at least: e⁻⁸ by chance, in each of many windows.
const PLAIN: f64 = 8.0;

/// What a window sees.
pub(crate) struct Seen {
    pub(crate) envelopes: [Vec<Complex64>; 3],
    pub(crate) inside: Vec<bool>,
    /// Typical power of each wave where it is.
    pub(crate) typical: [f64; 3],
    /// The same over that of noise.
    pub(crate) weights: [f64; 3],
    /// Noise power per pixel at each wave.
    pub(crate) noise: [f64; 3],
    /// The window, mean periods.
    pub(crate) width: f64,
}

impl Seen {
    /// Amplitude over noise amplitude in one resolution cell of the patch, weakest of the three waves.
    pub(crate) fn signal_to_noise(&self, cells: &Cells, patch: &LatticeRegion) -> f64 {
        let weakest = self.weights.iter().copied().fold(f64::INFINITY, f64::min);
        (weakest * self.windows(cells, patch)).sqrt()
    }

    /// Independent windows in a patch.
    fn windows(&self, cells: &Cells, patch: &LatticeRegion) -> f64 {
        let inside = patch.inside.iter().zip(cells.counts());
        let pixels: f64 = inside.filter(|(i, _)| **i).map(|(_, n)| n).sum();
        let [a, b] = [0, 1].map(|axis| self.width * cells.period[axis]);
        pixels / (4.0 * std::f64::consts::PI * a * b)
    }

    /// Whether each of the three waves stands out of the noise under the window itself.
    pub(crate) fn is_plain(&self) -> bool {
        self.weights.iter().all(|w| *w > PLAIN)
    }

    /// Power over noise of the three waves in one resolution cell of the patch, in sum.
    pub(crate) fn evidence(&self, cells: &Cells, patch: &LatticeRegion) -> f64 {
        self.weights.iter().sum::<f64>() * self.windows(cells, patch)
    }
}

/// A frame in cells.
pub(crate) struct Frame<'a> {
    pub(crate) cells: &'a Cells,
    image: &'a Image,
    /// 1 where a pixel is there; `None` where all are.
    ones: Option<Image>,
    /// Sums of the pixels of each cell.
    level: Vec<f64>,
}

/// Sums over cells for a pair of waves.
pub(crate) struct Waves {
    pub(crate) sums: [Vec<Complex64>; 3],
    /// `Σ e^{−iq·n}` of the pixels that are there.
    ones: [Vec<Complex64>; 3],
    /// Beside each wave, where only noise is.
    quiet: [[Vec<Complex64>; 2]; 3],
}

impl Waves {
    /// The sums for the image without a level of each cell.
    pub(crate) fn without(&self, level: &[f64]) -> [Vec<Complex64>; 3] {
        [0, 1, 2].map(|i| {
            let of_cells = self.sums[i].iter().zip(&self.ones[i]).zip(level);
            of_cells
                .map(|((sum, ones), level)| sum - ones * level)
                .collect()
        })
    }
}

impl<'a> Frame<'a> {
    pub(crate) fn new(cells: &'a Cells, image: &'a Image) -> Self {
        let levels = cells.mixed(image, Vector2::zeros());
        Self {
            cells,
            image,
            ones: ones(image),
            level: levels.iter().map(|level| level.re).collect(),
        }
    }

    pub(crate) fn waves(&self, pair: &Matrix2<f64>) -> Waves {
        let mixed = |image: &Image, q: Vector2<f64>| self.cells.mixed(image, q);
        Waves {
            sums: three(pair).map(|q| mixed(self.image, q)),
            quiet: hollows(pair).map(|places| places.map(|q| mixed(self.image, q))),
            ones: three(pair).map(|q| match &self.ones {
                Some(ones) => mixed(ones, q),
                None => (self.cells).mixed_ones([self.image.columns, self.image.rows], q),
            }),
        }
    }

    /// The mean under the window at each cell. A window that the frame or missing pixels cut off sees a wave in every constant.
    pub(crate) fn level(&self, window: &Window) -> Vec<f64> {
        self.cells.envelope(&self.level, window)
    }

    /// Cells a number of mean periods `apart` (0: all) whose window is there for the most part.
    fn usable(&self, window: &Window, apart: f64) -> Vec<usize> {
        let cells = self.cells;
        let stride = [0, 1].map(|axis| {
            let cells = apart * cells.period[axis] / cells.pixels[axis] as f64;
            (cells as usize).max(1)
        });
        let every = |axis: usize| (stride[axis] / 2..cells.size[axis]).step_by(stride[axis]);
        let all = every(1).flat_map(|y| every(0).map(move |x| y * cells.size[0] + x));
        all.filter(|&i| window.support[i] > SUPPORT).collect()
    }

    /// Noise power per pixel at each wave: what is beside it, seen by windows at some cells, as the median sees it. Edges and steps, which are in
    /// few windows, do not count.
    fn noise(&self, waves: &Waves, window: &Window, at: &[usize]) -> [f64; 3] {
        let level = |sums: &Vec<Complex64>| {
            let envelopes = self.cells.envelope_at(sums, window, at);
            let powers = envelopes.iter().zip(at);
            let powers = powers.map(|(envelope, &i)| envelope.norm_sqr() / window.noise[i]);
            median(&mut powers.collect::<Vec<f64>>()) / std::f64::consts::LN_2
        };
        let all: Vec<f64> = (waves.quiet.par_iter().flatten().map(level)).collect();
        [0, 2, 4].map(|i| f64::midpoint(all[i], all[i + 1]))
    }

    /// Amplitudes under a window of a number of mean periods; `None` where noise makes it unfit.
    pub(crate) fn look(&self, waves: &Waves, window: &Window, width: f64) -> Option<Seen> {
        let cells = self.cells;
        let variance =
            |at: &[usize]| median(&mut at.iter().map(|&i| window.noise[i]).collect::<Vec<_>>());
        // Windows a width apart tell noise as well as all do, for a fraction of the work.
        let apart = self.usable(window, width);
        if apart.is_empty() {
            return None;
        }
        let noise = self.noise(waves, window, &apart);
        let unit = noise.map(|noise| noise * variance(&apart));
        let sums = waves.without(&self.level(window));
        let powers = sums.each_ref().map(|sums| {
            let envelopes = cells.envelope_at(sums, window, &apart);
            envelopes.iter().map(Complex64::norm_sqr).collect()
        });
        typical(&powers, unit)?;
        let envelopes = sums.map(|sums| cells.envelope(&sums, window));
        let usable = self.usable(window, 0.0);
        let unit = noise.map(|noise| noise * variance(&usable));
        let powers =
            [0, 1, 2].map(|i| usable.iter().map(|&n| envelopes[i][n].norm_sqr()).collect());
        let (typical, there) = typical(&powers, unit)?;
        let mut inside = vec![false; cells.len()];
        for (&i, there) in usable.iter().zip(there) {
            inside[i] = there;
        }
        Some(Seen {
            typical,
            weights: [0, 1, 2].map(|i| typical[i] / unit[i]),
            envelopes,
            inside,
            noise,
            width,
        })
    }
}

/// 1 where a pixel is; `None` if all are there.
pub(crate) fn ones(image: &Image) -> Option<Image> {
    if image.values.par_iter().all(|v| v.is_finite()) {
        return None;
    }
    let ones = image
        .values
        .iter()
        .map(|v| if v.is_finite() { 1.0 } else { f64::NAN });
    Some(Image::new(image.rows, image.columns, ones.collect()))
}

/// Typical power of each wave where it is, and where that is, by the powers at some cells: first by the strong cells, then as the
/// median of the patch. `None` where noise, of power `unit` in a cell, is more than [`QUIET`] of it.
fn typical(powers: &[Vec<f64>; 3], unit: [f64; 3]) -> Option<([f64; 3], Vec<bool>)> {
    let mut typical = powers.each_ref().map(|powers| {
        powers.iter().map(|p| p * p).sum::<f64>()
            / powers.iter().sum::<f64>().max(f64::MIN_POSITIVE)
    });
    let mut inside = vec![false; powers[0].len()];
    for _ in 0..4 {
        let total: f64 = typical.iter().sum();
        let noisy: f64 = (0..3).map(|i| typical[i] * unit[i]).sum();
        if !((noisy / 2.0).sqrt() / total < QUIET) {
            return None;
        }
        for (n, inside) in inside.iter_mut().enumerate() {
            let found = (0..3).map(|i| (powers[i][n] * typical[i]).sqrt());
            *inside = found.sum::<f64>() > INSIDE * total;
        }
        if !inside.contains(&true) {
            return None;
        }
        let before = typical;
        for (typical, powers) in typical.iter_mut().zip(powers) {
            let there = powers.iter().zip(&inside).filter(|(_, inside)| **inside);
            let mut there: Vec<f64> = there.map(|(power, _)| *power).collect();
            let place = (TYPICAL * (there.len() - 1) as f64) as usize;
            *typical = *there.select_nth_unstable_by(place, f64::total_cmp).1;
        }
        let moved = (0..3).map(|i| (typical[i] / before[i] - 1.0).abs());
        if moved.fold(0.0, f64::max) < 0.02 {
            break;
        }
    }
    Some((typical, inside))
}
