//! Normal equations of many scans, solved scan by scan.
//!
//! The clock of a scan is seen by that scan alone, the phases of a block by the scans of that block, and lattice, drift and
//! the rest by all: the normal matrix has the shape of an arrow. Clocks are eliminated first, then the phases of the
//! blocks; what is left is a small matrix of the shared parameters. Time and memory are linear in the number of scans.
//!
//! A scan's own numbering of the parameters it sees ("local") is: the shared ones, the three phases of its block, its clock;
//! without phases the shared ones alone.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};

use crate::numbers::normal_equations::NormalEquations;

/// Phases of a block.
const PHASES: usize = 3;

/// Which scan sees which parameters.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    /// How many parameters all scans see; they are the first.
    pub(crate) shared: usize,
    /// The block of each scan.
    pub(crate) blocks: Vec<usize>,
    /// How many blocks have phases of their own; 0 without phases, and then there are no clocks.
    pub(crate) with_phases: usize,
}

impl Shape {
    /// All parameters: the shared ones, the phases of the blocks, the clocks.
    pub(crate) fn size(&self) -> usize {
        let clocks = if self.has_clocks() {
            self.blocks.len()
        } else {
            0
        };
        self.clocks_at() + clocks
    }

    /// The first phase of a block.
    pub(crate) fn phases_at(&self, block: usize) -> usize {
        self.shared + PHASES * block
    }

    /// The clock of the first scan.
    pub(crate) fn clocks_at(&self) -> usize {
        self.phases_at(self.with_phases)
    }

    /// Whether scans have phases and clocks.
    fn has_clocks(&self) -> bool {
        self.with_phases > 0
    }

    /// How many parameters a scan sees.
    pub(crate) fn width(&self) -> usize {
        self.without_clock() + usize::from(self.has_clocks())
    }

    /// How many of them are no clock.
    fn without_clock(&self) -> usize {
        if self.has_clocks() {
            self.shared + PHASES
        } else {
            self.shared
        }
    }

    /// Where a local parameter of a scan stands among all.
    pub(crate) fn place(&self, scan: usize, local: usize) -> usize {
        match local.checked_sub(self.shared) {
            None => local,
            Some(PHASES) => self.clocks_at() + scan,
            Some(phase) => self.phases_at(self.blocks[scan]) + phase,
        }
    }

    /// The local parameters of a scan.
    pub(crate) fn local(&self, scan: usize, all: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(self.width(), |i, _| all[self.place(scan, i)])
    }

