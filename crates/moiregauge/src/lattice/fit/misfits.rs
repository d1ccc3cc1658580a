//! Places that do not show the lattice: holes, defects, what lies beyond an edge.
//!
//! A fit with all harmonics leaves noise, which is the same everywhere. Where the lattice is missing it leaves the lattice, and much
//! more than noise. So the power that is left is averaged under a box of one unit cell, in which whatever harmonics leave
//! averages out, and where it exceeds that of most places, pixels are taken out and the rest is fitted again. A lattice that bends
//! leaves more where it is farthest from straight, and is left as it is.

use heterostrain::lattice::{Px, Waves};
use nalgebra::{Matrix2, Matrix4};
use rayon::prelude::*;

use crate::frame::image::Image;
use crate::lattice::fit::fit_pixels::Fit;
use crate::lattice::fit::model::{AT_ONCE, residual};
use crate::lattice::fit::tables::Tables;
use crate::numbers::interrupt;
use crate::numbers::median::median;

/// Power that is left under the box over the median of all boxes, beyond which the lattice is missing there. The mean over a unit cell of 100
/// pixels of white noise scatters by 0.14.
const MISSING: f64 = 2.0;
/// The same in standard deviations of the boxes, by the quartiles: for noise that is uneven, or a unit cell of few pixels.
const DEVIATIONS: f64 = 8.0;
/// Median of the distance from the median, of normal numbers, in standard deviations.
const MEDIAN_DISTANCE: f64 = 0.674_489_750_196_082;
/// A box with a smaller share of its pixels says nothing. Chosen by eye.
const FULL_ENOUGH: f64 = 0.2;
/// Where more than this share of the pixels does not follow the lattice, it is none of the frame. Chosen by eye.
const MOST: f64 = 0.35;

/// Bins across the narrower side of a unit cell, at least: boxes of bins are as good as boxes of pixels then. Chosen by eye.
const BINS: usize = 10;

/// Bins that do not show the lattice.
pub(crate) struct Misfits {
    /// Pixels of a bin along each axis, and bins along the columns.
    bin: usize,
    columns: usize,
    gone: Vec<bool>,
    /// Whether most of the frame shows the lattice.
    pub(crate) are_few: bool,
}

impl Misfits {
    /// The image without them.
    pub(crate) fn taken_out(&self, image: &Image) -> Image {
        let mut rest = image.clone();
        for (row, line) in rest.values.chunks_exact_mut(image.columns).enumerate() {
            let gone = &self.gone[row / self.bin * self.columns..];
            let bins = line.chunks_mut(self.bin).zip(gone);
            for (pixels, _) in bins.filter(|(_, gone)| **gone) {
                pixels.fill(f64::NAN);
            }
        }
        rest
    }
}

impl Fit<'_> {
    /// The places that do not show the lattice; `None` where there are none.
    pub(crate) fn misfits(&self) -> Option<Misfits> {
        let cell = self.unit_cell()?;
        let bin = (cell[0].min(cell[1]) / BINS).max(1);
        let left = self.left_in_bins(bin);
        let gone = left.misfits(cell.map(|n| n.div_ceil(bin)))?;
        let count = |bins: &dyn Fn(usize) -> bool| (0..gone.len()).filter(|i| bins(*i)).count();
        let there = count(&|i| left.counts[i] > 0.0);
        Some(Misfits {
            bin,
            columns: left.shape[0],
            are_few: (count(&|i| gone[i]) as f64) < MOST * there as f64,
            gone,
        })
    }

    /// Pixels of a unit cell along columns and rows, from one side to the other.
    pub(crate) fn unit_cell(&self) -> Option<[usize; 2]> {
        let scale = self.frame.edge().map(|e| 1.0 / e);
        let pair = Matrix2::from_diagonal(&scale) * self.model.pair;
        let lattice = Waves::<Px>::new(pair, Matrix4::zeros()).lattice()?;
        let most = |axis: usize| {
            (0..3)
                .map(|i| lattice.vector(i)[axis].abs())
                .fold(0.0, f64::max)
        };
        Some([0, 1].map(|axis| (most(axis).round() as usize).max(1)))
    }

    /// What is left of the pixels that count, in bins of so many pixels along each axis; offsets of lines are in it.
    fn left_in_bins(&self, bin: usize) -> Left {
        let (frame, model) = (&self.frame, &self.model);
        let image = frame.image;
        let tables = Tables::new(frame, &model.pair, &model.basis.indices);
        let shape = [image.columns, image.rows].map(|n| n.div_ceil(bin));
        let mut left = Left::none(shape, bin);
        let lines = (left.squares.par_chunks_exact_mut(shape[0]))
            .zip(left.counts.par_chunks_exact_mut(shape[0]))
            .enumerate();
        lines.with_min_len(AT_ONCE.div_ceil(bin)).for_each_init(
            || vec![0.0; image.columns],
            |line, (i, (squares, counts))| {
                let rows = i * bin..((i + 1) * bin).min(image.rows);
                for row in rows.filter(|row| frame.present[*row] > 0) {
                    interrupt::check();
                    residual(frame, model, &tables, row, line);
                    add(line, bin, squares, counts);
                }
            },
        );
        left
    }
}

