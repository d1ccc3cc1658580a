//! The noise of a spectrum where its peaks are looked for.

use rayon::prelude::*;
use rustfft::num_complex::Complex;

use crate::numbers::interrupt;
use crate::numbers::median::median;
use crate::spectrum::fourier::{Kept, wide};
use crate::spectrum::transform::Spectrum;

/// Noise power, constant over blocks that are narrow along kx and tall along ky, since line noise
/// is a ridge along ky.
pub(crate) struct NoiseMap {
    blocks: usize,
    values: Vec<f64>,
    rows: usize,
}

/// Blocks of bins in which the noise of a spectrum is read: narrow along kx, on which the noise of a scan depends,
/// ...
pub(crate) const BLOCK_WIDTH: usize = 4;
/// ... and high, so that 128 bins tell it to a tenth.
const BLOCK_HEIGHT: usize = 32;

impl NoiseMap {
    pub(crate) fn new<T: Kept>(spectrum: &Spectrum<T>) -> Self {
        let half = spectrum.half();
        let across = half.div_ceil(BLOCK_WIDTH);
        let down = spectrum.rows.div_ceil(BLOCK_HEIGHT);
        let blocks = (0..down).into_par_iter().map(|by| {
            interrupt::check();
            // Centred on zero frequency, like the ridge.
            let first = by * BLOCK_HEIGHT + spectrum.rows - BLOCK_HEIGHT / 2;
            let lines = (first..first + BLOCK_HEIGHT).map(|ky| ky % spectrum.rows);
            let lines = lines.map(|ky| &spectrum.values[ky * half..][..half]);
            let lines: Vec<&[Complex<T>]> = lines.collect();
            let mut sample = Vec::with_capacity(BLOCK_WIDTH * BLOCK_HEIGHT);
            let mut block = |bx: usize| {
                let columns = bx * BLOCK_WIDTH..((bx + 1) * BLOCK_WIDTH).min(half);
                sample.clear();
                for line in &lines {
                    let values = line[columns.clone()].iter();
                    sample.extend(values.map(|value| wide(*value).norm_sqr()));
                }
                // The median of exponentially distributed power is ln 2 of its mean.
                median(&mut sample) / std::f64::consts::LN_2
            };
            (0..across).map(&mut block).collect::<Vec<f64>>()
        });
        let mut values = blocks.collect::<Vec<_>>().concat();
        let floor = values.iter().copied().fold(0.0, f64::max) * 1e-14;
        for v in &mut values {
            *v = v.max(floor).max(f64::MIN_POSITIVE);
        }
        Self {
            blocks: across,
            values,
            rows: spectrum.rows,
        }
    }

    /// The values for `BLOCK_WIDTH` frequencies kx each.
    pub(crate) fn row(&self, ky: usize) -> &[f64] {
        let by = ((ky + BLOCK_HEIGHT / 2) % self.rows) / BLOCK_HEIGHT;
        &self.values[by * self.blocks..(by + 1) * self.blocks]
    }
}
