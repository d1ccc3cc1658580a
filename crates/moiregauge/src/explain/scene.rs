//! The pixels that descriptions of an image are compared on.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::frame::image::Image;
use crate::numbers::median::median;
use crate::numbers::three::three;
use crate::numbers::widest::widest;

/// Blocks along columns and along rows. With 36 blocks the standard error of a mean is known to 12 %.
const BLOCKS: usize = 6;
/// A block counts with at least the inverse of this fraction of the bins of the fullest.
const FULL: usize = 4;
/// Number of groups of blocks that are held out in turn: bands of lines. What the lines of a band have in common (a gain, an offset, noise in time) is
/// then not seen by what predicts them.
pub(crate) const FOLDS: usize = BLOCKS;
/// Bins per shortest period: harmonics of twice the first order keep three bins a period.
const BINS_PER_PERIOD: f64 = 7.0;
/// Standard deviation of the Gaussian mean that is subtracted as background, in longest periods: it leaves 98 % of the first order.
const BACKGROUND: f64 = 0.45;
/// Multiple of the median absolute value at which values are clipped: 4 σ of Gaussian noise.
const CLIPPED: f64 = 6.0;
/// Bins that are looked at, at most.
const MOST_BINS: usize = 1 << 16;
/// Multiples of it are spread evenly, modulo 1: the golden ratio.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// Reach of the Gaussian, standard deviations.
const REACH: f64 = 3.0;

/// An image in bins without its slow background, divided into blocks.
#[derive(Clone)]
pub(crate) struct Scene {
    pub(crate) columns: usize,
    /// Values in bins; 0 where a bin is missing.
    pub(crate) values: Vec<f64>,
    /// Block of each bin; `None` where the bin is missing.
    pub(crate) block: Vec<Option<usize>>,
    /// Pixels of a bin along each axis.
    pub(crate) binning: usize,
    /// Middle of the bins that are there (column, row), and half of their extent.
    pub(crate) middle: Vector2<f64>,
    pub(crate) half: Vector2<f64>,
}

impl Scene {
    /// The bins of an image in which lattices with wave vectors from those of `coarse` to those of `fine` (reciprocal pairs, rad per pixel)
    /// are compared. `None` for an image without pixels.
    pub(crate) fn new(image: &Image, coarse: &Matrix2<f64>, fine: &Matrix2<f64>) -> Option<Self> {
        let norms = |pair: &Matrix2<f64>| three(pair).map(|q| q.norm());
        let shortest = TAU / norms(fine).into_iter().fold(0.0, f64::max);
        let binning = ((shortest / BINS_PER_PERIOD) as usize).max(1);
        let binned = if binning > 1 {
            image.binned(binning)
        } else {
            image.clone()
        };
        let mut scene = Self::of(&binned)?;
        scene.binning = binning;
        let longest = TAU / norms(coarse).into_iter().fold(f64::INFINITY, f64::min);
        let sigma = BACKGROUND * longest / binning as f64;
        let lines = scene.block.chunks(scene.columns);
        let picked: Vec<bool> = lines.map(|line| line.iter().any(Option::is_some)).collect();
        let background = gaussian_mean(&binned.values, binned.columns, sigma, &picked);
        let values = scene.values.iter_mut().zip(&scene.block).zip(background);
        for ((value, _), ground) in values.filter(|((_, block), _)| block.is_some()) {
            *value -= ground;
        }
        clip(&mut scene.values);
        Some(scene)
    }

    /// An image as it is, each pixel a bin.
    pub(crate) fn of(image: &Image) -> Option<Self> {
        let [columns, rows] = [image.columns, image.rows];
        let there = |i: &usize| image.values[*i].is_finite();
        let place = |i: usize| Vector2::new((i % columns) as f64, (i / columns) as f64);
        let places = (0..image.values.len()).filter(there).map(place);
        let (low, high) = places.fold(
            (
                Vector2::repeat(f64::INFINITY),
                Vector2::repeat(f64::NEG_INFINITY),
            ),
            |(low, high): (Vector2<f64>, Vector2<f64>), at| (low.inf(&at), high.sup(&at)),
        );
        if low.x >= high.x || low.y >= high.y {
            return None;
        }
        let extent = high - low + Vector2::repeat(1.0);
        // Of large images some lines, at irregular places, lest waves look like others.
        let few = (MOST_BINS as f64 / (columns * rows) as f64).min(1.0);
        let mut picked = vec![few == 1.0; rows];
        for i in (0..(rows as f64 * few) as usize).filter(|_| few < 1.0) {
            let within = (i as f64 * GOLDEN).fract();
            picked[(((i as f64 + within) / few) as usize).min(rows - 1)] = true;
        }
        let block = |i: usize| {
            let at = (place(i) - low).component_div(&extent) * BLOCKS as f64;
            (there(&i) && picked[i / columns]).then(|| at.y as usize * BLOCKS + at.x as usize)
        };
        let block: Vec<Option<usize>> = (0..image.values.len()).map(block).collect();
        let value = |i: usize| block[i].map_or(0.0, |_| image.values[i]);
        Some(Self {
            columns,
            values: (0..image.values.len()).map(value).collect(),
            block,
            binning: 1,
            middle: (low + high) / 2.0,
            half: extent / 2.0,
        })
    }

