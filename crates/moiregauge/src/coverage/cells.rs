//! The slow envelope of a wave on cells, a quarter of a period wide, under a Gaussian window.
//!
//! `a(r) = Σ g(n − r) I(n) e^{−iq·n} / Σ g(n − r)` over the pixels n that are there. Sums over the pixels of a cell
//! come first, then the window on the cells, which are few.

use std::ops::Div;

use heterostrain::lattice::reciprocal;
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::coverage::summed::{FEWEST, Summed, across_lines, smoothed, under};
use crate::frame::image::Image;
use crate::numbers::widest::widest;

/// Cells per period: what the sums over a cell take off a wave at the distance of a wave vector is then a tenth.
const CELLS_PER_PERIOD: f64 = 4.0;
/// Reach of a window, widths: the rest is a thousandth.
const REACH: f64 = 3.0;

/// The cells of a frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cells {
    /// Cells along columns and rows.
    pub(crate) size: [usize; 2],
    /// Pixels of a cell along columns and rows; those at the far edges may have fewer.
    pub(crate) pixels: [usize; 2],
    /// The mean period, pixels along columns and rows.
    pub(crate) period: [f64; 2],
    /// Pixels that are there, of each cell.
    count: Vec<f64>,
}

impl Cells {
    /// The cells for a pair of waves (rad per pixel) in an image with pixels of `pitch` (columns, rows).
    pub(crate) fn new(image: &Image, pair: &Matrix2<f64>, pitch: [f64; 2]) -> Option<Self> {
        let cell =
            reciprocal(&(Matrix2::from_diagonal(&Vector2::from(pitch.map(f64::recip))) * pair))?;
        // The side of a rhombus of 60° with the area of the cell.
        let period = (cell.determinant().abs() / 0.75f64.sqrt()).sqrt();
        let period = pitch.map(|p| period / p);
        let pixels = period.map(|p| ((p / CELLS_PER_PERIOD) as usize).max(1));
        let size = [
            image.columns.div_ceil(pixels[0]),
            image.rows.div_ceil(pixels[1]),
        ];
        let empty = Self {
            size,
            pixels,
            period,
            count: vec![0.0; size[0] * size[1]],
        };
        Some(empty.of_part(image))
    }

    /// The same cells for an image of which other pixels are missing.
    pub(crate) fn of_part(&self, image: &Image) -> Self {
        let (size, pixels) = (self.size, self.pixels);
        let mut count = vec![0.0; size[0] * size[1]];
        for row in 0..image.rows {
            let cells = &mut count[row / pixels[1] * size[0]..][..size[0]];
            for (cell, block) in cells.iter_mut().zip(image.row(row).chunks(pixels[0])) {
                *cell += block.iter().filter(|v| v.is_finite()).count() as f64;
            }
        }
        Self {
            count,
            ..self.clone()
        }
    }

    /// Number of cells.
    pub(crate) fn len(&self) -> usize {
        self.count.len()
    }

    /// The middle of a cell (column, row), pixels.
    pub(crate) fn middle(&self, cell: [usize; 2]) -> Vector2<f64> {
        Vector2::from_fn(|i, _| {
            let first = (cell[i] * self.pixels[i]) as f64;
            first + (self.pixels[i] as f64 - 1.0) / 2.0
        })
    }

    /// The same of a cell counted row by row.
    pub(crate) fn middle_of(&self, cell: usize) -> Vector2<f64> {
        self.middle([cell % self.size[0], cell / self.size[0]])
    }

    /// Pixels that are there, of each cell.
    pub(crate) fn counts(&self) -> &[f64] {
        &self.count
    }

    /// `Σ I e^{−iq·n}` over each cell, pixels counted from (0, 0).
    pub(crate) fn mixed(&self, image: &Image, q: Vector2<f64>) -> Vec<Complex64> {
        let size = [image.columns, image.rows];
        self.mix(size, q, |first, turns, parts| {
            for (row, turn) in (first..).zip(turns) {
                add_turned(parts, image.row(row), *turn);
            }
        })
    }

    /// The same for an image of ones, of a number of columns and rows.
    pub(crate) fn mixed_ones(&self, size: [usize; 2], q: Vector2<f64>) -> Vec<Complex64> {
        self.mix(size, q, |_, turns, [re, im]| {
            // One after the other, as in any image.
            let sum = turns
                .iter()
                .fold(Complex64::default(), |sum, turn| sum + turn);
            re.fill(sum.re);
            im.fill(sum.im);
        })
    }

