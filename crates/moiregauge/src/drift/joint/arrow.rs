//! Normal equations of many scans, solved block by block.
//!
//! The clock of a scan is seen by that scan alone, the phases of a block by the scans of that block, and lattice, drift and
//! the rest by all: the normal matrix has the shape of an arrow. Clocks are eliminated first
//! ([`sums`](crate::drift::joint::sums)), then the phases of the blocks; what is left is a small matrix of the shared
//! parameters. Time and memory are linear in the number of scans.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};

use crate::drift::joint::shape::{PHASES, Shape};
use crate::drift::joint::sums::{Clock, ScanSums};
use crate::numbers::normal_equations::NormalEquations;

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
    use crate::drift::joint::sums::Whitened;

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
