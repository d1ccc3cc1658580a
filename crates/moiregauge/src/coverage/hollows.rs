//! Where beside the waves of a lattice only noise is.

use nalgebra::{Matrix2, Vector2};

use crate::numbers::three::three;

/// Two places for each wave where noise stands and nothing else: of the same frequency along the lines, since the noise of a scan is a
/// function of time, and as far from all waves as can be.
pub(crate) fn hollows(pair: &Matrix2<f64>) -> [[Vector2<f64>; 2]; 3] {
    let inverse = pair.try_inverse().unwrap_or_else(Matrix2::zeros);
    let length = pair.determinant().abs().sqrt();
    let clearance = |q: &Vector2<f64>| {
        let index = (inverse * q).map(f64::floor);
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        let distances = corners.map(|[h, k]| (q - pair * (index + Vector2::new(h, k))).norm());
        distances.into_iter().fold(f64::INFINITY, f64::min)
    };
    three(pair).map(|wave| {
        [1.0, -1.0].map(|side| {
            let places =
                (5..=25).map(|i| wave + Vector2::y() * (side * 0.05 * f64::from(i) * length));
            let farthest = places.max_by(|a, b| clearance(a).total_cmp(&clearance(b)));
            farthest.unwrap_or(wave)
        })
    })
}
