//! How wide the window should be: as wide as the lattice stays straight.
//!
//! A Gaussian of width w averages the wave vectors over itself: bias `½ w² ∇²q`, noise `∝ 1/w²`. The widest
//! window is taken whose bias (root mean square over the frame) is at most a quarter of its noise. The bias is read
//! off the image: widening the window by √2 changes q by `½ w² ∇²q` and by noise whose size is known,
//! `c (1/a⁴ + 1/b⁴ − 8/(a² + b²)²)` for windows a and b of noise `c/a⁴`, `c/b⁴`.

use crate::numbers::median::median;

/// Bias over noise that is allowed: a quarter of σ adds 3 % to the error.
const ALLOWED: f64 = 0.25;
/// The narrowest window, in periods: neighbouring harmonics leak by 10⁻⁴.
pub(crate) const NARROWEST: f64 = 0.6;
/// The widest, in periods. On the scenes of docs/constants.md half and double change results by at most 0.53 σ.
pub(crate) const WIDEST: f64 = 5.0;
/// The widest as a share of the shorter side of the frame: margins of two windows leave three quarters of it.
const OF_FRAME: f64 = 1.0 / 16.0;

/// The windows to try, in periods, each √2 times the one before; `side` is the frame's, in periods.
pub(crate) fn ladder(side: f64) -> Vec<f64> {
    let widest = (OF_FRAME * side).clamp(NARROWEST, WIDEST);
    let steps = (0..40).map(|i| NARROWEST * std::f64::consts::SQRT_2.powi(i));
    steps.take_while(|w| *w <= widest * 1.0001).collect()
}

/// Correlation of white noise under a window a and under b = √2 a: `4 a² b²/(a² + b²)²`.
const CORRELATION: f64 = 8.0 / 9.0;
/// Variance of the difference of the two in white noise, in units of that of the narrow one: 1 + ¼ − 8/9.
pub(crate) const OF_DIFFERENCE: f64 = 1.25 - CORRELATION;
/// Where a defect is, changes beyond this many of these variances say nothing of the window: three standard
/// deviations.
const OUTLYING: f64 = 9.0;

/// Variance of the difference of a value under two windows from the variances under each. Offsets of lines are correlated
/// a little more than white noise (0.97 where a harmonic stands on their ridge), which makes this a little large.
pub(crate) fn of_difference(narrow: f64, wide: f64) -> f64 {
    narrow + wide - 2.0 * CORRELATION * (narrow * wide).sqrt()
}

/// Whether a window is narrow enough: `changes` are the squared changes by a window √2 wider over the variance that
/// noise gives them, for independent nodes and components.
///
/// Half a standard deviation of chance is allowed for, so that it does not make windows narrow where nodes are few.
pub(crate) fn is_straight(changes: &mut [f64]) -> bool {
    let typical = median(changes) / 0.454_936;
    let limit = OUTLYING * typical.max(1.0);
    let kept = changes.iter().filter(|c| **c < limit);
    let (sum, count) = kept.fold((0.0, 0.0f64), |(s, n), c| (s + c, n + 1.0));
    let chance = 0.5 * (2.0 / count.max(1.0)).sqrt();
    sum / count.max(1.0) <= 1.0 + ALLOWED * ALLOWED / OF_DIFFERENCE + chance
}
