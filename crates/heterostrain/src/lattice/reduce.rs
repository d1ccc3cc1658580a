//! Small algebra of reciprocal lattices: reduction, labelling, real ↔ reciprocal.

use nalgebra::{Matrix2, Vector2};

use crate::lattice::blocks::TURN;
use crate::lattice::vectors::{Lattice, Pair};

/// The integer change of basis that turns a pair into its shortest one, about 60° apart, second
/// counter-clockwise of the first (Lagrange–Gauss reduction). `None` for parallel vectors.
pub fn shortest_pair(basis: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    if !(basis.determinant().abs() > 1e-9 * basis.column(0).norm() * basis.column(1).norm()) {
        return None;
    }
    let mut change = Matrix2::identity();
    for _ in 0..64 {
        let b = basis * change;
        let (u, v) = (b.column(0), b.column(1));
        if u.norm_squared() > v.norm_squared() {
            change.swap_columns(0, 1);
            continue;
        }
        let steps = (u.dot(&v) / u.norm_squared()).round();
        if steps == 0.0 {
            break;
        }
        let first = change.column(0).into_owned();
        let second = change.column(1) - first * steps;
        change.set_column(1, &second);
    }
    // Reduced pairs stand at 60° to 120°: take the acute one, counter-clockwise.
    let b = basis * change;
    if b.column(0).dot(&b.column(1)) < 0.0 {
        change.column_mut(1).neg_mut();
    }
    if (basis * change).determinant() < 0.0 {
        change.swap_columns(0, 1);
    }
    Some(change)
}

/// How far a pair at 60° is from a hexagon: `|q|/|p|` of `K_j = p e_j + q ē_j`, 0 for a perfect one.
///
/// physics of the split: rotation and size live in p, two-fold distortion in q.
pub fn distortion(pair: &Matrix2<f64>) -> f64 {
    let hexagon = Matrix2::new(1.0, 0.5, 0.0, 0.75_f64.sqrt());
    let Some(inverse) = hexagon.try_inverse() else {
        return f64::INFINITY;
    };
    let m = pair * inverse;
    let p = Vector2::new(m[(0, 0)] + m[(1, 1)], m[(1, 0)] - m[(0, 1)]).norm();
    let q = Vector2::new(m[(0, 0)] - m[(1, 1)], m[(1, 0)] + m[(0, 1)]).norm();
    q / p
}

/// All changes of basis `U` with entries from −`largest` to `largest` and determinant ±1: `basis · U` is the same lattice
/// under another name, mirror images included.
pub fn renamings(largest: i32) -> impl Iterator<Item = Matrix2<f64>> {
    let entries = 2 * largest + 1;
    let entry =
        move |code: i32, power: u32| f64::from(code / entries.pow(power) % entries - largest);
    (0..entries.pow(4))
        .map(move |code| Matrix2::from_fn(|i, j| entry(code, 2 * i as u32 + j as u32)))
        .filter(|change| change.determinant().abs() == 1.0)
}

/// The [`renamings`] of the same handedness.
pub fn same_handed(largest: i32) -> impl Iterator<Item = Matrix2<f64>> {
    renamings(largest).filter(|change| change.determinant() == 1.0)
}

/// `pair` in the labelling (same lattice, same handedness) closest to `reference`.
pub fn labelled_like<Space: Copy, Unit: Copy>(
    pair: &Pair<Space, Unit>,
    reference: &Matrix2<f64>,
) -> Pair<Space, Unit> {
    let distance = |change: &Matrix2<f64>| (pair.basis * change - reference).norm();
    let nearest = same_handed(1).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.map_or(*pair, |change| pair.relabelled(&change))
}

