//! The averaged moiré cell: every pixel put by its local phases into the cell of the mean lattice.
//!
//! A pixel at r shows the place `L⁻¹(r − u(r) − r₀)` of the cell, which is (φ₁, φ₂)/2π of the waves dual to L, also where the lattice bends, where averaging by one
//! lattice for the whole image smears. The error of a bin is seen from how the moiré cells of the image scatter about it,
//! each with the sum of its pixels in the bin, so that noise that neighbouring pixels share counts:
//!
//! ```text
//! σ² = K/(K − 1) Σ_c (s_c − n_c m)²/n²      m = Σ_c s_c/n,  n = Σ_c n_c,  K cells
//! ```

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::map::followed::Followed;
use crate::numbers::interrupt;

/// Bins along each vector, at most; ...
const MOST_BINS: usize = 64;
/// ... and pixels of a bin, at least, in the mean.
const LEAST_PIXELS: f64 = 9.0;

/// Cells that the pixels have to cover together: of fewer there is no mean, and nothing that scatters.
const LEAST_CELLS: f64 = 2.0;

/// The mean of all cells of a pattern.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MeanCell {
    /// Moiré vectors of the mean lattice as columns, nm; the node of the pattern is at the corners of the cell.
    pub vectors: Matrix2<f64>,
    /// Bins along each of them: bin (i, j), number `j · bins + i`, covers from i/bins to (i + 1)/bins along the first.
    pub bins: usize,
    /// Mean of each bin, units of the image, from which the mean of the image is not taken off; NaN where no pixel fell.
    pub mean: Vec<f64>,
    /// Its standard error; NaN where fewer than two cells have pixels in it.
    pub sigma: Vec<f64>,
    /// Pixels of each bin.
    pub pixels: Vec<u32>,
    /// Cells of the image with pixels in it.
    pub cells: Vec<u32>,
    /// Cells of the image of which any pixel was used.
    pub all_cells: usize,
}

impl MeanCell {
    /// Place of the middle of a bin in shares of the two vectors.
    pub fn share(&self, bin: usize) -> Vector2<f64> {
        let [i, j] = [bin % self.bins, bin / self.bins].map(|n| n as f64 + 0.5);
        Vector2::new(i, j) / self.bins as f64
    }
}

/// Averages the cells of an image whose pixels are `placed` on the sample; `None` where fewer than two
/// cells of the pattern are known.
pub(crate) fn mean_cell(image: &Image, placed: &Geometry, followed: &Followed) -> Option<MeanCell> {
    let places = places(image, placed, followed);
    let known = places.iter().filter(|p| p[0].is_finite()).count();
    let vectors = followed.gauge.vectors;
    let area = known as f64 * placed.pixel_to_nm.determinant().abs();
    if !(area >= LEAST_CELLS * vectors.determinant().abs()) {
        return None;
    }
    let pitch = placed.fast_step().norm().min(placed.slow_step().norm());
    let longest = vectors.column(0).norm().max(vectors.column(1).norm());
    let most = (known as f64 / LEAST_PIXELS).sqrt() as usize;
    let bins = ((longest / pitch).round() as usize)
        .min(most)
        .clamp(2, MOST_BINS);
    let mut sums = Sums::new(bins, image);
    by_cell(&places, |pixels| sums.add_cell(pixels, &places, image));
    Some(sums.finish(vectors))
}

/// Where each pixel lies, in moiré vectors from the node; NaN where it is not known. In single precision: some 10⁻⁴ of a
/// cell in a thousand of them, far below a bin.
fn places(image: &Image, placed: &Geometry, followed: &Followed) -> Vec<[f32; 2]> {
    let of_row = |row: usize| {
        interrupt::check();
        let of_pixel = move |column: usize| {
            let place =
                placed.origin + placed.pixel_to_nm * Vector2::new(column as f64, row as f64);
            let value = image.values[row * image.columns + column];
            let known = value.is_finite().then(|| followed.at(place)).flatten();
            known.map_or([f32::NAN; 2], |u| {
                let cells = followed.cells(place, u);
                [cells.x as f32, cells.y as f32]
            })
        };
        (0..image.columns).map(of_pixel)
    };
    let rows = (0..image.rows).into_par_iter();
    rows.flat_map_iter(of_row).collect()
}