    /// Adds what a scan has for its local parameters.
    pub(crate) fn scatter(&self, scan: usize, own: &DVector<f64>, all: &mut DVector<f64>) {
        for (i, value) in own.iter().enumerate() {
            all[self.place(scan, i)] += value;
        }
    }
}

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
    fn clock(&self, scan: usize, held: &DVector<f64>) -> Option<Clock> {
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
struct Clock {
    pivot: f64,
    gain: DVector<f64>,
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

/// The eliminated phases of a block: the inverse of their matrix, and how they follow the shared parameters.
#[derive(Clone, Debug)]
struct Block {
    inverse: Matrix3<f64>,
    gain: Matrix3xX<f64>,
}

impl Block {
    /// Eliminates the phases of a block from its matrix, whose lower triangle counts, and adds the rest to the shared one.
    fn new(normal: &DMatrix<f64>, held: &Vector3<f64>, shared: &mut DMatrix<f64>) -> Option<Self> {
        let n = shared.nrows();
        let own = normal.fixed_view::<PHASES, PHASES>(n, n);
        let inverse = (own + Matrix3::from_diagonal(held)).cholesky()?.inverse();
        let across = Matrix3xX::from_fn(n, |i, j| normal[(n + i, j)]);
        let gain = inverse * &across;
        *shared += normal.view((0, 0), (n, n)) - across.tr_mul(&gain);
        Some(Self { inverse, gain })
    }
}

/// Sums over the scans of blocks, their clocks taken off, and the shared parameters that solve them.
pub(crate) struct BlockSums<'a> {
    shape: &'a Shape,
    normal: Vec<DMatrix<f64>>,
    right: Vec<DVector<f64>>,
}

impl<'a> BlockSums<'a> {
    pub(crate) fn new(shape: &'a Shape) -> Self {
        let (blocks, n) = (shape.with_phases.max(1), shape.without_clock());
        Self {
            shape,
            normal: vec![DMatrix::zeros(n, n); blocks],
            right: vec![DVector::zeros(n); blocks],
        }
    }

    /// Adds a scan `times` times.
    pub(crate) fn add(&mut self, scan: usize, part: &(DMatrix<f64>, DVector<f64>), times: f64) {
        let block = if self.shape.has_clocks() {
            self.shape.blocks[scan]
        } else {
            0
        };
        self.normal[block].zip_apply(&part.0, |sum, x| *sum += times * x);
        self.right[block].axpy(times, &part.1, 1.0);
    }

    /// The matrix of the shared parameters and the blocks that were eliminated.
    fn eliminated(&self, held: &DVector<f64>) -> Option<(DMatrix<f64>, Vec<Block>)> {
        let n = self.shape.shared;
        let mut shared = DMatrix::from_diagonal(&held.rows(0, n).into_owned());
        if self.shape.with_phases == 0 {
            shared += &self.normal[0];
            return Some((shared, Vec::new()));
        }
        let mut blocks = Vec::with_capacity(self.normal.len());
        for (b, normal) in self.normal.iter().enumerate() {
            let held = held.fixed_rows::<PHASES>(self.shape.phases_at(b));
            blocks.push(Block::new(normal, &held.into_owned(), &mut shared)?);
        }
        Some((shared, blocks))
    }

    /// The shared parameters that solve the sums, with `held` of each parameter on the diagonal.
    pub(crate) fn solve_shared(&self, held: &DVector<f64>) -> Option<DVector<f64>> {
        let n = self.shape.shared;
        let (shared, blocks) = self.eliminated(held)?;
        let mut right = DVector::zeros(n);
        for (b, side) in self.right.iter().enumerate() {
            right += side.rows(0, n);
            if let Some(block) = blocks.get(b) {
                right -= block.gain.tr_mul(&side.fixed_rows::<PHASES>(n));
            }
        }
        Some(factored(shared)?.solve(&right))
    }
}

/// The matrix of shared parameters, of which the lower triangle counts, in a scale of its own.
fn factored(mut shared: DMatrix<f64>) -> Option<NormalEquations> {
    shared.fill_upper_triangle_with_lower_triangle();
    let units = NormalEquations::units(&shared);
    NormalEquations::new(&shared, units, |_| 0.0)
}

/// The inverse of a normal matrix in parts: any of its elements takes a few products.
#[derive(Clone, Debug)]
pub(crate) struct Arrow {
    shape: Shape,
    clocks: Vec<Clock>,
    blocks: Vec<Block>,
    /// The covariance of the shared parameters.
    pub(crate) shared: DMatrix<f64>,
}

impl Arrow {
    /// Eliminates scan by scan, with `held` of each parameter added to the diagonal; `None` where parameters cannot be
    /// told apart.
    pub(crate) fn new(sums: &ScanSums, held: &DVector<f64>) -> Option<Self> {
        let shape = &sums.shape;
        let mut of_blocks = BlockSums::new(shape);
        let mut clocks = Vec::new();
        for (scan, part) in sums.without_clocks(held).enumerate() {
            let part = part?;
            if shape.has_clocks() {
                clocks.push(sums.clock(scan, held)?);
            }
            of_blocks.add(scan, &part, 1.0);
        }
        let (shared, blocks) = of_blocks.eliminated(held)?;
        Some(Self {
            shape: shape.clone(),
            clocks,
            blocks,
            shared: factored(shared)?.inverse(),
        })
    }

    /// The parameters that solve the equations for a right-hand side.
    pub(crate) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let shape = &self.shape;
        let n = shape.shared;
        let mut rest = right.clone();
        for (scan, clock) in self.clocks.iter().enumerate() {
            let own = right[shape.clocks_at() + scan];
            if own != 0.0 {
                for (i, gain) in clock.gain.iter().enumerate() {
                    rest[shape.place(scan, i)] -= gain * own;
                }
            }
        }
        let mut side = rest.rows(0, n).into_owned();
        for (b, block) in self.blocks.iter().enumerate() {
            let own = rest.fixed_rows::<PHASES>(shape.phases_at(b));
            side -= block.gain.tr_mul(&own);
        }
        let shared = &self.shared * side;
        let mut found = DVector::zeros(shape.size());
        found.rows_mut(0, n).copy_from(&shared);
        for (b, block) in self.blocks.iter().enumerate() {
            let at = shape.phases_at(b);
            let own = block.inverse * rest.fixed_rows::<PHASES>(at) - &block.gain * &shared;
            found.fixed_rows_mut::<PHASES>(at).copy_from(&own);
        }
        for (scan, clock) in self.clocks.iter().enumerate() {
            let at = shape.clocks_at() + scan;
            let gains = clock.gain.iter().enumerate();
            let followed: f64 = gains
                .map(|(i, gain)| gain * found[shape.place(scan, i)])
                .sum();
            found[at] = right[at] / clock.pivot - followed;
        }
        found
    }

    /// The covariance of the local parameters of the scans of a block, the clock left free.
    fn of_block(&self, block: usize) -> DMatrix<f64> {
        let (n, width) = (self.shape.shared, self.shape.width());
        let mut all = DMatrix::zeros(width, width);
        all.view_mut((0, 0), (n, n)).copy_from(&self.shared);
        let Some(block) = self.blocks.get(block) else {
            return all;
        };
        let across = -(&block.gain * &self.shared);
        let own = block.inverse - &across * block.gain.transpose();
        all.view_mut((n, 0), (PHASES, n)).copy_from(&across);
        all.view_mut((0, n), (n, PHASES))
            .copy_from(&across.transpose());
        all.view_mut((n, n), (PHASES, PHASES)).copy_from(&own);
        all
    }

    /// The covariance of the local parameters of a scan.
    pub(crate) fn local(&self, scan: usize) -> DMatrix<f64> {
        let all = self.of_block(self.shape.blocks[scan]);
        self.with_clock(scan, all)
    }

    /// The covariance of a block with that of the clock of a scan.
    fn with_clock(&self, scan: usize, mut all: DMatrix<f64>) -> DMatrix<f64> {
        let Some(clock) = self.clocks.get(scan) else {
            return all;
        };
        let known = clock.gain.len();
        let across = -(all.view((0, 0), (known, known)) * &clock.gain);
        all[(known, known)] = 1.0 / clock.pivot - across.dot(&clock.gain);
        all.view_mut((0, known), (known, 1)).copy_from(&across);
        all.view_mut((known, 0), (1, known))
            .copy_from(&across.transpose());
        all
    }

    /// The covariance of the local parameters of every scan.
    pub(crate) fn locals(&self) -> Vec<DMatrix<f64>> {
        let of_blocks = self.of_blocks();
        let scans = self.shape.blocks.iter().enumerate();
        scans
            .map(|(scan, block)| self.with_clock(scan, of_blocks[*block].clone()))
            .collect()
    }

    /// The covariance of the local parameters of the scans of each block, the clocks left free.
    fn of_blocks(&self) -> Vec<DMatrix<f64>> {
        let blocks = 1 + self.shape.blocks.iter().max().unwrap_or(&0);
        (0..blocks).map(|block| self.of_block(block)).collect()
    }

    /// The variances of all parameters.
    pub(crate) fn variances(&self) -> DVector<f64> {
        let mut all = DVector::zeros(self.shape.size());
        let of_blocks = self.of_blocks();
        for (scan, block) in self.shape.blocks.iter().enumerate() {
            let own = &of_blocks[*block];
            for i in 0..self.shape.without_clock() {
                all[self.shape.place(scan, i)] = own[(i, i)];
            }
            if let Some(Clock { pivot, gain }) = self.clocks.get(scan) {
                let known = own.view((0, 0), (gain.len(), gain.len()));
                all[self.shape.clocks_at() + scan] = 1.0 / pivot + gain.dot(&(known * gain));
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4xX, Vector4};

    use super::*;

    /// Seven scans in three blocks against the dense equations: solution, covariance, variances.
    #[test]
    fn elimination_solves_the_whole() {
        let shape = Shape {
            shared: 5,
            blocks: vec![0, 0, 1, 2, 2, 2, 1],
            with_phases: 3,
        };
        let mut sums = ScanSums::new(&shape);
        let mut normal = DMatrix::<f64>::zeros(shape.size(), shape.size());
        for k in 0..21 {
            let scan = k % 7;
            // Numbers that follow no pattern, in units that differ by 10⁶.
            let odd = |i: usize, j: usize| (((7 * k + 3) * (i + 2) * (j + 5)) % 23) as f64 - 11.0;
            let unit = |j: usize| [1.0, 1e-3, 1e3][j % 3];
            let rows = Whitened::<4> {
                residuals: Vector4::from_fn(|i, _| odd(i, 20)),
                slopes: Matrix4xX::from_fn(shape.width(), |i, j| odd(i, j) * unit(j)),
            };
            sums.add(scan, &rows);
            // The prior of the clocks counts as much as it does without the units.
            sums.add_clock(scan, 1.0, 2e3);
            let mut all = DMatrix::zeros(4, shape.size());
            for j in 0..shape.width() {
                all.set_column(shape.place(scan, j), &rows.slopes.column(j));
            }
            normal += all.tr_mul(&all);
            let clock = shape.clocks_at() + scan;
            normal[(clock, clock)] += 4e6;
        }
        let held = sums.diagonal() * 1e-10;
        assert!((sums.diagonal() - normal.diagonal()).norm() < 1e-9 * normal.norm());
        let dense = normal.clone() + DMatrix::from_diagonal(&held);
        let units = NormalEquations::units(&dense);
        let inverse = NormalEquations::new(&dense, units.clone(), |_| 0.0)
            .unwrap()
            .inverse();
        let close = |a: f64, b: f64, i: usize, j: usize| {
            (a - b).abs() < 1e-9 * (inverse[(i, i)] * inverse[(j, j)]).sqrt()
        };
        let arrow = Arrow::new(&sums, &held).unwrap();
        let solved = arrow.solve(&sums.right());
        let expected = &inverse * sums.right();
        for i in 0..shape.size() {
            let size = expected.norm() / inverse[(i, i)].sqrt();
            assert!((solved[i] - expected[i]).abs() < 1e-9 * size * inverse[(i, i)].sqrt());
            assert!(
                close(arrow.variances()[i], inverse[(i, i)], i, i),
                "{i} {} {}",
                arrow.variances()[i],
                inverse[(i, i)]
            );
        }
        for scan in 0..7 {
            let local = arrow.local(scan);
            for (i, j) in (0..9).flat_map(|i| (0..9).map(move |j| (i, j))) {
                let (a, b) = (shape.place(scan, i), shape.place(scan, j));
                assert!(
                    close(local[(i, j)], inverse[(a, b)], a, b),
                    "{scan} {i} {j}"
                );
            }
        }
    }
}