/// The labelling whose first vector has its polar angle in [0°, 60°): a start for a series, all
/// further lattices being labelled like the first.
pub fn canonical<Unit: Copy>(lattice: &Lattice<Unit>) -> Lattice<Unit> {
    let mut current = *lattice;
    for _ in 0..6 {
        let angle = current.polar_angle(0).value;
        if (0.0..std::f64::consts::FRAC_PI_3).contains(&angle) {
            return current;
        }
        current = current.relabelled(&TURN);
    }
    // A distorted hexagon can have no vector there: the one nearest to 30° then.
    (0..6).fold(*lattice, |best, _| {
        current = current.relabelled(&TURN);
        let off = |l: &Lattice<Unit>| (l.polar_angle(0).value - std::f64::consts::FRAC_PI_6).abs();
        if off(&current) < off(&best) {
            current
        } else {
            best
        }
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;

    use super::*;
    use crate::lattice::vectors::{Nm, Waves};

    fn pair(a: [f64; 2], b: [f64; 2]) -> Matrix2<f64> {
        Matrix2::new(a[0], b[0], a[1], b[1])
    }

    /// Any primitive pair of a lattice reduces to the same six shortest vectors.
    #[test]
    fn reduction_finds_the_shortest_vectors() {
        let hexagon = pair([3.0, 0.2], [1.4, 2.7]);
        for u in [
            [1.0, 0.0, 0.0, 1.0],
            [2.0, 5.0, 1.0, 3.0],
            [7.0, -3.0, -2.0, 1.0],
        ] {
            let skewed = hexagon * Matrix2::new(u[0], u[1], u[2], u[3]);
            let reduced = skewed * shortest_pair(&skewed).unwrap();
            assert!(reduced.determinant() > 0.0);
            let (a, b) = (reduced.column(0), reduced.column(1));
            assert!(a.dot(&b) > 0.0);
            let mut lengths = [a.norm(), b.norm(), (b - a).norm()];
            lengths.sort_by(f64::total_cmp);
            // Lengths of (3, 0.2), (1.4, 2.7) and their difference (−1.6, 2.5).
            let expected = [9.04f64.sqrt(), 9.25f64.sqrt(), 8.81f64.sqrt()];
            for e in expected {
                assert!(lengths.iter().any(|l| (l - e).abs() < 1e-12), "{lengths:?}");
            }
        }
        assert!(shortest_pair(&pair([1.0, 2.0], [2.0, 4.0])).is_none());
    }

    /// Real → reciprocal → real is the identity up to labelling, and the covariance follows a
    /// numerical derivative.
    #[test]
    fn real_and_reciprocal_are_inverse() {
        let k = Waves::<Nm>::new(
            pair([0.5, 0.05], [0.2, 0.47]),
            Matrix4::from_diagonal(&[1.0, 2.0, 3.0, 4.0].into()) * 1e-8,
        );
        let real = k.lattice().unwrap();
        let back = labelled_like(&real.waves().unwrap(), &k.basis);
        assert!((back.basis - k.basis).norm() < 1e-12);
        assert!((back.covariance - k.covariance).norm() < 1e-6 * k.covariance.norm());
        let mut jacobian = Matrix4::zeros();
        for i in 0..4 {
            let mut moved = k;
            moved.basis[i] += 1e-7;
            let d = (moved.lattice().unwrap().basis - real.basis) / 1e-7;
            jacobian.column_mut(i).copy_from_slice(d.as_slice());
        }
        let numerical = jacobian * k.covariance * jacobian.transpose();
        assert!((numerical - real.covariance).norm() < 1e-4 * real.covariance.norm());
    }

    /// The perfect hexagon has no distortion; a uniaxial stretch by s has (s − 1)/(s + 1).
    #[test]
    fn distortion_of_a_stretched_hexagon() {
        let hexagon = pair([1.0, 0.0], [0.5, 0.75f64.sqrt()]);
        assert!(distortion(&hexagon) < 1e-15);
        let stretched = Matrix2::new(1.2, 0.0, 0.0, 1.0) * hexagon;
        assert!((distortion(&stretched) - 0.2 / 2.2).abs() < 1e-12);
    }
}
