//! Normal equations whose parameters differ in unit: scaled to ones on the diagonal before they are factored.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A scaled and factored normal matrix.
pub(crate) struct NormalEquations {
    factor: Cholesky<f64, Dyn>,
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
        let factor = scaled.cholesky()?;
        Some(Self { factor, scale })
    }

    /// One over the square root of what each parameter has on the diagonal; 1 for those that nothing sees.
    pub(crate) fn units(normal: &DMatrix<f64>) -> DVector<f64> {
        let diagonal = normal.diagonal();
        diagonal.map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 })
    }

    /// The parameters.
    pub(crate) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let scaled = self.factor.solve(&right.component_mul(&self.scale));
        scaled.component_mul(&self.scale)
    }

    /// The inverse of the normal matrix.
    pub(crate) fn inverse(&self) -> DMatrix<f64> {
        let inverse = self.factor.inverse();
        DMatrix::from_fn(inverse.nrows(), inverse.ncols(), |i, j| {
            inverse[(i, j)] * self.scale[i] * self.scale[j]
        })
    }

    /// The least share of any parameter that those before it leave open.
    pub(crate) fn least_pivot(&self) -> f64 {
        let pivots = self.factor.l_dirty().diagonal();
        pivots.iter().map(|d| d * d).fold(f64::INFINITY, f64::min)
    }
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
