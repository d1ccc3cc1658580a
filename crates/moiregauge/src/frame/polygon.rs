//! Polygons, as their corners in order; the last one is joined to the first.

use nalgebra::Vector2;

/// Its sides.
pub(crate) fn sides(
    corners: &[Vector2<f64>],
) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> {
    let next = corners.iter().cycle().skip(1);
    corners.iter().copied().zip(next.copied())
}

/// Area, in the square of the unit of the corners.
pub(crate) fn area(corners: &[Vector2<f64>]) -> f64 {
    let twice: f64 = sides(corners).map(|(a, b)| a.perp(&b)).sum();
    (twice / 2.0).abs()
}

/// Whether a place lies within, by the even-odd rule.
pub(crate) fn contains(corners: &[Vector2<f64>], place: Vector2<f64>) -> bool {
    let crossings = sides(corners).filter(|(a, b)| {
        (a.y > place.y) != (b.y > place.y)
            && place.x < a.x + (place.y - a.y) / (b.y - a.y) * (b.x - a.x)
    });
    crossings.count() % 2 == 1
}