/// Adds the squares of the pixels of a line to its bins; missing ones are NaN.
fn add(line: &[f64], bin: usize, squares: &mut [f64], counts: &mut [f64]) {
    let bins = squares.iter_mut().zip(counts);
    for (pixels, (square, count)) in line.chunks(bin).zip(bins) {
        for value in pixels.iter().filter(|value| value.is_finite()) {
            *square += value * value;
            *count += 1.0;
        }
    }
}

/// What a fit leaves in square bins.
struct Left {
    /// Bins along columns and rows.
    shape: [usize; 2],
    /// Pixels of a bin.
    pixels: usize,
    /// Sum of the squares of the pixels that count ...
    squares: Vec<f64>,
    /// ... and how many do.
    counts: Vec<f64>,
}

impl Left {
    fn none(shape: [usize; 2], bin: usize) -> Self {
        let zeros = vec![0.0; shape[0] * shape[1]];
        Self {
            shape,
            pixels: bin * bin,
            squares: zeros.clone(),
            counts: zeros,
        }
    }

    /// Mean squares under boxes of so many bins around every bin; NaN where hardly any pixel of a box counts.
    fn power(&self, size: [usize; 2]) -> Vec<f64> {
        let squares = box_sums(self.squares.clone(), self.shape, size);
        let counts = box_sums(self.counts.clone(), self.shape, size);
        let fewest = FULL_ENOUGH * (size[0] * size[1] * self.pixels) as f64;
        let mean = |(sum, n): (&f64, &f64)| if *n < fewest { f64::NAN } else { sum / n };
        squares.iter().zip(&counts).map(mean).collect()
    }

    /// The bins with pixels that count in whose boxes, so many bins wide and high, much more is left than in most; `None` where there are
    /// none.
    fn misfits(&self, size: [usize; 2]) -> Option<Vec<bool>> {
        let power = self.power(size);
        let there = || power.iter().zip(&self.counts).filter(|(_, n)| **n > 0.0);
        let mut all: Vec<f64> = there().map(|(p, _)| *p).filter(|p| p.is_finite()).collect();
        if all.is_empty() {
            return None;
        }
        let typical = median(&mut all);
        for power in &mut all {
            *power = (*power - typical).abs();
        }
        let spread = median(&mut all) / MEDIAN_DISTANCE;
        let most = (MISSING * typical).max(typical + DEVIATIONS * spread);
        if !there().any(|(p, _)| *p > most) {
            return None;
        }
        // With them go slivers between what is gone already.
        let goes = |(p, n): (&f64, &f64)| *n > 0.0 && (p.is_nan() || *p > most);
        Some(power.iter().zip(&self.counts).map(goes).collect())
    }
}

/// Sums over boxes of a size around every number of a field of a shape (columns, rows).
fn box_sums(mut values: Vec<f64>, shape: [usize; 2], size: [usize; 2]) -> Vec<f64> {
    let [columns, rows] = shape;
    let mut line = vec![0.0; columns];
    for row in values.chunks_exact_mut(columns) {
        line.copy_from_slice(row);
        running(&line, size[0], |i, sum| row[i] = sum);
    }
    // Sums of the rows above each.
    let mut above = vec![0.0; (rows + 1) * columns];
    for (row, line) in values.chunks_exact(columns).enumerate() {
        for (column, value) in line.iter().enumerate() {
            above[(row + 1) * columns + column] = above[row * columns + column] + value;
        }
    }
    for (row, line) in values.chunks_exact_mut(columns).enumerate() {
        let [first, last] = around(row, size[1], rows).map(|row| &above[row * columns..]);
        for (sum, (first, last)) in line.iter_mut().zip(first.iter().zip(last)) {
            *sum = last - first;
        }
    }
    values
}

/// Where `size` numbers around one of so many begin and end: fewer at the ends.
fn around(i: usize, size: usize, count: usize) -> [usize; 2] {
    [
        i.saturating_sub(size / 2),
        (i + size.div_ceil(2)).min(count),
    ]
}

