//! Normal equations of many scans, each summed by itself from whitened residuals, and what is left of one without its clock.
//!
//! No scan sees the clock of another one, so that a sum for each scan, by its local parameters
//! ([`shape`](crate::drift::joint::shape)), holds all there is, and each clock is eliminated by a division.

use nalgebra::{DMatrix, DVector};

use crate::drift::joint::shape::Shape;

/// Normal equations of all scans.
#[derive(Clone)]
pub(crate) struct ScanSums {
    pub(crate) shape: Shape,
    /// `XᵀX` of each scan by its local parameters; the lower triangle counts.
    normal: Vec<DMatrix<f64>>,
    /// `Xᵀe` of each scan.
    right: Vec<DVector<f64>>,
    /// `eᵀe` of all.
    pub(crate) squares: f64,
    /// Residuals of all.
    pub(crate) rows: usize,
}

impl ScanSums {
    pub(crate) fn new(shape: &Shape) -> Self {
        let (scans, width) = (shape.blocks.len(), shape.width());
        Self {
            shape: shape.clone(),
            normal: vec![DMatrix::zeros(width, width); scans],
            right: vec![DVector::zeros(width); scans],
            squares: 0.0,
            rows: 0,
        }
    }

    /// Adds whitened residuals of a scan with their derivatives by its local parameters, `N` rows.
    pub(crate) fn add<const N: usize>(&mut self, scan: usize, rows: &Whitened<N>) {
        let (normal, right) = (&mut self.normal[scan], &mut self.right[scan]);
        for k in 0..rows.slopes.ncols() {
            let column = rows.slopes.column(k);
            if column.iter().all(|x| *x == 0.0) {
                continue;
            }
            for j in k..rows.slopes.ncols() {
                normal[(j, k)] += rows.slopes.column(j).dot(&column);
            }
            right[k] += column.dot(&rows.residuals);
        }
        self.squares += rows.residuals.norm_squared();
        self.rows += N;
    }

    /// Adds what is known of the clock of a scan: a residual and its slope.
    pub(crate) fn add_clock(&mut self, scan: usize, residual: f64, slope: f64) {
        let clock = self.shape.width() - 1;
        self.normal[scan][(clock, clock)] += slope * slope;
        self.right[scan][clock] += slope * residual;
        self.squares += residual * residual;
        self.rows += 1;
    }

    /// The diagonal of the whole normal matrix.
    pub(crate) fn diagonal(&self) -> DVector<f64> {
        let mut all = DVector::zeros(self.shape.size());
        for (scan, normal) in self.normal.iter().enumerate() {
            self.shape.scatter(scan, &normal.diagonal(), &mut all);
        }
        all
    }

    /// The right-hand side of the whole.
    pub(crate) fn right(&self) -> DVector<f64> {
        let mut all = DVector::zeros(self.shape.size());
        for (scan, right) in self.right.iter().enumerate() {
            self.shape.scatter(scan, right, &mut all);
        }
        all
    }

    /// The whole matrix where no scan has parameters of its own.
    pub(crate) fn shared(&self) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(self.shape.shared, self.shape.shared);
        for normal in &self.normal {
            all += normal.view((0, 0), all.shape());
        }
        all.fill_upper_triangle_with_lower_triangle();
        all
    }

    /// Scans without their clocks, one after the other: `(XᵀX, Xᵀe)` by the rest of their local parameters. `None` where nothing
    /// determines a clock.
    pub(crate) fn without_clocks(
        &self,
        held: &DVector<f64>,
    ) -> impl Iterator<Item = Option<(DMatrix<f64>, DVector<f64>)>> {
        let right = self.right.iter();
        let all = self.normal.iter().zip(right).enumerate();
        all.map(|(scan, (normal, right))| {
            let n = self.shape.without_clock();
            let mut reduced = normal.view((0, 0), (n, n)).into_owned();
            let mut side = right.rows(0, n).into_owned();
            if self.shape.has_clocks() {
                let clock = self.clock(scan, held)?;
                clock.take_off(&mut reduced);
                side.axpy(-right[n], &clock.gain, 1.0);
            }
            Some((reduced, side))
        })
    }

    /// The clock of a scan that has one; `None` where nothing determines it.
    pub(super) fn clock(&self, scan: usize, held: &DVector<f64>) -> Option<Clock> {
        let n = self.shape.without_clock();
        let normal = &self.normal[scan];
        let pivot = normal[(n, n)] + held[self.shape.clocks_at() + scan];
        let gain = normal.view((n, 0), (1, n)).transpose() / pivot;
        let gain = DVector::from_column_slice(gain.as_slice());
        (pivot > 0.0).then_some(Clock { pivot, gain })
    }
}

/// Whitened residuals and their derivatives by the local parameters of a scan.
pub(crate) struct Whitened<const N: usize> {
    pub(crate) residuals: nalgebra::SVector<f64, N>,
    pub(crate) slopes: nalgebra::OMatrix<f64, nalgebra::Const<N>, nalgebra::Dyn>,
}

/// An eliminated clock: what it has on the diagonal, and by how much it follows the other local parameters.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    pub(super) pivot: f64,
    pub(super) gain: DVector<f64>,
}

impl Clock {
    /// Takes what the clock takes up off the matrix of the other parameters.
    fn take_off(&self, reduced: &mut DMatrix<f64>) {
        for k in 0..self.gain.len() {
            let factor = self.gain[k] * self.pivot;
            if factor != 0.0 {
                for j in k..self.gain.len() {
                    reduced[(j, k)] -= self.gain[j] * factor;
                }
            }
        }
    }
}