/// Calls `each` with the pixels of every cell, in a fixed order.
fn by_cell(places: &[[f32; 2]], mut each: impl FnMut(&[u32])) {
    let known = || places.iter().filter(|p| p[0].is_finite());
    let first = [0, 1].map(|i| known().map(|p| p[i].floor() as i64).min().unwrap_or(0));
    let last = known().map(|p| p[0].floor() as i64).max().unwrap_or(0);
    let columns = (last - first[0] + 1) as usize;
    let cell = |p: &[f32; 2]| {
        let [i, j] = [0, 1].map(|i| (p[i].floor() as i64 - first[i]) as usize);
        j * columns + i
    };
    // A counting sort.
    let mut ends = vec![0u32; known().map(cell).max().unwrap_or(0) + 2];
    for place in known() {
        ends[cell(place) + 1] += 1;
    }
    for n in 1..ends.len() {
        ends[n] += ends[n - 1];
    }
    let starts = ends.clone();
    let mut sorted = vec![0u32; starts.last().copied().unwrap_or(0) as usize];
    let mut next = ends;
    for (pixel, place) in places.iter().enumerate() {
        if place[0].is_finite() {
            let slot = &mut next[cell(place)];
            sorted[*slot as usize] = pixel as u32;
            *slot += 1;
        }
    }
    for range in starts.windows(2).filter(|range| range[0] < range[1]) {
        interrupt::check();
        each(&sorted[range[0] as usize..range[1] as usize]);
    }
}

/// What is summed over cells, bin by bin.
struct Sums {
    bins: usize,
    /// Taken off all values, lest squares of a large mean drown their differences.
    middle: f64,
    pixels: Vec<u32>,
    cells: Vec<u32>,
    all_cells: usize,
    /// Σ s, Σ s², Σ s n and Σ n² over cells.
    over_cells: Vec<[f64; 4]>,
    /// Of the cell at hand: s and n of each bin.
    own: Vec<(f64, u32)>,
}

impl Sums {
    fn new(bins: usize, image: &Image) -> Self {
        let finite = image.values.iter().filter(|v| v.is_finite());
        let (sum, count) = finite.fold((0.0, 0.0f64), |(s, n), v| (s + v, n + 1.0));
        let all = bins * bins;
        Self {
            bins,
            middle: sum / count,
            pixels: vec![0; all],
            cells: vec![0; all],
            all_cells: 0,
            over_cells: vec![[0.0; 4]; all],
            own: vec![(0.0, 0); all],
        }
    }

    /// Adds the pixels of a cell.
    fn add_cell(&mut self, pixels: &[u32], places: &[[f32; 2]], image: &Image) {
        let along = |x: f32| ((x - x.floor()) * self.bins as f32) as usize;
        for &pixel in pixels {
            let [x, y] = places[pixel as usize];
            let [i, j] = [x, y].map(|x| along(x).min(self.bins - 1));
            let own = &mut self.own[j * self.bins + i];
            own.0 += image.values[pixel as usize] - self.middle;
            own.1 += 1;
        }
        self.all_cells += 1;
        let bins = self.own.iter_mut().zip(&mut self.over_cells);
        for (bin, (own, sums)) in bins.enumerate().filter(|(_, (own, _))| own.1 > 0) {
            let (s, n) = (own.0, f64::from(own.1));
            for (sum, term) in sums.iter_mut().zip([s, s * s, s * n, n * n]) {
                *sum += term;
            }
            self.pixels[bin] += own.1;
            self.cells[bin] += 1;
            *own = (0.0, 0);
        }
    }

    fn finish(self, vectors: Matrix2<f64>) -> MeanCell {
        let bins = self.over_cells.iter().zip(&self.pixels).zip(&self.cells);
        let found = bins.map(|((&[s, ss, sn, nn], &pixels), &cells)| {
            let (n, k) = (f64::from(pixels), f64::from(cells));
            let mean = s / n;
            let square = (ss - 2.0 * mean * sn + mean * mean * nn).max(0.0);
            let variance = k / (k - 1.0) * square / (n * n);
            let sigma = if cells > 1 { variance.sqrt() } else { f64::NAN };
            (self.middle + mean, sigma)
        });
        let (mean, sigma) = found.unzip();
        MeanCell {
            vectors,
            bins: self.bins,
            mean,
            sigma,
            pixels: self.pixels,
            cells: self.cells,
            all_cells: self.all_cells,
        }
    }
}
