//! An image with the displacement of its pattern taken off: what it would show if the lattice were the mean lattice everywhere.
//!
//! The pattern that the mean lattice has at R is seen at `r = R + u(r)`. The pixel at R gets the value of the image at r, which is
//! found by iteration from the pixel before. Images are resampled only to be shown: nothing is measured here.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::frame::resample::at;
use crate::map::followed::Followed;
use crate::numbers::{MOST_ROUNDS, interrupt};

/// Largest number of pixels, that of 2048 × 2048: finer images are made coarser.
const MOST_PIXELS: f64 = 4_194_304.0;
/// Iterations end where a place moves by less than this share of a pixel.
const SETTLED: f64 = 1e-3;

/// An image of the mean lattice.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Undistorted {
    /// Rows from the bottom up, x to the right; NaN where the displacement is not known.
    pub image: Image,
    /// Distance of the pixels along x and y, nm.
    pub pitch: f64,
    /// Place of the bottom left pixel on the mean lattice, nm.
    pub origin: Vector2<f64>,
    /// Share of the pixels that are not missing.
    pub known: f64,
}

/// Takes the displacements off an image whose pixels are `placed` on the sample; `None` where there is nothing to show.
pub(crate) fn undistorted(
    image: &Image,
    placed: &Geometry,
    followed: &Followed,
) -> Option<Undistorted> {
    let pixel = placed.pixel_of()?;
    let starts = Starts::new(followed)?;
    let extent = starts.high - starts.low;
    let finest = placed.fast_step().norm().min(placed.slow_step().norm());
    let pitch = finest.max((extent.x * extent.y / MOST_PIXELS).sqrt());
    let count = |length: f64| (length / pitch + 1e-6).floor() as usize + 1;
    let (columns, rows) = (count(extent.x), count(extent.y));
    if image.rows < 2 || image.columns < 2 || columns < 2 || rows < 2 {
        return None;
    }
    let size = Vector2::new(columns as f64 - 1.0, rows as f64 - 1.0) * pitch;
    let origin = starts.low + 0.5 * (extent - size);
    let mut values = vec![0.0; rows * columns];
    let lines = values.par_chunks_exact_mut(columns).enumerate();
    lines.for_each(|(row, line)| {
        interrupt::check();
        let mut before = None;
        for (column, value) in line.iter_mut().enumerate() {
            let place = origin + pitch * Vector2::new(column as f64, row as f64);
            let from = before.or_else(|| starts.near(place));
            before = from.and_then(|from| settled(followed, place, from, SETTLED * pitch));
            *value = before.map_or(f64::NAN, |u| at(image, pixel(place + u)));
        }
    });
    let image = Image::new(rows, columns, values);
    let seen = image.values.iter().filter(|v| v.is_finite()).count();
    (seen > 0).then(|| Undistorted {
        known: seen as f64 / image.values.len() as f64,
        image,
        pitch,
        origin,
    })
}

/// The displacement u of what the mean lattice has at a place: `u = u(place + u)`, from a first guess.
fn settled(
    followed: &Followed,
    place: Vector2<f64>,
    mut guess: Vector2<f64>,
    close: f64,
) -> Option<Vector2<f64>> {
    for _ in 0..MOST_ROUNDS {
        let next = followed.at(place + guess)?;
        let moved = (next - guess).norm();
        guess = next;
        if moved < close {
            return Some(guess);
        }
    }
    None
}

/// Displacements by places of the mean lattice, to start from: in cells as wide as nodes are apart.
struct Starts {
    low: Vector2<f64>,
    high: Vector2<f64>,
    cell: f64,
    size: [usize; 2],
    displacements: Vec<Option<Vector2<f64>>>,
}

impl Starts {
    fn new(followed: &Followed) -> Option<Self> {
        let all = || followed.known().map(|(place, u)| (place - u, u));
        let (first, _) = all().next()?;
        let low = all().fold(first, |low, (place, _)| low.inf(&place));
        let high = all().fold(first, |high, (place, _)| high.sup(&place));
        let step: &Matrix2<f64> = &followed.grid.step;
        let cell = step.column(0).norm().max(step.column(1).norm());
        let size = [0, 1].map(|i| ((high - low)[i] / cell) as usize + 1);
        let mut starts = Self {
            low,
            high,
            cell,
            size,
            displacements: vec![None; size[0] * size[1]],
        };
        for (place, u) in all() {
            if let Some(index) = starts.index(place, [0, 0]) {
                starts.displacements[index] = Some(u);
            }
        }
        Some(starts)
    }

    /// The cell of a place, or one beside it.
    fn index(&self, place: Vector2<f64>, beside: [isize; 2]) -> Option<usize> {
        let along = |axis: usize| {
            let cell = ((place - self.low)[axis] / self.cell).floor() as isize + beside[axis];
            usize::try_from(cell).ok().filter(|c| *c < self.size[axis])
        };
        Some(along(1)? * self.size[0] + along(0)?)
    }

    /// What a node has that is not far from the place.
    fn near(&self, place: Vector2<f64>) -> Option<Vector2<f64>> {
        const AROUND: [[isize; 2]; 9] = [
            [0, 0],
            [-1, 0],
            [1, 0],
            [0, -1],
            [0, 1],
            [-1, -1],
            [1, -1],
            [-1, 1],
            [1, 1],
        ];
        let cells = AROUND.iter();
        cells
            .filter_map(|beside| self.index(place, *beside))
            .find_map(|index| self.displacements[index])
    }
}
