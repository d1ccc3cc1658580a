//! The error of a lattice from the scatter of its unit cells: spots differ in height, place and width, which the noise of pixels does not tell.
//!
//! In: a finished fit and what it leaves of the image. Out: the covariance of the wave vectors. Each unit cell is one block of a cluster-robust
//! covariance with the leverage correction CR2: with `J` all derivatives, `G = JᵀJ`, residual `r` and block `b`,
//! `δ_b = G⁻¹ J_bᵀ (I − H_bb)^(−1/2) r_b`, `V = Σ_b δ_b δ_bᵀ`. From the normal equations of the blocks alone:
//! `G = LLᵀ`, `L⁻¹ G_b L⁻ᵀ = U Λ Uᵀ`, `δ_b = L⁻ᵀ U (1 − Λ)^(−1/2) Uᵀ L⁻¹ s_b` with `s_b = J_bᵀ r_b`.
//!
//! Disorder is taken as independent from cell to cell. Where there are many cells the noise beside the harmonics has it already.
//!
//! # References
//! Bell and `McCaffrey`, Survey Methodology 28, 169 (2002), bias reduced linearisation.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix2, Matrix4, Vector2};

use rustfft::num_complex::Complex64;

use crate::explain::normal::{Normal, Sums, total};
use crate::explain::scene::gaussian_mean;
use crate::lattice::fit::fit_pixels::Fit;
use crate::lattice::fit::frame::{BENDS, BENT, turns, wave};
use crate::lattice::fit::model::settled;
use crate::lattice::fit::tables::Tables;
use crate::numbers::three::three;
use crate::spectrum::shells::shells;

/// With more cells the noise around a harmonic, which is read some bins beside it, is that of their disorder as well.
const MANY_CELLS: f64 = 256.0;
/// The same for a lattice that bends: cubic phases leave more of a bend than cells scatter.
const MANY_BENT_CELLS: f64 = 64.0;
/// With fewer cells their scatter says nothing.
const FEWEST_CELLS: usize = 4;
/// Blocks with less than this fraction of a cell join the nearest block: at edges there are slivers.
const WHOLE_CELL: f64 = 0.4;
/// Leverage above this is taken as this: one block then decides a parameter alone.
const MAX_LEVERAGE: f64 = 0.98;
/// Standard deviation of the Gaussian mean that is taken off as slow ground, in longest periods. A narrower one takes part of what single cells scatter,
/// and errors from them become too small.
const GROUND: f64 = 1.5;
/// Points along each vector of a cell among which its extremum is looked for.
const GRID: usize = 24;
/// Terms of a quadratic background.
const QUADRATIC: usize = 6;

/// What the scatter of cells says.
pub(crate) struct OfCells {
    /// Of the wave vectors, phases at the edges.
    pub(crate) covariance: Matrix4<f64>,
    /// Cells.
    blocks: f64,
}

impl OfCells {
    /// Whether they scatter by more than noise explains, whose variances (all four in sum) are given. n blocks measure a variance to √(2/n); three
    /// times that.
    pub(crate) fn exceed(&self, noise: f64) -> bool {
        self.covariance.trace() > noise * (1.0 + 3.0 * (2.0 / self.blocks).sqrt())
    }
}

