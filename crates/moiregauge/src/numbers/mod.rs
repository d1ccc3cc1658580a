//! Small mathematics that every room needs: χ², the median, sums of products, least squares, normal equations, random numbers, words for numbers; the way out of
//! a calculation that nobody wants any more.

pub(crate) mod bits;
pub(crate) mod chi2;
pub(crate) mod dot;
pub(crate) mod exact;
pub mod interrupt;
pub(crate) mod least_squares;
pub(crate) mod median;
pub(crate) mod moving_median;
pub(crate) mod normal_equations;
pub(crate) mod rng;
pub(crate) mod splines;
pub(crate) mod spread;
pub(crate) mod three;
pub(crate) mod widest;
pub(crate) mod words;

/// Rounds of what ends when nothing moves any more, at most: such a loop takes a dozen. One that takes this many does not end. Chosen by eye.
pub(crate) const MOST_ROUNDS: usize = 80;

pub use rng::{normals, stream};
pub use widest::widest;
pub use words::{fixed, line_name, plus_minus, two_digits};
