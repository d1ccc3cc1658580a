//! The waves of a lattice at one place: least squares under a window.
//!
//! `Σ g m |I − c₀ − Σ (c_i e^{iq_i·n} + c.c.)|²` over the pixels of a patch m. A window that an edge cuts off mixes the waves with
//! each other and with the background, by a tenth and more; the normal equations take that off.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::coverage::cells::Cells;
use crate::coverage::look::ones;
use crate::frame::image::Image;

/// The background and the two waves of each of three harmonics, as (h, k).
const BASIS: [[i32; 2]; 7] = [[0, 0], [1, 0], [0, 1], [-1, 1], [-1, 0], [0, -1], [1, -1]];
/// Noise is enlarged by no more than this where an edge is near: beyond, the waves cannot be told apart.
const MOST: f64 = 4.0;

/// Places that a thread solves at once, at least.
const AT_ONCE: usize = 64;

/// The envelopes of K₁, K₂ and K₂ − K₁ at a place, and the variance that white noise of unit power per pixel gives each.
pub(crate) struct Local {
    /// The middle of what the window sees, pixels: beside an edge that is not its own middle.
    pub(crate) at: Vector2<f64>,
    pub(crate) envelopes: [Complex64; 3],
    pub(crate) noise: [f64; 3],
}

/// The envelopes at some cells. `part`: the image with all missing that does not count; `width` of the window in mean
/// periods.
pub(crate) fn local(
    cells: &Cells,
    part: &Image,
    pair: &Matrix2<f64>,
    width: f64,
    at: &[usize],
) -> Vec<Option<Local>> {
    let cells = cells.of_part(part);
    let window = cells.window(width);
    let wave = |[h, k]: [i32; 2]| pair * Vector2::new(f64::from(h), f64::from(k));
    let places = (0..cells.len()).map(|cell| {
        let (at, count) = (cells.middle_of(cell), cells.counts()[cell]);
        Complex64::new(at.x, at.y) * count
    });
    let places = cells.summed_at(&places.collect::<Vec<_>>(), &window, at);
    let counts = cells.counts().iter().map(|n| Complex64::from(*n));
    let counts = cells.summed_at(&counts.collect::<Vec<_>>(), &window, at);
    let seen = |image: &Image, index: [i32; 2]| {
        cells.summed_at(&cells.mixed(image, wave(index)), &window, at)
    };
    let ones = ones(part);
    let of_ones = |index: [i32; 2]| match &ones {
        Some(ones) => seen(ones, index),
        None => cells.of_whole([part.columns, part.rows], wave(index), &window, at),
    };
    let data = [0, 1, 2, 3].map(|i| seen(part, BASIS[i]));
    let differences = differences();
    let which = which_of(&differences);
    let known: Vec<Vec<Complex64>> = differences.into_iter().map(of_ones).collect();
    let solve = |n: usize| {
        let gram = SMatrix::<Complex64, 7, 7>::from_fn(|a, b| {
            let (i, conjugate) = which[a][b];
            let value = known[i][n];
            if conjugate { value.conj() } else { value }
        });
        let right = SVector::<Complex64, 7>::from_fn(|a, _| match a {
            0..4 => data[a][n],
            _ => data[a - 3][n].conj(),
        });
        let inverse = gram.try_inverse()?;
        let solution = inverse * right;
        let larger = [1, 2, 3].map(|a| (inverse[(a, a)] * gram[(0, 0)]).re);
        let usable = larger.iter().all(|l| *l > 0.0 && *l < MOST);
        let middle = places[n] / counts[n].re;
        usable.then(|| Local {
            at: Vector2::new(middle.re, middle.im),
            envelopes: [1, 2, 3].map(|a| solution[a]),
            noise: larger.map(|l| l * window.noise[at[n]]),
        })
    };
    (0..at.len())
        .into_par_iter()
        .with_min_len(AT_ONCE)
        .map(solve)
        .collect()
}

/// Each difference of two of the basis, one of ± each.
fn differences() -> Vec<[i32; 2]> {
    let mut known: Vec<[i32; 2]> = Vec::new();
    for a in BASIS {
        for b in BASIS {
            let d = [a[0] - b[0], a[1] - b[1]];
            if !known.iter().any(|k| *k == d || *k == [-d[0], -d[1]]) {
                known.push(d);
            }
        }
    }
    known
}

/// For each pair of the basis: which difference, and whether its conjugate.
fn which_of(differences: &[[i32; 2]]) -> [[(usize, bool); 7]; 7] {
    BASIS.map(|a| {
        BASIS.map(|b| {
            let d = [a[0] - b[0], a[1] - b[1]];
            let found = differences.iter().position(|k| *k == d);
            let opposite = || differences.iter().position(|k| *k == [-d[0], -d[1]]);
            (found.or_else(opposite).unwrap_or(0), found.is_none())
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three waves on a background, cut off by an edge: the envelopes beside the edge are theirs all the same.
    #[test]
    fn an_edge_does_not_mix_the_waves() {
        let pair = Matrix2::new(0.4, 0.2, 0.0, 0.35);
        let waves = [[1.0, 0.0], [0.0, 1.0], [-1.0, 1.0]].map(|[h, k]| pair * Vector2::new(h, k));
        let values = (0..100 * 120).map(|i| {
            let at = Vector2::new(f64::from(i % 120), f64::from(i / 120));
            if at.x < 61.0 {
                let of = |(i, q): (usize, &Vector2<f64>)| {
                    (1.0 + i as f64) * (q.dot(&at) + i as f64).cos()
                };
                5.0 + waves.iter().enumerate().map(of).sum::<f64>()
            } else {
                f64::NAN
            }
        });
        let image = Image::new(100, 120, values.collect());
        let cells = Cells::new(&image, &pair, [1.0, 1.0]).unwrap();
        let cell = 50 / cells.pixels[1] * cells.size[0] + 58 / cells.pixels[0];
        let found = local(&cells, &image, &pair, 0.8, &[cell]);
        let found = found[0].as_ref().unwrap();
        for (i, c) in found.envelopes.iter().enumerate() {
            let wanted = Complex64::from_polar(0.5 * (1.0 + i as f64), i as f64);
            assert!((c - wanted).norm() < 1e-6, "{i}: {c} {wanted}");
            assert!(found.noise[i] > 0.0);
        }
    }
}