    /// The bins whose middle pixel (column, row) is in a part of the image.
    pub(crate) fn within(mut self, holds: impl Fn([usize; 2]) -> bool) -> Self {
        for i in 0..self.values.len() {
            let bin = [i % self.columns, i / self.columns];
            if !holds(bin.map(|at| at * self.binning + self.binning / 2)) {
                (self.values[i], self.block[i]) = (0.0, None);
            }
        }
        self
    }

    /// The place of a bin, from −1 to 1 along each axis.
    pub(crate) fn unit(&self, bin: usize) -> Vector2<f64> {
        let place = Vector2::new((bin % self.columns) as f64, (bin / self.columns) as f64);
        (place - self.middle).component_div(&self.half)
    }

    /// From a bin to the next one along a line.
    pub(crate) fn step(&self) -> Vector2<f64> {
        Vector2::new(1.0 / self.half.x, 0.0)
    }

    /// The turn in which each block is held out.
    pub(crate) const fn fold(block: usize) -> usize {
        block / BLOCKS
    }

    /// How many blocks there are.
    pub(crate) const fn blocks() -> usize {
        BLOCKS * BLOCKS
    }

    /// Whether each block has enough bins to count.
    pub(crate) fn filled(&self) -> Vec<bool> {
        let mut counts = [0usize; BLOCKS * BLOCKS];
        self.block
            .iter()
            .flatten()
            .for_each(|block| counts[*block] += 1);
        let most = counts.iter().max().copied().unwrap_or(0);
        counts.iter().map(|count| FULL * *count > most).collect()
    }
}

/// Means weighted with a Gaussian of `sigma` over what is there, in the `wanted` lines.
pub(crate) fn gaussian_mean(
    values: &[f64],
    columns: usize,
    sigma: f64,
    wanted: &[bool],
) -> Vec<f64> {
    let reach = (REACH * sigma).ceil() as usize;
    let taps: Vec<f64> = (0..=reach)
        .map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp())
        .collect();
    let shift = |output: &mut [f64], input: &[f64], tap: f64| {
        let each = output.iter_mut().zip(input);
        each.for_each(|(sum, value)| *sum += tap * value);
    };
    // Sums of shifted copies, along lines and then of lines.
    let along = |input: &[f64]| {
        let mut lines = vec![0.0; input.len()];
        let each = lines.par_chunks_mut(columns).zip(input.par_chunks(columns));
        each.for_each(|(output, input)| {
            widest(
                #[inline(always)]
                || {
                    shift(output, input, taps[0]);
                    for (i, tap) in taps.iter().enumerate().skip(1) {
                        let off = i.min(columns);
                        shift(&mut output[off..], &input[..columns - off], *tap);
                        shift(&mut output[..columns - off], &input[off..], *tap);
                    }
                },
            );
        });
        lines
    };
    // Where no pixel is missing, `lines` is one line that all others are like.
    let up = |lines: &[f64], row: usize| {
        let mut sums = vec![0.0; columns];
        widest(
            #[inline(always)]
            || {
                for (i, tap) in taps.iter().enumerate() {
                    let others = [row.checked_sub(i), Some(row + i).filter(|_| i > 0)];
                    for other in others.into_iter().flatten().filter(|y| *y < wanted.len()) {
                        let line = lines.chunks_exact(columns).nth(other);
                        shift(&mut sums, line.unwrap_or(&lines[..columns]), *tap);
                    }
                }
            },
        );
        sums
    };
    let there = |v: &f64| f64::from(u8::from(v.is_finite()));
    let filled = |v: &f64| if v.is_finite() { *v } else { 0.0 };
    let (all, there) = if values.iter().all(|v| v.is_finite()) {
        (along(values), along(&vec![1.0; columns]))
    } else {
        let [filled, there] = [
            values.iter().map(filled).collect::<Vec<f64>>(),
            values.iter().map(there).collect(),
        ];
        (along(&filled), along(&there))
    };
    let mut means = vec![0.0; values.len()];
    let lines = means.par_chunks_mut(columns).zip(wanted).enumerate();
    let lines = lines.filter(|(_, (_, wanted))| **wanted);
    lines.for_each(|(row, (means, _))| {
        let (sums, weights) = (up(&all, row), up(&there, row));
        for ((mean, sum), weight) in means.iter_mut().zip(sums).zip(weights) {
            *mean = if weight > 0.0 { sum / weight } else { 0.0 };
        }
    });
    means
}

/// Clips at a multiple of the median absolute value: a spike is no more than a step.
fn clip(values: &mut [f64]) {
    let mut sizes: Vec<f64> = values
        .iter()
        .filter(|v| **v != 0.0)
        .map(|v| v.abs())
        .collect();
    if sizes.is_empty() {
        return;
    }
    let most = CLIPPED * median(&mut sizes);
    for value in values {
        *value = value.clamp(-most, most);
    }
}