/// Sums over `size` numbers around each, fewer at the ends.
fn running(line: &[f64], size: usize, mut put: impl FnMut(usize, f64)) {
    let mut sums = Vec::with_capacity(line.len() + 1);
    let mut sum = 0.0;
    sums.push(sum);
    for value in line {
        sum += value;
        sums.push(sum);
    }
    for i in 0..line.len() {
        let [first, last] = around(i, size, line.len());
        put(i, sums[last] - sums[first]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::background::Background;
    use crate::lattice::fit::measure::measure;
    use crate::numbers::rng::normals;
    use crate::spectrum::harmonics::Windowed;
    use crate::spectrum::shells::shells;
    use nalgebra::Vector2;

    const SIZE: usize = 128;
    /// Half of a box, and a pixel.
    const HALF: f64 = 8.0;
    /// Of a hole.
    const RADIUS: f64 = 24.0;

    fn pair() -> Matrix2<f64> {
        Matrix2::new(0.45, -0.02, 0.21, 0.52)
    }

    /// Three waves of amplitude 1 where there is a lattice, and white noise of 0.3.
    fn image(seed: u64, shows: impl Fn(Vector2<f64>) -> bool) -> Image {
        let mut normal = normals(seed, "misfits", 0);
        let value = |i: usize| {
            let at = Vector2::new((i % SIZE) as f64, (i / SIZE) as f64);
            let [a, b] = [0, 1].map(|j| pair().column(j).dot(&at));
            let lattice = a.cos() + b.cos() + (b - a).cos();
            f64::from(u8::from(shows(at))) * lattice + 0.3 * normal()
        };
        Image::new(SIZE, SIZE, (0..SIZE * SIZE).map(value).collect())
    }

    fn rest(image: &Image) -> Option<Image> {
        let start = Windowed::new(image).fit(image, &pair(), Background::Plane, shells(3));
        measure(image, &start.unwrap(), Background::Plane)
            .unwrap()
            .rest
    }

    /// Boxes against sums that are written out, at the ends too.
    #[test]
    fn sums_are_those_of_boxes() {
        let (shape, size) = ([7, 5], [4, 3]);
        let values: Vec<f64> = (0..35).map(|i| f64::from(i * i % 11)).collect();
        let sums = box_sums(values.clone(), shape, size);
        for (i, sum) in sums.iter().enumerate() {
            let (x, y) = ((i % 7) as i32, (i / 7) as i32);
            let near = |j: &usize| {
                let (dx, dy) = ((j % 7) as i32 - x, (j / 7) as i32 - y);
                (-2..2).contains(&dx) && (-1..2).contains(&dy)
            };
            let written: f64 = (0..35).filter(near).map(|j| values[j]).sum();
            assert_eq!(*sum, written, "{x}, {y}");
        }
    }

    /// A whole lattice is left whole, whatever the noise.
    #[test]
    fn a_whole_lattice_has_no_misfits() {
        for seed in 0..20 {
            assert!(rest(&image(seed, |_| true)).is_none(), "{seed}");
        }
    }

    /// Where a fit leaves the lattice is taken out, but for a rim of half a box and a few pixels where the lattice is zero, and hardly more.
    #[test]
    fn holes_are_taken_out() {
        for seed in 0..5 {
            let place = Vector2::new(50.0 + 6.0 * seed as f64, 64.0);
            let far = |at: Vector2<f64>| (at - place).norm();
            let left = image(seed, |at| far(at) < RADIUS);
            let mut bins = Left::none([SIZE, SIZE], 1);
            add(&left.values, 1, &mut bins.squares, &mut bins.counts);
            let gone = bins.misfits([14, 14]).unwrap();
            let [mut inside, mut kept, mut beyond, mut lost] = [0; 4];
            for (i, gone) in gone.into_iter().enumerate() {
                let d = far(Vector2::new((i % SIZE) as f64, (i / SIZE) as f64));
                inside += usize::from(d < RADIUS - HALF);
                kept += usize::from(d < RADIUS - HALF && !gone);
                beyond += usize::from(d > RADIUS + 2.0 * HALF);
                lost += usize::from(d > RADIUS + 2.0 * HALF && gone);
            }
            assert!(10 * kept < inside, "{seed}: {kept} of {inside}");
            assert!(50 * lost < beyond, "{seed}: {lost} of {beyond}");
        }
    }

    /// The phases of a part are those at the mean place of its pixels, where the wave vectors do not matter: as certain as those of
    /// a frame of as many pixels.
    #[test]
    fn phases_of_a_part_hold_at_its_middle() {
        for seed in 0..5 {
            let mut part = image(seed, |_| true);
            for (i, value) in part.values.iter_mut().enumerate() {
                if i % SIZE < 70 || i / SIZE > 90 {
                    *value = f64::NAN;
                }
            }
            let start = Windowed::new(&part).fit(&part, &pair(), Background::Plane, shells(3));
            let fit = measure(&part, &start.unwrap(), Background::Plane)
                .unwrap()
                .fit;
            let middle = Vector2::new((70 + SIZE - 1) as f64 / 2.0, 45.0);
            assert!((fit.middle() - middle).norm() < 1e-9, "{}", fit.middle());
            let found = fit.first_phases();
            let pixels = ((SIZE - 70) * 91) as f64;
            for (i, q) in crate::numbers::three::three(&pair()).iter().enumerate() {
                let off = found.values[i] - q.dot(&middle);
                let off = off - (off / std::f64::consts::TAU).round() * std::f64::consts::TAU;
                let sigma = found.covariance[(i, i)].sqrt();
                // Amplitude 1, noise 0.3: variance 2 σ²/N. The noise is read off a part; at the centre of the frame it would be three times that.
                let bound = 0.3 * (2.0 / pixels).sqrt();
                assert!((0.5..2.0).contains(&(sigma / bound)), "{}", sigma / bound);
                assert!(off.abs() < 5.0 * bound, "{seed}: {off} ± {sigma}");
            }
        }
    }
}