impl Fit<'_> {
    /// Covariance of the wave vectors (phases at the edges) from the scatter of cells; `bends`: phases may be cubic polynomials. `None` where there are
    /// too few cells for that, or enough that the noise beside the harmonics measures it.
    pub(crate) fn of_cells(&self, bends: bool) -> Option<OfCells> {
        let (frame, model) = (&self.frame, &self.model);
        // The frame has sides of 2 and a cell 4π²/|p₁ × p₂|.
        let share = frame.pixels() as f64 / frame.image.values.len() as f64;
        let cells = share * model.pair.determinant().abs() / PI.powi(2);
        if cells > if bends { MANY_BENT_CELLS } else { MANY_CELLS } {
            return None;
        }
        let (rest, cut) = self.without_ground();
        let blocks = self.blocks(&rest)?;
        // Amplitudes of higher harmonics are taken as known.
        let waves = model
            .basis
            .indices
            .iter()
            .copied()
            .zip(model.waves.iter().copied());
        let (mut waves, known): (Vec<_>, Vec<_>) =
            waves.partition(|(index, _)| shells(2).contains(index));
        let free = waves.len();
        waves.extend(known);
        let orders: &[[usize; 2]] = if bends {
            &BENT[1..]
        } else {
            &BENT[1..BENT.len() - BENDS]
        };
        let linear = QUADRATIC + 2 * free;
        let size = linear + 2 * orders.len();
        let mut sums = Sums::new(blocks.iter().flatten().max()? + 1, size);
        let mut row = vec![0.0; size];
        let turned = waves.iter().map(|(index, _)| {
            let p = wave(&model.pair, *index);
            [turns(p.x, &frame.x), turns(p.y, &frame.y)]
        });
        let turned: Vec<[Vec<Complex64>; 2]> = turned.collect();
        let columns = frame.image.columns;
        for (i, block) in blocks.iter().enumerate() {
            let Some(block) = *block else { continue };
            let [column, line] = [i % columns, i / columns];
            let (x, y) = (frame.x[column], frame.y[line]);
            row[..QUADRATIC].copy_from_slice(&[1.0, x, y, x * x, x * y, y * y]);
            let mut slopes = [0.0; 2];
            for (j, (index, [alpha, beta])) in waves.iter().enumerate() {
                let turn = turned[j][0][column] * turned[j][1][line];
                if j < free {
                    row[QUADRATIC + 2 * j..][..2].copy_from_slice(&[turn.re, turn.im]);
                }
                let slope = beta * turn.re - alpha * turn.im;
                slopes[0] += f64::from(index[0]) * slope;
                slopes[1] += f64::from(index[1]) * slope;
            }
            for (j, [a, b]) in orders.iter().enumerate() {
                let power = x.powi(*a as i32) * y.powi(*b as i32);
                row[linear + 2 * j] = slopes[0] * power;
                row[linear + 2 * j + 1] = slopes[1] * power;
            }
            // What is cut off does not follow the model.
            if cut[i] {
                sums.add_moment(block, &row, rest[i]);
            } else {
                sums.add(block, &row, rest[i]);
            }
        }
        let parts = sums.normals();
        let blocks = parts.len() as f64;
        let covariance = clustered(parts)?;
        // x and y of both vectors, from both vectors of x and of y.
        let order = [linear, linear + 2, linear + 1, linear + 3];
        Some(OfCells {
            covariance: Matrix4::from_fn(|i, j| covariance[(order[i], order[j])]),
            blocks,
        })
    }

    /// What is left of each pixel, without line means and slow ground, and whether it was cut off; NaN where it does not count.
    fn without_ground(&self) -> (Vec<f64>, Vec<bool>) {
        let (frame, model) = (&self.frame, &self.model);
        let tables = Tables::new(frame, &model.pair, &model.basis.indices);
        let clip = self.clip();
        let columns = frame.image.columns;
        let mut rest = vec![f64::NAN; frame.image.values.len()];
        let mut cut = vec![false; rest.len()];
        let mut line = vec![0.0; columns];
        for row in (0..frame.image.rows).filter(|row| frame.present[*row] > 0) {
            settled(frame, model, &tables, &self.lines, clip, row, &mut line);
            let mean = line.iter().sum::<f64>() / frame.present[row] as f64;
            let pixels = frame.image.row(row).iter().zip(&line);
            for (i, (pixel, value)) in pixels.enumerate() {
                if pixel.is_finite() {
                    rest[row * columns + i] = value - mean;
                    cut[row * columns + i] = clip.is_at(*value);
                }
            }
        }
        let per_pixel = frame.edge().map(|edge| 1.0 / edge);
        let waves = three(&model.pair).map(|p| p.component_mul(&per_pixel).norm());
        let longest = TAU / waves.into_iter().fold(f64::INFINITY, f64::min);
        let ground = gaussian_mean(
            &rest,
            columns,
            GROUND * longest,
            &vec![true; frame.image.rows],
        );
        rest.iter_mut()
            .zip(ground)
            .for_each(|(value, ground)| *value -= ground);
        (rest, cut)
    }

    /// The block of each pixel, `None` where it does not count: the cell around the nearest site, slivers joined to the block whose middle is nearest.
    fn blocks(&self, rest: &[f64]) -> Option<Vec<Option<usize>>> {
        let (frame, model) = (&self.frame, &self.model);
        let columns = frame.image.columns;
        // A site is an extremum of the waves.
        let value = |phases: Vector2<f64>| -> f64 {
            let waves = model.waves.iter().zip(&model.basis.indices);
            let each = waves.map(|([alpha, beta], [h, k])| {
                let (sin, cos) = (f64::from(*h) * phases.x + f64::from(*k) * phases.y).sin_cos();
                alpha * cos + beta * sin
            });
            each.sum()
        };
        let grid = (0..GRID * GRID)
            .map(|i| Vector2::new((i % GRID) as f64, (i / GRID) as f64) * (TAU / GRID as f64));
        let site = grid.max_by(|a, b| value(*a).abs().total_cmp(&value(*b).abs()))?;
        let edge = frame.edge();
        let basis = Matrix2::from_diagonal(&edge) * model.pair.transpose().try_inverse()?;
        let cell = |i: usize| {
            let at = Vector2::new(frame.x[i % columns], frame.y[i / columns]);
            let place = (model.pair.transpose() * at - site) / TAU;
            let low = place.map(f64::floor);
            let off = |[x, y]: &[f64; 2]| (basis * (place - low - Vector2::new(*x, *y))).norm();
            let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
            let nearest = corners.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)));
            nearest.map(|[x, y]| [(low.x + x) as i32, (low.y + y) as i32])
        };
        let there = |i: usize| rest[i].is_finite();
        let cells: Vec<_> = (0..rest.len())
            .map(|i| there(i).then(|| cell(i)).flatten())
            .collect();
        let mut known: BTreeMap<[i32; 2], (f64, Vector2<f64>)> = BTreeMap::new();
        for (i, cell) in cells.iter().enumerate() {
            let Some(cell) = cell else { continue };
            let (count, sum) = known.entry(*cell).or_default();
            *count += 1.0;
            *sum += Vector2::new((i % columns) as f64, (i / columns) as f64);
        }
        let mut counts: Vec<f64> = known.values().map(|(count, _)| *count).collect();
        counts.sort_by(f64::total_cmp);
        // Whole cells are among the largest.
        let full = *counts.get(counts.len() * 9 / 10)?;
        let whole: Vec<([i32; 2], Vector2<f64>)> = known
            .iter()
            .filter(|(_, (count, _))| *count >= WHOLE_CELL * full)
            .map(|(cell, (count, sum))| (*cell, sum / *count))
            .collect();
        let nearest = |at: Vector2<f64>| {
            let off = |i: &usize| (whole[*i].1 - at).norm();
            (0..whole.len()).min_by(|a, b| off(a).total_cmp(&off(b)))
        };
        let block = |(cell, (count, sum)): (&[i32; 2], &(f64, Vector2<f64>))| {
            let own = whole.binary_search_by(|(other, _)| other.cmp(cell)).ok();
            (*cell, own.or_else(|| nearest(sum / *count)))
        };
        let of: BTreeMap<[i32; 2], Option<usize>> = known.iter().map(block).collect();
        let blocks = cells
            .iter()
            .map(|cell| of.get(&(*cell)?).copied().flatten());
        Some(blocks.collect())
    }
}

