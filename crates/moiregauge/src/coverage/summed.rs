//! Sums under a window.

use std::ops::{AddAssign, Mul};

use nalgebra::SVector;
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::numbers::widest::widest;

/// Cells that a thread takes at once, at least: fewer are not worth handing out.
pub(crate) const FEWEST: usize = 4096;

/// What is summed under a window: numbers, or some of them together.
pub(crate) trait Summed:
    Copy + Default + Send + Sync + AddAssign + Mul<f64, Output = Self>
{
}

impl<T: Copy + Default + Send + Sync + AddAssign + Mul<f64, Output = T>> Summed for T {}

/// Nine complex numbers.
pub(crate) type Nine = SVector<f64, 18>;

/// What is in nine lists, all of one place together.
pub(crate) fn together(lists: [&[Complex64]; 9]) -> Vec<Nine> {
    let mut together = vec![Nine::zeros(); lists[0].len()];
    for (n, list) in lists.into_iter().enumerate() {
        for (all, value) in together.iter_mut().zip(list) {
            (all[2 * n], all[2 * n + 1]) = (value.re, value.im);
        }
    }
    together
}

/// Adds values times a tap.
fn add<T: Summed>(sums: &mut [T], values: &[T], tap: f64) {
    widest(
        #[inline(always)]
        || {
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum += *value * tap;
            }
        },
    );
}

/// The sum under a window at one of `count` values in a line.
pub(crate) fn under<T: Summed>(
    taps: &[f64],
    at: usize,
    count: usize,
    value: impl Fn(usize) -> T,
) -> T {
    let reach = taps.len() / 2;
    let under = at.saturating_sub(reach)..(at + reach + 1).min(count);
    let taps = &taps[under.start + reach - at..];
    widest(
        #[inline(always)]
        || {
            let mut sum = T::default();
            for (other, tap) in under.zip(taps) {
                sum += value(other) * *tap;
            }
            sum
        },
    )
}

/// Convolution of the values of `[across, up]` cells with the taps along columns, then along rows.
pub(crate) fn smoothed<T: Summed>(
    [across, up]: [usize; 2],
    values: &[T],
    taps: &[Vec<f64>; 2],
) -> Vec<T> {
    let at_once = FEWEST.div_ceil(across);
    let mut lines = vec![T::default(); values.len()];
    let reach = taps[0].len() / 2;
    let all = values
        .par_chunks_exact(across)
        .zip(lines.par_chunks_exact_mut(across))
        .with_min_len(at_once);
    all.for_each(|(line, out)| {
        for (i, tap) in taps[0].iter().enumerate() {
            // Values at x + i − reach.
            let (before, after) = (reach.saturating_sub(i), i.saturating_sub(reach));
            if before.max(after) < across {
                add(
                    &mut out[before..across - after],
                    &line[after..across - before],
                    *tap,
                );
            }
        }
    });
    let mut out = vec![T::default(); values.len()];
    let reach = taps[1].len() / 2;
    let targets = out.par_chunks_exact_mut(across).with_min_len(at_once);
    targets.enumerate().for_each(|(y, target)| {
        for other in y.saturating_sub(reach)..=(y + reach).min(up - 1) {
            let line = &lines[other * across..][..across];
            add(target, line, taps[1][other + reach - y]);
        }
    });
    out
}
