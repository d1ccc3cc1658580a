//! Products of waves along a line, some bins at a time.

use std::array::from_fn;
use std::ops::Range;

use rustfft::num_complex::Complex64;

use crate::explain::normal::Sums;
use crate::explain::scene::Scene;

/// Bins along a line over which waves are stepped: ratios of third order are off by the rounding of phases, and so is a phase by its cube.
pub(crate) const STRETCH: usize = 32;

/// Values at the bins of a stretch.
pub(crate) type Lanes = [f64; STRETCH];

/// Adds the products of columns with each other and with values at the bins that are there, to the sums `to(block)`.
pub(crate) fn add(
    sums: &mut Sums,
    scene: &Scene,
    bins: Range<usize>,
    columns: &[Lanes],
    values: &[f64],
    to: impl Fn(usize) -> usize,
) {
    let mut row = vec![0.0; columns.len()];
    for (lane, (block, value)) in scene.block[bins].iter().zip(values).enumerate() {
        let Some(block) = *block else { continue };
        for (own, column) in row.iter_mut().zip(columns) {
            *own = column[lane];
        }
        sums.add(to(block), &row, *value);
    }
}

/// Takes the sum of columns, each times its weight, off the values.
#[inline]
pub(crate) fn take_off(columns: &[Lanes], weights: &[f64], values: &mut Lanes) {
    for (column, weight) in columns.iter().zip(weights) {
        let each = values.iter_mut().zip(column);
        each.for_each(|(value, column)| *value -= weight * column);
    }
}

/// Products of two waves, or of their conjugates where the sign is negative; of a sign of 0 the imaginary part counts as 0.
#[inline]
pub(crate) fn product(a: &[Lanes; 2], b: &[Lanes; 2], signs: [f64; 2]) -> [Lanes; 2] {
    let [s, t] = signs;
    [
        from_fn(|i| a[0][i] * b[0][i] - s * t * (a[1][i] * b[1][i])),
        from_fn(|i| t * (a[0][i] * b[1][i]) + s * (a[1][i] * b[0][i])),
    ]
}

/// A wave along a line whose phase is a cubic polynomial, from the phases of the first four bins: the value is stepped by its ratios of first, second
/// and third order from bin to bin.
pub(crate) fn step([a, b, c, d]: [f64; 4], lanes: &mut [Lanes; 2]) {
    let ratios = [a, b - a, c - 2.0 * b + a, d - 3.0 * c + 3.0 * b - a];
    let [mut value, mut first, mut second, third] = ratios.map(Complex64::cis);
    let [re, im] = lanes;
    for (re, im) in re.iter_mut().zip(im) {
        (*re, *im) = (value.re, value.im);
        (value, first, second) = (value * first, first * second, second * third);
    }
}
