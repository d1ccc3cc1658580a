//! The averaged moiré cell: the local phases of each pixel give its position in the cell of the mean lattice.
//!
//! A pixel at r has the position `L⁻¹(r − u(r) − r₀)` in the cell, which is (φ₁, φ₂)/2π of the waves dual to L. This holds for distorted lattices too, which a
//! single lattice for the whole image would smear. The error of a bin comes from the scatter of the moiré cells about the mean. Each cell enters with the
//! sum of its pixels in the bin, so that correlated noise of neighbouring pixels is included:
//!
//! ```text
//! σ² = K/(K − 1) Σ_c (s_c − n_c m)²/n²      m = Σ_c s_c/n,  n = Σ_c n_c,  K cells
//! ```

use std::ops::Range;

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::map::followed::Followed;
use crate::numbers::interrupt;

/// Most bins along each vector.
const MOST_BINS: usize = 64;
/// Fewest pixels of a bin, on average.
const LEAST_PIXELS: f64 = 9.0;

/// Fewest cells that the pixels cover together: one cell has no scatter.
const LEAST_CELLS: f64 = 2.0;

/// The mean of all cells of a pattern.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MeanCell {
    /// Moiré vectors of the mean lattice as columns, nm; the node of the pattern is at the corners of the cell.
    pub vectors: Matrix2<f64>,
    /// Bins along each of them: bin (i, j), number `j · bins + i`, covers from i/bins to (i + 1)/bins along the first.
    pub bins: usize,
    /// Mean of each bin in units of the image, with the mean of the image in it; NaN for a bin without pixels.
    pub mean: Vec<f64>,
    /// Standard error of each mean; NaN if fewer than two cells have pixels in the bin.
    pub sigma: Vec<f64>,
    /// Pixels of each bin.
    pub pixels: Vec<u32>,
    /// Number of cells with pixels in each bin.
    pub cells: Vec<u32>,
    /// Number of cells with at least one pixel that was used.
    pub all_cells: usize,
}

impl MeanCell {
    /// Centre of a bin as fractions of the two vectors.
    pub fn share(&self, bin: usize) -> Vector2<f64> {
        let [i, j] = [bin % self.bins, bin / self.bins].map(|n| n as f64 + 0.5);
        Vector2::new(i, j) / self.bins as f64
    }
}

/// Averages the cells of an image; `placed` gives the positions of its pixels on the sample. `None` if pixels with known phases cover
/// fewer than two cells.
pub(crate) fn mean_cell(image: &Image, placed: &Geometry, followed: &Followed) -> Option<MeanCell> {
    let vectors = followed.gauge.vectors;
    let pitch = placed.fast_step().norm().min(placed.slow_step().norm());
    let longest = vectors.column(0).norm().max(vectors.column(1).norm());
    let wanted = ((longest / pitch).round() as usize).clamp(2, MOST_BINS);
    let mut found = Found::new(image, placed, followed, wanted);
    let area = found.known as f64 * placed.pixel_to_nm.determinant().abs();
    if !(area >= LEAST_CELLS * vectors.determinant().abs()) {
        return None;
    }
    let most = (found.known as f64 / LEAST_PIXELS).sqrt() as usize;
    let bins = wanted.min(most).max(2);
    if bins < wanted {
        found = Found::new(image, placed, followed, bins);
    }
    let mut sums = Sums::new(bins, image);
    for cells in found.cells().chunks(CELLS_AT_ONCE) {
        interrupt::check();
        sums.add_cells(cells, &found.bins, image);
    }
    Some(sums.finish(vectors))
}

/// Where the pixels of an image lie in the cells of its pattern.
struct Found {
    /// Bin of each pixel within its cell; meaningless for pixels outside of all runs.
    bins: Vec<u16>,
    /// Runs of pixels within one cell, ordered by cell, then by pixel.
    runs: Vec<Run>,
    /// Number of pixels in all runs.
    known: usize,
}

/// Neighbouring pixels of a row that lie in one cell.
struct Run {
    /// Index of the cell along the second vector and along the first.
    cell: [i32; 2],
    first: u32,
    count: u32,
}