/// The cluster-robust covariance of all parameters, from the normal equations of blocks.
fn clustered(mut blocks: Vec<Normal>) -> Option<DMatrix<f64>> {
    if blocks.len() < FEWEST_CELLS {
        return None;
    }
    let sum = total(&blocks);
    let cholesky = Cholesky::new(sum.gram.clone())?;
    // What is left at the least-squares solution: residuals were cut off, and lost their ground.
    let solution = cholesky.solve(&sum.moment);
    let mut covariance = DMatrix::zeros(solution.len(), solution.len());
    for block in &mut blocks {
        block.moment -= &block.gram * &solution;
        let step = without_block(&cholesky, block)?;
        covariance += &step * step.transpose();
    }
    Some(covariance)
}

/// `G⁻¹ J_bᵀ (I − H_bb)^(−1/2) r_b`.
fn without_block(cholesky: &Cholesky<f64, Dyn>, block: &Normal) -> Option<DVector<f64>> {
    let l = cholesky.l();
    let half = l.solve_lower_triangular(&block.gram)?;
    let scaled = l.solve_lower_triangular(&half.transpose())?;
    let eigen = ((&scaled + scaled.transpose()) / 2.0).symmetric_eigen();
    let mut along = eigen.eigenvectors.transpose() * l.solve_lower_triangular(&block.moment)?;
    for (value, leverage) in along.iter_mut().zip(&eigen.eigenvalues) {
        *value /= (1.0 - leverage.clamp(0.0, MAX_LEVERAGE)).sqrt();
    }
    l.transpose()
        .solve_upper_triangular(&(&eigen.eigenvectors * along))
}

