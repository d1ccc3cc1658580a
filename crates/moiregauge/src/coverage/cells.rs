//! The slow envelope of a wave on cells, a quarter of a period wide, under a Gaussian window.
//!
//! `a(r) = Σ g(n − r) I(n) e^{−iq·n} / Σ g(n − r)` over the pixels n that are there. Sums over the pixels of a cell
//! come first, then the window on the cells, which are few.

use heterostrain::lattice::reciprocal;
use nalgebra::{Matrix2, Vector2};
use rustfft::num_complex::Complex64;

use crate::frame::image::Image;

/// Cells per period: what the sums over a cell take off a wave at the distance of a wave vector is then a tenth.
const CELLS_PER_PERIOD: f64 = 4.0;
/// A window reaches so many of its widths: what is left out is a thousandth.
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
        let along: Vec<Complex64> = (0..image.columns)
            .map(|c| Complex64::cis(-q.x * c as f64))
            .collect();
        let mut sums = vec![Complex64::default(); self.len()];
        for row in 0..image.rows {
            let turn = Complex64::cis(-q.y * row as f64);
            let cells = &mut sums[row / self.pixels[1] * self.size[0]..][..self.size[0]];
            let blocks = image.row(row).chunks(self.pixels[0]);
            for ((cell, block), turns) in cells
                .iter_mut()
                .zip(blocks)
                .zip(along.chunks(self.pixels[0]))
            {
                let mut sum = Complex64::default();
                for (value, turn) in block.iter().zip(turns) {
                    if value.is_finite() {
                        sum += turn * *value;
                    }
                }
                *cell += sum * turn;
            }
        }
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
        let weight = self.smoothed(&self.count, &taps);
        let whole = (self.pixels[0] * self.pixels[1]) as f64
            * taps.iter().map(|t| t.iter().sum::<f64>()).product::<f64>();
        Window {
            noise: (self.smoothed(&self.count, &squares).iter())
                .zip(&weight)
                .map(|(squares, weight)| squares / (weight * weight))
                .collect(),
            support: weight.iter().map(|w| w / whole).collect(),
            taps,
            weight,
        }
    }

    /// Sums of cells under the window.
    pub(crate) fn summed(&self, sums: &[Complex64], window: &Window) -> Vec<Complex64> {
        self.smoothed(sums, &window.taps)
    }

    /// The envelope of a wave: its sums under the window.
    pub(crate) fn envelope(&self, sums: &[Complex64], window: &Window) -> Vec<Complex64> {
        let smoothed = self.smoothed(sums, &window.taps);
        let weights = smoothed.iter().zip(&window.weight);
        weights
            .map(|(sum, weight)| {
                if *weight > 0.0 {
                    sum / weight
                } else {
                    Complex64::default()
                }
            })
            .collect()
    }

    /// Convolution with the taps along columns, then along rows.
    fn smoothed<T>(&self, values: &[T], taps: &[Vec<f64>; 2]) -> Vec<T>
    where
        T: Copy + Default + std::ops::AddAssign + std::ops::Mul<f64, Output = T>,
    {
        let [across, up] = self.size;
        let mut lines = vec![T::default(); values.len()];
        let reach = (taps[0].len() / 2) as i64;
        for (line, out) in values
            .chunks_exact(across)
            .zip(lines.chunks_exact_mut(across))
        {
            for (x, out) in out.iter_mut().enumerate() {
                let first = (x as i64 - reach).max(0);
                let last = (x as i64 + reach).min(across as i64 - 1);
                for other in first..=last {
                    *out += line[other as usize] * taps[0][(other - x as i64 + reach) as usize];
                }
            }
        }
        let mut out = vec![T::default(); values.len()];
        let reach = (taps[1].len() / 2) as i64;
        for y in 0..up as i64 {
            let target = &mut out[y as usize * across..][..across];
            for other in (y - reach).max(0)..=(y + reach).min(up as i64 - 1) {
                let tap = taps[1][(other - y + reach) as usize];
                let line = &lines[other as usize * across..][..across];
                for (out, value) in target.iter_mut().zip(line) {
                    *out += *value * tap;
                }
            }
        }
        out
    }
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
}
