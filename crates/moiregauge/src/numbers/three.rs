//! The shortest vectors of a lattice.

use nalgebra::{Matrix2, Vector2};

/// Three of them by a pair at 60°: first, second, second − first. The others are their opposites.
pub(crate) fn three(pair: &Matrix2<f64>) -> [Vector2<f64>; 3] {
    let (a, b) = (pair.column(0).into_owned(), pair.column(1).into_owned());
    [a, b, b - a]
}