impl Run {
    fn pixels(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

impl Found {
    fn new(image: &Image, placed: &Geometry, followed: &Followed, bins: usize) -> Self {
        let mut found = vec![0; image.values.len()];
        let rows = found.par_chunks_exact_mut(image.columns).enumerate();
        let rows = rows.map(|(row, of_pixels)| {
            interrupt::check();
            let place = |column: usize| {
                let place = [column, row].map(|n| n as f64);
                let place = placed.at(Vector2::from(place));
                Some(followed.cells(place, followed.at(place)?))
            };
            runs(image, row, bins, of_pixels, place)
        });
        let rows: Vec<Vec<Run>> = rows.collect();
        let mut runs: Vec<Run> = rows.into_iter().flatten().collect();
        runs.par_sort_unstable_by_key(|run| (run.cell, run.first));
        Self {
            known: runs.iter().map(|run| run.count as usize).sum(),
            bins: found,
            runs,
        }
    }

    /// The runs of every cell.
    fn cells(&self) -> Vec<&[Run]> {
        self.runs.chunk_by(|a, b| a.cell == b.cell).collect()
    }
}

/// Writes the bin of each pixel of a row into `of_pixels` and returns the runs. `place` gives the position of a column in units of the moiré vectors.
fn runs(
    image: &Image,
    row: usize,
    bins: usize,
    of_pixels: &mut [u16],
    place: impl Fn(usize) -> Option<Vector2<f64>>,
) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    let start = row * image.columns;
    for (column, bin) in of_pixels.iter_mut().enumerate() {
        let pixel = start + column;
        let known = image.values[pixel].is_finite().then(|| place(column));
        let Some(place) = known.flatten() else {
            continue;
        };
        // In single precision: some 10⁻⁴ of a cell in a thousand of them, far below a bin.
        let [[i, x], [j, y]] = [place.x, place.y].map(|x| below(x as f32));
        let [x, y] = [x, y].map(|share| ((share * bins as f32) as usize).min(bins - 1));
        *bin = (y * bins + x) as u16;
        let cell = [j as i32, i as i32];
        match runs.last_mut() {
            Some(run) if run.cell == cell && run.pixels().end == pixel => run.count += 1,
            _ => runs.push(Run {
                cell,
                first: pixel as u32,
                count: 1,
            }),
        }
    }
    runs
}

/// Integer part (rounded down) and fractional part.
fn below(x: f32) -> [f32; 2] {
    let whole = x as i32 as f32;
    let whole = if whole > x { whole - 1.0 } else { whole };
    [whole, x - whole]
}

/// Cells whose sums are formed together, so that these fit into the cache.
const CELLS_AT_ONCE: usize = 64;

/// Sums over cells for each bin.
struct Sums {
    bins: usize,
    /// Mean of the image, subtracted from all values to avoid cancellation in the squares.
    middle: f64,
    all_cells: usize,
    of_bins: Vec<OfBin>,
}

/// Sums of one bin.
#[derive(Clone, Copy, Default)]
struct OfBin {
    pixels: u32,
    cells: u32,
    /// Σ s, Σ s², Σ s n and Σ n² over cells.
    over_cells: [f64; 4],
}

impl OfBin {
    /// Adds the sum over some pixels of a cell.
    fn add(&mut self, sum: f64, pixels: u32) {
        let n = f64::from(pixels);
        for (all, term) in self
            .over_cells
            .iter_mut()
            .zip([sum, sum * sum, sum * n, n * n])
        {
            *all += term;
        }
        self.pixels += pixels;
        self.cells += 1;
    }
}

impl Sums {
    fn new(bins: usize, image: &Image) -> Self {
        let finite = image.values.iter().filter(|v| v.is_finite());
        let (sum, count) = finite.fold((0.0, 0.0f64), |(s, n), v| (s + v, n + 1.0));
        Self {
            bins,
            middle: sum / count,
            all_cells: 0,
            of_bins: vec![OfBin::default(); bins * bins],
        }
    }

    /// Adds the pixels of some cells. The order of the sums does not depend on the number of threads: cells are summed one by one, then
    /// added to each bin in order.
    fn add_cells(&mut self, cells: &[&[Run]], bins: &[u16], image: &Image) {
        let of_cell = |runs: &&[Run]| {
            let mut own = vec![(0.0, 0u32); self.bins * self.bins];
            for run in *runs {
                let values = &image.values[run.pixels()];
                for (value, bin) in values.iter().zip(&bins[run.pixels()]) {
                    let own = &mut own[usize::from(*bin)];
                    own.0 += value - self.middle;
                    own.1 += 1;
                }
            }
            own
        };
        let own: Vec<_> = cells.par_iter().map(of_cell).collect();
        self.all_cells += cells.len();
        let lines = self.of_bins.par_chunks_mut(self.bins).enumerate();
        lines.for_each(|(line, all)| {
            let start = line * self.bins;
            for own in &own {
                let own = &own[start..start + all.len()];
                for (bin, (sum, pixels)) in all.iter_mut().zip(own).filter(|(_, own)| own.1 > 0) {
                    bin.add(*sum, *pixels);
                }
            }
        });
    }

    fn finish(self, vectors: Matrix2<f64>) -> MeanCell {
        let found = self.of_bins.iter().map(|bin| {
            let [s, ss, sn, nn] = bin.over_cells;
            let (n, k) = (f64::from(bin.pixels), f64::from(bin.cells));
            let mean = s / n;
            let square = (ss - 2.0 * mean * sn + mean * mean * nn).max(0.0);
            let variance = k / (k - 1.0) * square / (n * n);
            let sigma = if bin.cells > 1 {
                variance.sqrt()
            } else {
                f64::NAN
            };
            (self.middle + mean, sigma)
        });
        let (mean, sigma) = found.unzip();
        MeanCell {
            vectors,
            bins: self.bins,
            mean,
            sigma,
            pixels: self.of_bins.iter().map(|bin| bin.pixels).collect(),
            cells: self.of_bins.iter().map(|bin| bin.cells).collect(),
            all_cells: self.all_cells,
        }
    }
}
