//! Lattices whose power is in their higher orders.
//!
//! In: an image and a pair that explains the peaks of its spectrum. Out: the harmonics of five shells and
//! the pair through those that stand out. A cell with many atoms in it, like Si(111)-7×7, scatters more
//! into the third to fifth shell than into the first one, which may be hidden in the noise. The lattice is
//! no less certain for that, as long as the harmonics that stand out make it: (1,1) and (2,−1) are a
//! lattice three times as dense, and of that one they are the first shell.

use nalgebra::{Matrix2, Vector2};

use crate::frame::background::Background;
use crate::frame::clip::cut_off;
use crate::frame::image::Image;
use crate::spectrum::harmonics::{Harmonics, Windowed};
use crate::spectrum::shells::{FIRST_SHELL, shells};

/// Significance that none of a few thousand frequencies reaches by chance: e⁻²⁰ each, 10⁻⁵ for all.
const STANDS_OUT: f64 = 20.0;
/// Significant harmonics that make a lattice whose first order may be suppressed. Chosen by eye; see
/// docs/constants.md.
const FEWEST: usize = 5;
/// Share of the power of a lattice that is left when outliers are cut off, at least: tip events vanish with them. On the scenes of docs/constants.md
/// half and double change no result.
const LEFT: f64 = 0.4;
/// Weights are capped: beyond, errors are no longer those of noise.
const MOST_WEIGHT: f64 = 1e3;

/// The harmonics of a lattice and its first three wave vectors; `None` where the higher orders do not
/// make it.
pub(crate) fn refine(
    image: &Image,
    pair: &Matrix2<f64>,
    background: Background,
) -> Option<(Harmonics, [Vector2<f64>; 3])> {
    let windowed = Windowed::new(image);
    let shells = by_rows();
    let first = windowed.fit(image, pair, background, &shells)?;
    let model = Windowed::new(&first.model(image, background));
    let mut chosen = Vec::new();
    let (mut normal, mut right) = (Matrix2::zeros(), Matrix2::zeros());
    for harmonic in &first.list {
        let significance = harmonic.significance(first.window_sums);
        if significance < STANDS_OUT {
            continue;
        }
        let index = (pair.try_inverse()? * harmonic.q).map(f64::round);
        let bias = model.refined_peak(harmonic.q) - harmonic.q;
        let seen = windowed.refined_peak(harmonic.q) - bias;
        let weight = significance.min(MOST_WEIGHT);
        normal += weight * index * index.transpose();
        right += weight * seen * index.transpose();
        chosen.push([index.x as i32, index.y as i32]);
    }
    if chosen.len() < FEWEST || !make_all(&chosen) {
        return None;
    }
    let pair = right * normal.try_inverse()?;
    let (k1, k2) = (pair.column(0).into_owned(), pair.column(1).into_owned());
    let harmonics = windowed.fit(image, &pair, background, &shells)?;
    // Tip events in step with the lines make such harmonics, too, which vanish with the outliers.
    let clipped = cut_off(image);
    let without = Windowed::new(&clipped).fit(&clipped, &pair, background, &shells)?;
    let power = |harmonics: &Harmonics| -> f64 {
        let each = harmonics.list.iter().map(|h| h.amplitude.norm_sqr());
        each.sum()
    };
    if power(&without) < LEFT * power(&harmonics) {
        return None;
    }
    Some((harmonics, [k1, k2, k2 - k1]))
}

/// The first five shells, the first one first and then by rows.
fn by_rows() -> Vec<[i32; 2]> {
    let mut all = shells(5).to_vec();
    all[FIRST_SHELL.len()..].sort_unstable_by_key(|[h, k]| [*k, *h]);
    all
}

/// Whether integer combinations of some indices make all: the determinants of all pairs have no common
/// divisor.
fn make_all(indices: &[[i32; 2]]) -> bool {
    let mut divisor = 0;
    for (i, a) in indices.iter().enumerate() {
        for b in &indices[i + 1..] {
            let (mut x, mut y) = (divisor, (a[0] * b[1] - a[1] * b[0]).abs());
            while y != 0 {
                (x, y) = (y, x % y);
            }
            divisor = x;
        }
    }
    divisor == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second shell alone makes a third of all points, the doubled first shell a quarter, one
    /// direction none; (2,1) and (3,−2) have the determinant −7, and with (1,−3) all.
    #[test]
    fn some_harmonics_make_a_denser_lattice() {
        assert!(make_all(&[[1, 0], [0, 1]]));
        assert!(!make_all(&[[1, 1], [-1, 2], [-2, 1]]));
        assert!(!make_all(&[[2, 0], [0, 2], [-2, 2]]));
        assert!(!make_all(&[[1, 2], [2, 4]]));
        assert!(!make_all(&[[2, 1], [3, -2]]));
        assert!(make_all(&[[2, 1], [3, -2], [3, 0]]));
    }
}
