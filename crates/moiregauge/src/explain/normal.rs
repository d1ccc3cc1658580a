//! Normal equations of amplitudes, block by block.

use nalgebra::{DMatrix, DVector};

use crate::explain::scene::{FOLDS, Scene};
use crate::numbers::widest::widest;

/// Damping of amplitudes, relative to each diagonal element of the normal equations: separates harmonics that a few blocks cannot.
pub(crate) const RIDGE: f64 = 1e-3;
/// Rows whose products are added to a Gram matrix at once, and columns: what fits into registers.
const ROWS: usize = 8;
const LANES: usize = 4;

/// Normal equations of amplitudes in one block.
#[derive(Clone)]
pub(crate) struct Normal {
    pub(crate) gram: DMatrix<f64>,
    pub(crate) moment: DVector<f64>,
}

impl Normal {
    /// That of some of the amplitudes.
    pub(crate) fn part(&self, kept: &[usize]) -> Self {
        let value = |i: usize, j: usize| self.gram[(kept[i], kept[j])];
        Self {
            gram: DMatrix::from_fn(kept.len(), kept.len(), value),
            moment: DVector::from_fn(kept.len(), |i, _| self.moment[kept[i]]),
        }
    }
}

/// Some rows and columns of a Gram matrix.
type Tile = [[f64; LANES]; LANES];

/// The place of a tile among those of the lower triangle, row by row.
fn tile(row: usize, column: usize) -> usize {
    row * (row + 1) / 2 + column
}

/// Sums of products, block by block.
pub(crate) struct Sums {
    size: usize,
    /// Lower triangles of the Gram matrices, in tiles.
    grams: Vec<Vec<Tile>>,
    moments: Vec<Vec<f64>>,
    /// Rows that are not in the Gram matrix of their block yet, lanes by lanes, and their number.
    pending: Vec<[[f64; LANES]; ROWS]>,
    count: usize,
    block: usize,
}

impl Sums {
    pub(crate) fn new(blocks: usize, size: usize) -> Self {
        let lanes = size.div_ceil(LANES);
        Self {
            size,
            grams: vec![vec![[[0.0; LANES]; LANES]; tile(lanes, 0)]; blocks],
            moments: vec![vec![0.0; size]; blocks],
            pending: vec![[[0.0; LANES]; ROWS]; lanes],
            count: 0,
            block: 0,
        }
    }

    /// Adds the products of a row with a value alone.
    pub(crate) fn add_moment(&mut self, block: usize, row: &[f64], value: f64) {
        let sums = self.moments[block].iter_mut().zip(row);
        sums.for_each(|(sum, a)| *sum += a * value);
    }

    /// Adds the products of a row with itself and with a value.
    pub(crate) fn add(&mut self, block: usize, row: &[f64], value: f64) {
        self.add_moment(block, row, value);
        if self.count == ROWS || self.block != block {
            self.flush();
            self.block = block;
        }
        for (lanes, values) in self.pending.iter_mut().zip(row.chunks(LANES)) {
            lanes[self.count][..values.len()].copy_from_slice(values);
        }
        self.count += 1;
    }

    /// Adds the products of the pending rows.
    fn flush(&mut self) {
        let (pending, count) = (&mut self.pending, self.count);
        let left = pending.iter_mut().flat_map(|lanes| &mut lanes[count..]);
        left.for_each(|row| *row = [0.0; LANES]);
        self.count = 0;
        let (gram, pending) = (&mut self.grams[self.block], &self.pending);
        widest(
            #[inline(always)]
            || {
                for (i, own) in pending.iter().enumerate() {
                    let tiles = &mut gram[tile(i, 0)..=tile(i, i)];
                    for (sums, others) in tiles.iter_mut().zip(pending) {
                        let mut all = *sums;
                        for (own, others) in own.iter().zip(others) {
                            for (sums, a) in all.iter_mut().zip(own) {
                                for (sum, b) in sums.iter_mut().zip(others) {
                                    *sum += a * b;
                                }
                            }
                        }
                        *sums = all;
                    }
                }
            },
        );
    }

    pub(crate) fn normals(mut self) -> Vec<Normal> {
        self.flush();
        let size = self.size;
        let both = self.grams.into_iter().zip(self.moments);
        both.map(|(lower, moment)| {
            let value = |i: usize, j: usize| {
                let (i, j) = (i.max(j), i.min(j));
                lower[tile(i / LANES, j / LANES)][i % LANES][j % LANES]
            };
            let gram = DMatrix::from_fn(size, size, value);
            let moment = DVector::from_vec(moment);
            Normal { gram, moment }
        })
        .collect()
    }
}

/// The sum over blocks.
pub(crate) fn total(normals: &[Normal]) -> Normal {
    let mut sum = normals[0].clone();
    for normal in &normals[1..] {
        sum.gram += &normal.gram;
        sum.moment += &normal.moment;
    }
    sum
}

/// Damped least squares; `None` if the normal equations are singular.
pub(crate) fn amplitudes(normal: &Normal, ridge: f64) -> Option<DVector<f64>> {
    let n = normal.moment.len();
    let scales = normal.gram.diagonal().map(|d| d.max(1e-300).sqrt());
    let mut gram = normal.gram.clone();
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        gram[(i, j)] /= scales[i] * scales[j];
    }
    (0..n).for_each(|i| gram[(i, i)] += ridge);
    let scaled = normal.moment.component_div(&scales);
    Some(gram.cholesky()?.solve(&scaled).component_div(&scales))
}

/// What amplitudes of the harmonics `kept` fitted to the other folds explain of each block: the drop of its sum of squares.
pub(crate) fn gains(normals: &[Normal], kept: &[usize]) -> Option<Vec<f64>> {
    let parts: Vec<Normal> = normals.iter().map(|normal| normal.part(kept)).collect();
    let mut found = vec![0.0; parts.len()];
    for fold in 0..FOLDS {
        let held = |b: &usize| Scene::fold(*b) == fold;
        let seen: Vec<Normal> = (0..parts.len())
            .filter(|b| !held(b))
            .map(|b| parts[b].clone())
            .collect();
        let weights = amplitudes(&total(&seen), RIDGE)?;
        for b in (0..parts.len()).filter(held) {
            found[b] =
                2.0 * weights.dot(&parts[b].moment) - weights.dot(&(&parts[b].gram * &weights));
        }
    }
    Some(found)
}
