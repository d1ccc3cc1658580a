//! A wave between the points of a lattice says that the true lattice of waves is finer.

use heterostrain::lattice::shortest_pair;
use nalgebra::{Matrix2, Vector2};

/// How many points of the finer lattice there may be for each of the lattice: the second shell of a hexagon has a third of
/// its points, every other row a half, double waves a quarter.
const FINER: [i32; 3] = [2, 3, 4];
/// A wave lies on a point that is nearer than this, cycles over the frame: two bins.
pub(crate) const ON: f64 = 1.0;

/// The coarsest lattice of waves that holds a pair and the wave `q` (all rad per pixel) in a frame of `size` pixels (columns, rows);
/// `None` where none does that is little finer, or where `q` lies on the pair's own.
pub(crate) fn finer(
    pair: &Matrix2<f64>,
    q: &Vector2<f64>,
    size: [usize; 2],
    to_physical: &Matrix2<f64>,
) -> Option<Matrix2<f64>> {
    if misses(pair, q, size)? < ON {
        return None;
    }
    FINER.into_iter().find_map(|n| {
        let all = (1..=n)
            .filter(|a| n % a == 0)
            .flat_map(|a| (0..n / a).map(move |b| (a, b)));
        let fits = all.filter_map(|(a, b)| {
            let change = Matrix2::new(f64::from(a), f64::from(b), 0.0, f64::from(n / a));
            let finer = pair * change.try_inverse()?;
            Some((misses(&finer, q, size)?, finer)).filter(|(miss, _)| *miss < ON)
        });
        let (_, finer) = fits.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(finer * shortest_pair(&(to_physical * finer))?)
    })
}

/// How far a wave `q` is from the nearest point of a lattice of waves, cycles over the frame.
pub(crate) fn misses(pair: &Matrix2<f64>, q: &Vector2<f64>, size: [usize; 2]) -> Option<f64> {
    let frame = Vector2::from(size.map(|n| n as f64)) / std::f64::consts::TAU;
    let index = pair.try_inverse()? * q;
    let off = pair * (index - index.map(f64::round));
    Some(off.component_mul(&frame).norm())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the second shell of a hexagon and one wave of (2,0), the hexagon; from a harmonic, nothing.
    #[test]
    fn the_second_shell_is_completed() {
        let hexagon = Matrix2::new(0.4, 0.2, 0.0, 0.35);
        let second = Matrix2::from_columns(&[
            hexagon * Vector2::new(1.0, 1.0),
            hexagon * Vector2::new(-1.0, 2.0),
        ]);
        let q = hexagon * Vector2::new(2.0, 0.0);
        let found = finer(&second, &q, [256, 256], &Matrix2::identity()).unwrap();
        let names = found.try_inverse().unwrap() * hexagon;
        assert!((names - names.map(f64::round)).amax() < 1e-9, "{names}");
        assert!((names.determinant().abs() - 1.0).abs() < 1e-9);
        let harmonic = second * Vector2::new(2.0, -1.0);
        assert_eq!(
            finer(&second, &harmonic, [256, 256], &Matrix2::identity()),
            None
        );
    }
}
