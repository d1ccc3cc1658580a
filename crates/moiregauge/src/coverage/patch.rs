//! The part of a frame that carries a lattice.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::coverage::cells::Cells;
use crate::frame::image::Image;
use crate::numbers::exact;

/// A lattice on more than this share of the frame is taken to be everywhere: noise and defects leave small gaps.
pub(crate) const WHOLE: f64 = 0.95;

/// The part of a frame that carries a lattice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LatticeRegion {
    /// The mean waves over it, rad per pixel.
    #[serde(with = "exact")]
    pub pair: Matrix2<f64>,
    /// Cells along columns and rows.
    pub size: [usize; 2],
    /// Pixels of a cell along columns and rows; the last cells may have fewer.
    pub pixels: [usize; 2],
    /// Whether a cell belongs to it, row by row from the bottom.
    pub inside: Vec<bool>,
    /// Share of the pixels that are there.
    #[serde(with = "exact")]
    pub share: f64,
    /// Unit cells of the lattice in it.
    #[serde(with = "exact")]
    pub unit_cells: f64,
}

impl LatticeRegion {
    /// The cell of the pixel at (column, row).
    fn cell(&self, [column, row]: [usize; 2]) -> usize {
        let cell = |axis: usize, at: usize| (at / self.pixels[axis]).min(self.size[axis] - 1);
        cell(1, row) * self.size[0] + cell(0, column)
    }

    /// Whether the pixel at (column, row) belongs to it.
    pub fn holds(&self, place: [usize; 2]) -> bool {
        self.inside[self.cell(place)]
    }

    /// Whether its cells are those of an image of this number of columns and rows.
    pub fn is_of(&self, image: [usize; 2]) -> bool {
        (0..2).all(|i| image[i].abs_diff(self.size[i] * self.pixels[i]) < 2 * self.pixels[i])
    }

    /// The middles of its cells, pixels.
    pub(crate) fn places(&self) -> Vec<Vector2<f64>> {
        let inside = (0..self.inside.len()).filter(|&i| self.inside[i]);
        let middle = |i: usize| {
            let cell = [i % self.size[0], i / self.size[0]];
            Vector2::from([0, 1].map(|k| (cell[k] as f64 + 0.5) * self.pixels[k] as f64 - 0.5))
        };
        inside.map(middle).collect()
    }

    /// Its outline: the sides of cells beyond which it ends, from point to point (column, row), where pixels lie at whole
    /// numbers.
    pub fn outline(&self) -> Vec<[Vector2<f64>; 2]> {
        let [across, up] = self.size;
        let holds = |x: Option<usize>, y: Option<usize>| match (x, y) {
            (Some(x), Some(y)) if x < across && y < up => self.inside[y * across + x],
            _ => false,
        };
        let corner = |x: usize, y: usize| {
            let at = Vector2::new((x * self.pixels[0]) as f64, (y * self.pixels[1]) as f64);
            at - Vector2::repeat(0.5)
        };
        let mut sides = Vec::new();
        for (x, y) in (0..self.inside.len()).map(|i| (i % across, i / across)) {
            if !holds(Some(x), Some(y)) {
                continue;
            }
            let around = [
                (
                    holds(x.checked_sub(1), Some(y)),
                    [corner(x, y), corner(x, y + 1)],
                ),
                (
                    holds(Some(x + 1), Some(y)),
                    [corner(x + 1, y), corner(x + 1, y + 1)],
                ),
                (
                    holds(Some(x), y.checked_sub(1)),
                    [corner(x, y), corner(x + 1, y)],
                ),
                (
                    holds(Some(x), Some(y + 1)),
                    [corner(x, y + 1), corner(x + 1, y + 1)],
                ),
            ];
            sides.extend(
                around
                    .into_iter()
                    .filter(|(goes_on, _)| !goes_on)
                    .map(|(_, side)| side),
            );
        }
        sides
    }

    /// The same in pixels of which `bins` make one along each axis.
    pub(crate) fn in_pixels(&self, bins: usize) -> Self {
        Self {
            pair: self.pair / bins as f64,
            pixels: self.pixels.map(|n| n * bins),
            ..self.clone()
        }
    }

    /// Its lowest and highest corner, pixels.
    pub(crate) fn corners(&self) -> [Vector2<f64>; 2] {
        let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(0.0f64));
        for i in (0..self.inside.len()).filter(|&i| self.inside[i]) {
            let cell = Vector2::new((i % self.size[0]) as f64, (i / self.size[0]) as f64);
            low = low.inf(&cell);
            high = high.sup(&cell);
        }
        let pixels = Vector2::from(self.pixels.map(|n| n as f64));
        [
            low.component_mul(&pixels),
            (high + Vector2::repeat(1.0)).component_mul(&pixels),
        ]
    }

    /// The mean place of its pixels.
    pub(crate) fn middle(&self, cells: &Cells) -> Vector2<f64> {
        let (mut sum, mut count) = (Vector2::zeros(), 0.0);
        for i in (0..self.inside.len()).filter(|&i| self.inside[i]) {
            sum += cells.middle_of(i) * cells.counts()[i];
            count += cells.counts()[i];
        }
        sum / count
    }

    /// The image with the pixels beside the patch missing.
    pub(crate) fn of(&self, image: &Image) -> Image {
        let values = image.values.iter().enumerate().map(|(i, value)| {
            if self.holds([i % image.columns, i / image.columns]) {
                *value
            } else {
                f64::NAN
            }
        });
        Image::new(image.rows, image.columns, values.collect())
    }
}

/// Unit cells of a lattice of waves (rad per pixel) in a pixel.
pub(crate) fn unit_cells_per_pixel(pair: &Matrix2<f64>) -> f64 {
    pair.determinant().abs() / std::f64::consts::TAU.powi(2)
}
