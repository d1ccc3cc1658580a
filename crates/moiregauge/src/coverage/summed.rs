//! Sums under a window.

use std::ops::{AddAssign, Mul};

use rayon::prelude::*;

use crate::numbers::widest::widest;

/// Cells that a thread takes at once, at least: fewer are not worth handing out.
pub(crate) const FEWEST: usize = 4096;

/// What is summed under a window: numbers, or some of them together.
pub(crate) trait Summed:
    Copy + Default + Send + Sync + AddAssign + Mul<f64, Output = Self>
{
}

impl<T: Copy + Default + Send + Sync + AddAssign + Mul<f64, Output = T>> Summed for T {}

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

/// The sum of some lines of cells, of which there are `up`, under a window at one of them.
pub(crate) fn across_lines<T: Summed>(
    values: &[T],
    at: usize,
    up: usize,
    taps: &[f64],
    sum: &mut [T],
) {
    let reach = taps.len() / 2;
    for other in at.saturating_sub(reach)..=(at + reach).min(up - 1) {
        let line = &values[other * sum.len()..][..sum.len()];
        add(sum, line, taps[other + reach - at]);
    }
}

/// Convolution of the values of `[across, up]` cells with the taps along rows, then along columns.
pub(crate) fn smoothed<T: Summed>(
    [across, up]: [usize; 2],
    values: &[T],
    taps: &[Vec<f64>; 2],
) -> Vec<T> {
    let reach = taps[0].len() / 2;
    let mut out = vec![T::default(); values.len()];
    let all = out.par_chunks_exact_mut(across).enumerate();
    let all = all.with_min_len(FEWEST.div_ceil(across));
    all.for_each_init(
        || vec![T::default(); across],
        |line, (y, out)| {
            line.fill(T::default());
            across_lines(values, y, up, &taps[1], line);
            for (i, tap) in taps[0].iter().enumerate() {
                // Values at x + i − reach.
                let (before, after) = (reach.saturating_sub(i), i.saturating_sub(reach));
                if before.max(after) < across {
                    let target = &mut out[before..across - after];
                    add(target, &line[after..across - before], *tap);
                }
            }
        },
    );
    out
}
