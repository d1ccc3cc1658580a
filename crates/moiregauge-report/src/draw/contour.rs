//! Contour lines on a grid of values: marching squares.

/// Segments (column, row) on which linear interpolation of the values has this level. Cells with a corner
/// that is not finite have none; of the two ways through a saddle the middle of the cell decides.
pub(crate) fn contours(
    values: &[f64],
    [columns, rows]: [usize; 2],
    level: f64,
) -> Vec<[[f64; 2]; 2]> {
    let mut out = Vec::new();
    for row in 0..rows.saturating_sub(1) {
        for column in 0..columns.saturating_sub(1) {
            // Counter-clockwise from the lower left.
            let at = [[0, 0], [1, 0], [1, 1], [0, 1]];
            let v = at.map(|[c, r]| values[(row + r) * columns + column + c] - level);
            if !v.iter().all(|x| x.is_finite()) {
                continue;
            }
            let crossing = |i: usize| {
                let j = (i + 1) % 4;
                let share = v[i] / (v[i] - v[j]);
                let along = |axis: usize| {
                    let (from, to) = (at[i][axis] as f64, at[j][axis] as f64);
                    from + share * (to - from)
                };
                [column as f64 + along(0), row as f64 + along(1)]
            };
            let crossed: Vec<usize> = (0..4)
                .filter(|&i| (v[i] > 0.0) != (v[(i + 1) % 4] > 0.0))
                .collect();
            match crossed[..] {
                [a, b] => out.push([crossing(a), crossing(b)]),
                [a, b, c, d] => {
                    let middle = v.iter().sum::<f64>() > 0.0;
                    // Corner 0 lies between sides 3 and 0.
                    let pairs = if middle == (v[0] > 0.0) {
                        [[a, b], [c, d]]
                    } else {
                        [[d, a], [b, c]]
                    };
                    out.extend(pairs.map(|p| p.map(crossing)));
                }
                _ => {}
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::contours;

    /// The contour of x + 2y is that straight line, and as long as it is within the grid.
    #[test]
    fn a_plane_has_straight_contours() {
        let values: Vec<f64> = (0..20)
            .map(|i| f64::from(i % 5) + 2.0 * f64::from(i / 5))
            .collect();
        let found = contours(&values, [5, 4], 4.5);
        let mut length = 0.0;
        for [a, b] in found {
            for [x, y] in [a, b] {
                assert!((x + 2.0 * y - 4.5).abs() < 1e-12);
            }
            length += (a[0] - b[0]).hypot(a[1] - b[1]);
        }
        // From (0, 2.25) to (4, 0.25).
        assert!((length - 4.0f64.hypot(2.0)).abs() < 1e-12, "{length}");
    }

    /// A circle is closed: every end is that of two segments; beside a gap there is nothing.
    #[test]
    fn circles_close() {
        let n = 21;
        let at = |i: usize| ((i % n) as f64 - 10.0, (i / n) as f64 - 10.0);
        let mut values: Vec<f64> = (0..n * n).map(|i| at(i).0.hypot(at(i).1)).collect();
        let found = contours(&values, [n, n], 6.3);
        let ends: Vec<[f64; 2]> = found.iter().flatten().copied().collect();
        for end in &ends {
            let same = ends
                .iter()
                .filter(|e| (e[0] - end[0]).hypot(e[1] - end[1]) < 1e-9);
            assert_eq!(same.count(), 2);
        }
        values.fill(f64::NAN);
        assert!(contours(&values, [n, n], 6.3).is_empty());
    }
}
