//! Normal equations whose parameters differ in unit: scaled to ones on the diagonal before they are factored.

use nalgebra::{DMatrix, DVector};

use crate::numbers::widest::widest;

/// A scaled and factored normal matrix.
pub(crate) struct NormalEquations {
    /// L of `L Lᵀ`; what is above its diagonal does not count.
    factor: DMatrix<f64>,
    scale: DVector<f64>,
}

impl NormalEquations {
    /// Factors `scale · normal · scale`, with `held` of each parameter added to its diagonal; `None` where parameters cannot
    /// be told apart.
    pub(crate) fn new(
        normal: &DMatrix<f64>,
        scale: DVector<f64>,
        held: impl Fn(usize) -> f64,
    ) -> Option<Self> {
        let scaled = DMatrix::from_fn(normal.nrows(), normal.ncols(), |i, j| {
            let held = if i == j { held(i) } else { 0.0 };
            normal[(i, j)] * scale[i] * scale[j] + held
        });
        let factor = factored(scaled)?;
        Some(Self { factor, scale })
    }

    /// One over the square root of what each parameter has on the diagonal; 1 for those that nothing sees.
    pub(crate) fn units(normal: &DMatrix<f64>) -> DVector<f64> {
        let diagonal = normal.diagonal();
        diagonal.map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 })
    }

    /// The parameters.
    pub(crate) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let mut scaled = right.component_mul(&self.scale);
        self.factor
            .solve_lower_triangular_unchecked_mut(&mut scaled);
        self.factor
            .tr_solve_lower_triangular_unchecked_mut(&mut scaled);
        scaled.component_mul(&self.scale)
    }

    /// The inverse of the normal matrix.
    pub(crate) fn inverse(&self) -> DMatrix<f64> {
        let size = self.scale.len();
        let mut inverse = DMatrix::identity(size, size);
        self.factor
            .solve_lower_triangular_unchecked_mut(&mut inverse);
        self.factor
            .tr_solve_lower_triangular_unchecked_mut(&mut inverse);
        DMatrix::from_fn(inverse.nrows(), inverse.ncols(), |i, j| {
            inverse[(i, j)] * self.scale[i] * self.scale[j]
        })
    }

    /// The least share of any parameter that those before it leave open.
    pub(crate) fn least_pivot(&self) -> f64 {
        let pivots = self.factor.diagonal();
        pivots.iter().map(|d| d * d).fold(f64::INFINITY, f64::min)
    }
}

/// L of `L Lᵀ`, column by column; `None` where the matrix is not positive.
fn factored(mut matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let size = matrix.nrows();
    for j in 0..size {
        let (before, column) = matrix.as_mut_slice().split_at_mut(j * size);
        let column = &mut column[j..size];
        take_off(column, before, size, j);
        let diagonal = column[0];
        if !(diagonal > 0.0) {
            return None;
        }
        let root = diagonal.sqrt();
        column[0] = root;
        for below in &mut column[1..] {
            *below /= root;
        }
    }
    Some(matrix)
}

/// Takes the finished columns off the part of column `j` from its diagonal on, one after the other, four in one go.
fn take_off(column: &mut [f64], before: &[f64], size: usize, j: usize) {
    let below = |k: usize| &before[k * size + j..(k + 1) * size];
    let fours = j / 4;
    widest(
        #[inline(always)]
        || {
            for four in 0..fours {
                let [a, b, c, d] = [0, 1, 2, 3].map(|i| below(4 * four + i));
                let [p, q, r, s] = [a[0], b[0], c[0], d[0]];
                let all = column.iter_mut().zip(a).zip(b).zip(c).zip(d);
                for ((((x, a), b), c), d) in all {
                    *x = *x - p * a - q * b - r * c - s * d;
                }
            }
            for k in 4 * fours..j {
                let finished = below(k);
                let factor = finished[0];
                for (x, y) in column.iter_mut().zip(finished) {
                    *x -= factor * y;
                }
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parameters whose units differ by 10¹⁰: the inverse is that of the matrix, and what nothing sees is held.
    #[test]
    fn units_do_not_matter() {
        let units = DVector::from_vec(vec![1e-5, 1e5, 1.0]);
        let plain = DMatrix::from_row_slice(3, 3, &[4.0, 1.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 0.0]);
        let normal = DMatrix::from_fn(3, 3, |i, j| plain[(i, j)] * units[i] * units[j]);
        let held = |i: usize| if normal[(i, i)] == 0.0 { 1.0 } else { 0.0 };
        let scaled = NormalEquations::new(&normal, NormalEquations::units(&normal), held).unwrap();
        let expected = [[3.0, -1.0], [-1.0, 4.0]].map(|row| row.map(|x| x / 11.0));
        for (i, j) in [(0, 0), (0, 1), (1, 1)] {
            let found = scaled.inverse()[(i, j)] * units[i] * units[j];
            assert!((found - expected[i][j]).abs() < 1e-12, "{found}");
        }
        let right = DVector::from_vec(vec![11e-5, 0.0, 0.0]);
        let found = scaled.solve(&right).component_mul(&units);
        assert!(
            (found[0] - 3.0).abs() < 1e-12 && (found[1] + 1.0).abs() < 1e-12,
            "{found}"
        );
        assert!((scaled.least_pivot() - 11.0 / 12.0).abs() < 1e-12);
    }
}
