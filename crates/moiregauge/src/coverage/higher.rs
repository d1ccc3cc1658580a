//! What higher harmonics and the background put into the windows.
//!
//! A window that an edge cuts off sees a second shell, or a slope, in the first shell, by some hundredths of a cycle, and the
//! windows beside each other see the same. So a quadratic background and the higher harmonics, as powers of the first waves as these
//! run there, are fitted over the patch and taken off. What is left beside all of them is noise.

use nalgebra::{DMatrix, DVector, Vector2};
use rustfft::num_complex::Complex64;

use crate::coverage::cells::Cells;
use crate::coverage::nodes::View;
use crate::coverage::patch::LatticeRegion;
use crate::coverage::phases::Fit;
use crate::frame::image::Image;
use crate::numbers::median::median;
use crate::numbers::normal_equations::NormalEquations;
use crate::spectrum::shells::FASTEST;

/// The first shell, as multiples of K₁ and K₂.
const FIRST: [[i32; 2]; 3] = [[1, 0], [0, 1], [-1, 1]];

/// The second, third and fourth shell of a hexagon.
const HIGHER: [[i32; 2]; 12] = [
    [1, 1],
    [-1, 2],
    [2, -1],
    [2, 0],
    [0, 2],
    [2, -2],
    [2, 1],
    [1, 2],
    [3, -1],
    [3, -2],
    [1, -3],
    [2, -3],
];

/// Unknowns are let go where the pixels tell so little of them, as a share of what they would tell alone.
const HELD: f64 = 1e-9;

/// Numbers of a quadratic background.
const BACKGROUND: usize = 6;

/// An image and what is left of it.
pub(crate) struct Parts {
    /// The image without background and higher harmonics; missing beside the patch.
    pub(crate) first: Image,
    /// The image without all of its harmonics.
    left: Image,
}

/// Takes the higher harmonics off. `fit`: how the phases of the first waves run.
pub(crate) fn parts(view: &View, patch: &LatticeRegion, fit: &Fit) -> Option<Parts> {
    let image = view.image;
    let names: Vec<[i32; 2]> = FIRST
        .into_iter()
        .chain(HIGHER)
        .filter(|[h, k]| {
            let q = patch.pair * Vector2::new(f64::from(*h), f64::from(*k));
            q.amax() < FASTEST
        })
        .collect();
    let size = BACKGROUND + 2 * names.len();
    let [low, high] = patch.corners();
    let inside: Vec<usize> = (0..image.values.len())
        .filter(|&i| {
            image.values[i].is_finite() && patch.holds([i % image.columns, i / image.columns])
        })
        .collect();
    let row = |pixel: usize| {
        let at = Vector2::new(
            (pixel % image.columns) as f64,
            (pixel / image.columns) as f64,
        );
        let place = (at - low)
            .component_div(&(high - low))
            .map(|x| 2.0 * x - 1.0);
        waves(view, fit, patch, [at, place], &names)
    };
    let mut normal = DMatrix::zeros(size, size);
    let mut right = DVector::zeros(size);
    for &pixel in &inside {
        let row = row(pixel);
        right.axpy(image.values[pixel], &row, 1.0);
        normal.syger(1.0, &row, &row, 1.0);
    }
    normal.fill_upper_triangle_with_lower_triangle();
    let units = NormalEquations::units(&normal);
    let found = NormalEquations::new(&normal, units, |_| HELD)?.solve(&right);
    let missing = || {
        Image::new(
            image.rows,
            image.columns,
            vec![f64::NAN; image.values.len()],
        )
    };
    let (mut first, mut left) = (missing(), missing());
    let first_shell = |values: &DVector<f64>| values.rows(BACKGROUND, 2 * FIRST.len()).into_owned();
    let found_first = first_shell(&found);
    for &pixel in &inside {
        let row = row(pixel);
        let all = row.dot(&found);
        let shell = first_shell(&row).dot(&found_first);
        first.values[pixel] = image.values[pixel] - (all - shell);
        left.values[pixel] = image.values[pixel] - all;
    }
    Some(Parts { first, left })
}

/// The background, and cosine and sine of each harmonic. `at` in pixels, `place` on −1 … 1.
fn waves(
    view: &View,
    fit: &Fit,
    patch: &LatticeRegion,
    [at, place]: [Vector2<f64>; 2],
    names: &[[i32; 2]],
) -> DVector<f64> {
    let n = fit.basis.len();
    let first = [0, 1].map(|i| patch.pair.column(i).into_owned());
    let mut bent = view.turned(at, first);
    for (i, [value, ..]) in fit.basis.at(at) {
        bent[0] += fit.coefficients[i] * value;
        bent[1] += fit.coefficients[n + i] * value;
    }
    let phases = [0, 1].map(|i| first[i].dot(&at) + bent[i]);
    let mut row = DVector::zeros(BACKGROUND + 2 * names.len());
    let (x, y) = (place.x, place.y);
    row.rows_mut(0, BACKGROUND)
        .copy_from_slice(&[1.0, x, y, x * x, x * y, y * y]);
    for (i, [h, k]) in names.iter().enumerate() {
        let (sin, cos) = (f64::from(*h) * phases[0] + f64::from(*k) * phases[1]).sin_cos();
        row[BACKGROUND + 2 * i] = cos;
        row[BACKGROUND + 2 * i + 1] = sin;
    }
    row
}

impl Parts {
    /// Noise power per pixel at some places (rad per pixel), as the median of the windows of `periods` in the patch sees it.
    pub(crate) fn noise(
        &self,
        cells: &Cells,
        patch: &LatticeRegion,
        periods: f64,
        places: &[[Vector2<f64>; 2]; 3],
    ) -> [f64; 3] {
        let cells = cells.of_part(&self.left);
        let window = cells.window(periods);
        let level = |q: Vector2<f64>| {
            let envelope: Vec<Complex64> = cells.envelope(&cells.mixed(&self.left, q), &window);
            let inside = (0..cells.len()).filter(|&i| patch.inside[i]);
            let powers = inside.map(|i| envelope[i].norm_sqr() / window.noise[i]);
            median(&mut powers.collect::<Vec<f64>>()) / std::f64::consts::LN_2
        };
        places.map(|[a, b]| f64::midpoint(level(a), level(b)))
    }
}
