//! Gaussian means over pixels, some of which may be missing.

use rayon::prelude::*;

use crate::frame::image::Image;
use crate::numbers::interrupt;

/// Gaussian means of this width (standard deviation along columns and rows, pixels) over the pixels that are there.
pub(crate) fn blurred(image: &Image, width: [f64; 2]) -> Vec<f64> {
    let known = image
        .values
        .iter()
        .map(|v| f64::from(u8::from(v.is_finite())));
    let weights = blur(&known.collect::<Vec<_>>(), image, width);
    let values = image
        .values
        .iter()
        .map(|v| if v.is_finite() { *v } else { 0.0 });
    let sums = blur(&values.collect::<Vec<_>>(), image, width);
    sums.iter()
        .zip(weights)
        .map(|(s, w)| s / w.max(1e-9))
        .collect()
}

pub(crate) fn blur(values: &[f64], image: &Image, width: [f64; 2]) -> Vec<f64> {
    let kernel = |w: f64| -> Vec<f64> {
        let reach = (3.5 * w).ceil() as i32;
        (-reach..=reach)
            .map(|i| (-0.5 * (f64::from(i) / w).powi(2)).exp())
            .collect()
    };
    let (columns, rows) = (image.columns, image.rows);
    let mut along = vec![0.0; values.len()];
    let k = kernel(width[0]);
    let reach = k.len() / 2;
    along
        .par_chunks_mut(columns)
        .zip(values.par_chunks(columns))
        .for_each(|(out, line)| {
            interrupt::check();
            for (c, out) in out.iter_mut().enumerate() {
                let from = c.saturating_sub(reach);
                let part = &line[from..(c + reach + 1).min(columns)];
                *out = part
                    .iter()
                    .zip(&k[reach + from - c..])
                    .map(|(v, k)| v * k)
                    .sum();
            }
        });
    let k = kernel(width[1]);
    let reach = k.len() / 2;
    let mut out = vec![0.0; values.len()];
    out.par_chunks_mut(columns)
        .enumerate()
        .for_each(|(r, out)| {
            for other in r.saturating_sub(reach)..(r + reach + 1).min(rows) {
                let weight = k[reach + other - r];
                let line = &along[other * columns..(other + 1) * columns];
                out.iter_mut().zip(line).for_each(|(o, v)| *o += weight * v);
            }
        });
    out
}