/// The larger of two covariances along each of their common axes.
pub(crate) fn larger_of(one: &Matrix4<f64>, other: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    let l = one.cholesky()?.l();
    let inverse = l.try_inverse()?;
    let eigen = (inverse * other * inverse.transpose()).symmetric_eigen();
    if eigen.eigenvalues.max() <= 1.0 {
        return Some(*one);
    }
    let largest = Matrix4::from_diagonal(&eigen.eigenvalues.map(|e| e.max(1.0)));
    let axes = l * eigen.eigenvectors;
    Some(axes * largest * axes.transpose())
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector4;

    use super::*;
    use crate::frame::background::Background;
    use crate::frame::image::Image;
    use crate::numbers::rng::normals;
    use crate::spectrum::harmonics::Windowed;

    /// (columns, rows), not square: exchanged axes would show.
    const SIZE: [usize; 2] = [132, 92];

    /// Waves of some nine pixels at 60°.
    fn pair() -> Matrix2<f64> {
        Matrix2::new(0.70, 0.24, 0.05, 0.63)
    }

    fn image(seed: u64, noise: f64, value: impl Fn(Vector2<f64>) -> f64) -> Image {
        let mut normal = normals(seed, "cells", 0);
        let at = |i: usize| Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
        let values = (0..SIZE[0] * SIZE[1]).map(|i| value(at(i)) + noise * normal());
        Image::new(SIZE[1], SIZE[0], values.collect())
    }

    /// Wave vectors (rad per pixel) and their covariance from the scatter of cells.
    fn fitted(image: &Image, pair: &Matrix2<f64>) -> (Matrix2<f64>, Matrix4<f64>) {
        let start = Windowed::new(image).fit(image, pair, Background::Plane, shells(1));
        let mut fit = Fit::new(image, &start.unwrap(), Background::Plane).unwrap();
        fit.choose().unwrap();
        let scale = fit.frame.edge().map(|edge| 1.0 / edge);
        let to_pixels = Matrix2::from_diagonal(&scale);
        let of_both = Matrix4::from_diagonal(&Vector4::new(scale.x, scale.y, scale.x, scale.y));
        let cells = fit.of_cells(false).unwrap().covariance;
        (to_pixels * fit.model.pair, of_both * cells * of_both)
    }

    /// White noise: with three cosines of amplitude A and `I = A² N L² / (24 σ²)` along an axis the information on (K₁, K₂) is
    /// `I [[2, −1], [−1, 2]]`, so that the variance of each is 2/(3 I) and their correlation ½. The scatter of some 60 cells tells a variance to 18 %, the
    /// mean of 48 images to 3 %: it is within a tenth; the axes differ by a factor of two.
    #[test]
    fn white_noise_gives_the_cramer_rao_bound() {
        const IMAGES: u64 = 48;
        let mut mean = Matrix4::zeros();
        for seed in 0..IMAGES {
            let waves = |at: Vector2<f64>| -> f64 {
                three(&pair())
                    .iter()
                    .map(|q| (q.dot(&at) + 0.4).cos())
                    .sum()
            };
            mean += fitted(&image(seed, 1.0, waves), &pair()).1 / IMAGES as f64;
        }
        let pixels = (SIZE[0] * SIZE[1]) as f64;
        for (i, side) in [(0, SIZE[0]), (1, SIZE[1]), (2, SIZE[0]), (3, SIZE[1])] {
            let bound = 2.0 / 3.0 * 24.0 / (pixels * (side as f64).powi(2));
            let ratio = mean[(i, i)] / bound;
            assert!((ratio - 1.0).abs() < 0.1, "{i}: {ratio}");
        }
        for i in 0..2 {
            let correlation = mean[(i, i + 2)] / (mean[(i, i)] * mean[(i + 2, i + 2)]).sqrt();
            assert!((correlation - 0.5).abs() < 0.15, "{correlation}");
        }
    }

    /// Spots with heights and places of their own, hardly any noise, four by three periods: errors of the wave vectors over what the cells say.
    #[test]
    fn the_scatter_of_cells_covers_the_truth() {
        const SEEDS: u64 = 60;
        let pair = pair() * 0.3;
        let cell = pair.transpose().try_inverse().unwrap() * TAU;
        let mut squares = Vec::new();
        for seed in 0..SEEDS {
            let mut normal = normals(seed, "spots", 0);
            let mut spots = Vec::new();
            for (i, j) in (-8..16).flat_map(|i| (-8..16).map(move |j| (i, j))) {
                let away = Vector2::new(normal(), normal()) * 0.3;
                let at = cell * Vector2::new(f64::from(i), f64::from(j));
                spots.push((at + away, 1.0 + 0.15 * normal()));
            }
            let near = |at: Vector2<f64>| {
                let each = spots
                    .iter()
                    .map(|(spot, height)| height * (-(at - spot).norm_squared() / 80.0).exp());
                each.sum::<f64>()
            };
            let (found, covariance) = fitted(&image(seed, 0.01, near), &pair);
            let off = Vector4::from_column_slice((found - pair).as_slice());
            squares.extend((0..4).map(|i| off[i] * off[i] / covariance[(i, i)]));
        }
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!((0.8..1.25).contains(&rms), "{rms}");
    }

    /// Along each common axis the larger of two covariances is taken.
    #[test]
    fn the_larger_covariance_is_taken() {
        let one = Matrix4::from_diagonal(&Vector4::new(1.0, 4.0, 1.0, 1.0));
        let other = Matrix4::from_diagonal(&Vector4::new(2.0, 1.0, 0.5, 1.0));
        let wanted = Matrix4::from_diagonal(&Vector4::new(2.0, 4.0, 1.0, 1.0));
        assert!((larger_of(&one, &other).unwrap() - wanted).amax() < 1e-12);
        assert_eq!(larger_of(&one, &(one / 2.0)), Some(one));
    }
}