    /// The same; `add` adds up some lines, of which the first is given, each turned by its phase.
    fn mix(
        &self,
        size: [usize; 2],
        q: Vector2<f64>,
        add: impl Fn(usize, &[Complex64], &mut [Vec<f64>; 2]) + Sync,
    ) -> Vec<Complex64> {
        let turns = |axis: usize| -> Vec<Complex64> {
            (0..size[axis])
                .map(|i| Complex64::cis(-q[axis] * i as f64))
                .collect()
        };
        let (along, up) = (turns(0), turns(1));
        let mut sums = vec![Complex64::default(); self.len()];
        let [width, height] = self.pixels;
        let bands = sums
            .par_chunks_mut(self.size[0])
            .with_min_len(FEWEST.div_ceil(self.size[0]));
        bands.enumerate().for_each(|(band, cells)| {
            // All lines of the cells first, column by column.
            let mut parts = [vec![0.0; size[0]], vec![0.0; size[0]]];
            let first = band * height;
            let turns = &up[first..(first + height).min(size[1])];
            add(first, turns, &mut parts);
            let [re, im] = &parts;
            let columns = re
                .chunks(width)
                .zip(im.chunks(width))
                .zip(along.chunks(width));
            for (cell, ((re, im), along)) in cells.iter_mut().zip(columns) {
                for ((re, im), turn) in re.iter().zip(im).zip(along) {
                    *cell += Complex64::new(*re, *im) * turn;
                }
            }
        });
        sums
    }

    /// The window of `periods` mean periods (standard deviation) at these cells.
    pub(crate) fn window(&self, periods: f64) -> Window {
        let taps = [0, 1].map(|axis| {
            let width = periods * self.period[axis] / self.pixels[axis] as f64;
            let reach = (REACH * width).ceil() as i64;
            (-reach..=reach)
                .map(|d| (-0.5 * (d as f64 / width).powi(2)).exp())
                .collect::<Vec<f64>>()
        });
        let squares = [0, 1].map(|axis| taps[axis].iter().map(|t| t * t).collect::<Vec<f64>>());
        let counts = |taps| self.smoothed_counts(taps);
        let weight = counts(&taps);
        let whole = (self.pixels[0] * self.pixels[1]) as f64
            * taps.iter().map(|t| t.iter().sum::<f64>()).product::<f64>();
        Window {
            noise: (counts(&squares).iter())
                .zip(&weight)
                .map(|(squares, weight)| squares / (weight * weight))
                .collect(),
            support: weight.iter().map(|w| w / whole).collect(),
            taps,
            weight,
        }
    }

    /// Pixels that are there, under taps along columns and rows: a product where all are.
    fn smoothed_counts(&self, taps: &[Vec<f64>; 2]) -> Vec<f64> {
        let [across, up] = self.size;
        let (first, row) = (self.count[0], &self.count[..across]);
        let column: Vec<f64> = self.count.iter().step_by(across).copied().collect();
        let is_product = |(line, of): (&[f64], &f64)| {
            line.iter()
                .zip(row)
                .all(|(n, r)| n * first == r * of && *n > 0.0)
        };
        if !self.count.chunks_exact(across).zip(&column).all(is_product) {
            return smoothed(self.size, &self.count, taps);
        }
        let under = |values: &[f64], taps: &[f64]| -> Vec<f64> {
            let at = |i| under(taps, i, values.len(), |j| values[j]);
            (0..values.len()).map(at).collect()
        };
        let (row, column) = (under(row, &taps[0]), under(&column, &taps[1]));
        (0..across * up)
            .map(|i| row[i % across] * column[i / across] / first)
            .collect()
    }

    /// Sums of cells under the window at some of them.
    pub(crate) fn summed_at<T: Summed>(&self, sums: &[T], window: &Window, at: &[usize]) -> Vec<T> {
        let [across, up] = self.size;
        let mut rows: Vec<usize> = at.iter().map(|i| i / across).collect();
        rows.sort_unstable();
        rows.dedup();
        let mut lines = vec![T::default(); rows.len() * across];
        let all = rows.par_iter().zip(lines.par_chunks_exact_mut(across));
        all.with_min_len(FEWEST.div_ceil(across))
            .for_each(|(&y, out)| {
                across_lines(sums, y, up, &window.taps[1], out);
            });
        let of = |&i: &usize| {
            let line = rows.partition_point(|y| *y < i / across);
            let line = &lines[line * across..][..across];
            under(&window.taps[0], i % across, across, |x| line[x])
        };
        at.iter().map(of).collect()
    }

    /// `Σ e^{−iq·n}` of all pixels of an image without missing ones, under the window at some cells: a product of sums
    /// along columns and along rows.
    pub(crate) fn of_whole(
        &self,
        image_size: [usize; 2],
        q: Vector2<f64>,
        window: &Window,
        at: &[usize],
    ) -> Vec<Complex64> {
        let [x, y] = [0, 1].map(|axis| {
            let turns: Vec<Complex64> = (0..image_size[axis])
                .map(|i| Complex64::cis(-q[axis] * i as f64))
                .collect();
            let cells: Vec<Complex64> = (turns.chunks(self.pixels[axis]))
                .map(|c| c.iter().sum())
                .collect();
            let count = cells.len();
            let at = |i: usize| under(&window.taps[axis], i, count, |j| cells[j]);
            (0..count).map(at).collect::<Vec<Complex64>>()
        });
        let across = self.size[0];
        at.iter().map(|i| x[i % across] * y[i / across]).collect()
    }

