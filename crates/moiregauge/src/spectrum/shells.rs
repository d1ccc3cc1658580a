//! The shells of a hexagonal lattice: one table for all.

/// Fastest wave that is fitted, rad per pixel along each axis. Its mirror image at the limit of sampling, π, is a tenth of the
/// band away: in the smallest frame, of 16 pixels, more than a cycle.
pub(crate) const FASTEST: f64 = 0.9 * std::f64::consts::PI;

/// Harmonics (h, k) of the first five shells, one of each ± pair, near ones first, for a pair of waves at 60°: `|h K₁ + k K₂|²` is
/// `h² + hk + k²` in units of |K|², which is 1, 3, 4, 7 and 9.
pub(crate) const SHELLS: [[i32; 2]; 18] = [
    [1, 0],
    [0, 1],
    [-1, 1],
    [1, 1],
    [-1, 2],
    [-2, 1],
    [2, 0],
    [0, 2],
    [-2, 2],
    [2, 1],
    [1, 2],
    [-1, 3],
    [-2, 3],
    [-3, 2],
    [-3, 1],
    [3, 0],
    [0, 3],
    [-3, 3],
];
/// How many of [`SHELLS`] belong to the first 0 to 5 shells.
const UP_TO: [usize; 6] = [0, 3, 6, 9, 15, 18];

/// The harmonics of the first `count` shells.
pub(crate) const fn shells(count: usize) -> &'static [[i32; 2]] {
    SHELLS.split_at(UP_TO[count]).0
}

/// The harmonics of the first shell: K₁, K₂ and K₂ − K₁.
pub(crate) const FIRST_SHELL: [[i32; 2]; 3] = [SHELLS[0], SHELLS[1], SHELLS[2]];

#[cfg(test)]
mod tests {
    use super::*;

    /// Every pair ± of the first five shells stands there once, and the shells follow each other.
    #[test]
    fn the_table_is_complete() {
        let order = |[h, k]: [i32; 2]| h * h + h * k + k * k;
        let mut all = Vec::new();
        for h in -4..=4 {
            for k in -4..=4 {
                if (1..=9).contains(&order([h, k])) {
                    all.push([h, k]);
                }
            }
        }
        assert_eq!(all.len(), 2 * SHELLS.len());
        for [h, k] in all {
            assert_eq!(
                [[h, k], [-h, -k]]
                    .iter()
                    .filter(|i| SHELLS.contains(i))
                    .count(),
                1
            );
        }
        assert!(SHELLS.is_sorted_by_key(|i| order(*i)));
        for (count, last) in [(1, 1), (2, 3), (3, 4), (4, 7), (5, 9)] {
            assert_eq!(shells(count).last().map(|i| order(*i)), Some(last));
        }
    }
}