    /// The envelope of a wave: its sums under the window.
    pub(crate) fn envelope<T: Summed + Div<f64, Output = T>>(
        &self,
        sums: &[T],
        window: &Window,
    ) -> Vec<T> {
        let mut envelope = smoothed(self.size, sums, &window.taps);
        let weights = envelope.par_iter_mut().zip(&window.weight);
        weights.with_min_len(FEWEST).for_each(|(sum, weight)| {
            *sum = if *weight > 0.0 {
                *sum / *weight
            } else {
                T::default()
            };
        });
        envelope
    }

    /// The same at some cells.
    pub(crate) fn envelope_at(
        &self,
        sums: &[Complex64],
        window: &Window,
        at: &[usize],
    ) -> Vec<Complex64> {
        let summed = self.summed_at(sums, window, at).into_iter().zip(at);
        summed
            .map(|(sum, &i)| match window.weight[i] {
                weight if weight > 0.0 => sum / weight,
                _ => Complex64::default(),
            })
            .collect()
    }

    /// Sums of values under the window at each cell, times powers of their distances from it along columns and rows, cells; `squared`: under the square of
    /// the window.
    pub(crate) fn moments<T: Summed>(
        &self,
        values: &[T],
        window: &Window,
        powers: [usize; 2],
        squared: bool,
    ) -> Vec<T> {
        let taps = [0, 1].map(|axis| {
            let taps = &window.taps[axis];
            let reach = (taps.len() / 2) as f64;
            let all = taps.iter().enumerate().map(|(i, tap)| {
                let tap = if squared { tap * tap } else { *tap };
                tap * (i as f64 - reach).powi(powers[axis] as i32)
            });
            all.collect::<Vec<f64>>()
        });
        smoothed(self.size, values, &taps)
    }
}

/// Adds a line turned by a phase; missing pixels count as 0.
fn add_turned([re, im]: &mut [Vec<f64>; 2], line: &[f64], turn: Complex64) {
    widest(
        #[inline(always)]
        || {
            for ((re, im), value) in re.iter_mut().zip(im.iter_mut()).zip(line) {
                let value = if value.is_finite() { *value } else { 0.0 };
                *re += turn.re * value;
                *im += turn.im * value;
            }
        },
    );
}

/// A Gaussian window at all cells.
pub(crate) struct Window {
    taps: [Vec<f64>; 2],
    /// `Σ g` over the pixels that are there.
    weight: Vec<f64>,
    /// `Σ g² / (Σ g)²`: the variance that white noise of unit variance makes of an envelope.
    pub(crate) noise: Vec<f64>,
    /// `Σ g` over that of a window without missing pixels.
    pub(crate) support: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The envelope of a wave is half its amplitude where it is, and nothing where it is not.
    #[test]
    fn a_wave_is_where_it_is() {
        let pair = Matrix2::new(0.4, 0.2, 0.0, 0.35);
        let q = pair.column(0).into_owned();
        let values = (0..128 * 160).map(|i| {
            let (x, y) = (f64::from(i % 160), f64::from(i / 160));
            if x < 80.0 {
                3.0 * (q.x * x + q.y * y + 0.7).cos()
            } else {
                0.0
            }
        });
        let image = Image::new(128, 160, values.collect());
        let cells = Cells::new(&image, &pair, [1.0, 1.0]).unwrap();
        let window = cells.window(0.8);
        let envelope = cells.envelope(&cells.mixed(&image, q), &window);
        let at = |x: usize, y: usize| {
            envelope[y / cells.pixels[1] * cells.size[0] + x / cells.pixels[0]]
        };
        assert!((at(30, 60).norm() - 1.5).abs() < 0.03, "{}", at(30, 60));
        assert!((at(30, 60).arg() - 0.7).abs() < 0.03, "{}", at(30, 60));
        assert!(at(130, 60).norm() < 0.03, "{}", at(130, 60));
        assert!((at(80, 60).norm() - 0.75).abs() < 0.2, "{}", at(80, 60));
    }

    /// Sums at some cells are those at all cells, and those of a whole image are products.
    #[test]
    fn shortcuts_sum_the_same() {
        let pair = Matrix2::new(0.4, 0.2, 0.0, 0.35);
        let image = Image::new(70, 90, vec![1.0; 70 * 90]);
        let cells = Cells::new(&image, &pair, [1.0, 1.0]).unwrap();
        let window = cells.window(0.8);
        let q = Vector2::new(0.3, -0.21);
        let sums = cells.mixed(&image, q);
        let all = smoothed(cells.size, &sums, &window.taps);
        let at: Vec<usize> = (0..cells.len()).step_by(7).collect();
        let some = cells.summed_at(&sums, &window, &at);
        let whole = cells.of_whole([90, 70], q, &window, &at);
        for ((i, some), whole) in at.iter().zip(some).zip(whole) {
            assert_eq!(some, all[*i]);
            assert!(
                (whole - some).norm() < 1e-10 * cells.pixels[0] as f64,
                "{whole} {some}"
            );
        }
    }
}
