//! What is not lattice: mean, plane, low polynomials, and (on request) line means.
//!
//! In: an image; out: the image without its background. The polynomial is fitted by least squares
//! to all finite pixels in a basis of Legendre polynomials, which stays well conditioned on any
//! frame. Per-line levelling removes harmonics near the fast axis, so it is never the default.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::frame::image::Image;
use crate::numbers::dot::dot;
use crate::numbers::interrupt;
use crate::numbers::widest::widest;

/// The image without its background. Missing pixels stay missing.
pub fn remove_background(image: &Image, background: Background) -> Image {
    let mut flat = image.clone();
    take_background_off(&mut flat, background);
    flat
}

/// Takes the background off an image in its place.
pub(crate) fn take_background_off(image: &mut Image, background: Background) {
    match background {
        Background::Mean => take_polynomial_off(image, 0),
        Background::Plane => take_polynomial_off(image, 1),
        Background::Quadratic => take_polynomial_off(image, 2),
        Background::Cubic => take_polynomial_off(image, 3),
        Background::LineMean => {
            take_polynomial_off(image, 1);
            take_line_means_off(image);
        }
    }
}

/// Values of the Legendre polynomials 0 … 3 at `x` in [−1, 1].
fn legendre(x: f64) -> [f64; 4] {
    [
        1.0,
        x,
        0.5 * (3.0 * x * x - 1.0),
        0.5 * (5.0 * x * x - 3.0) * x,
    ]
}

/// Index `i` of `n` on [−1, 1].
fn position(i: usize, n: usize) -> f64 {
    if n > 1 {
        2.0 * i as f64 / (n - 1) as f64 - 1.0
    } else {
        0.0
    }
}

/// A polynomial over an image, by least squares.
pub(crate) struct Surface {
    terms: Vec<[usize; 2]>,
    coefficients: DVector<f64>,
    along: Along,
    rows: usize,
}

/// The polynomials at each column, degree by degree.
type Along = [Vec<f64>; 4];

/// Moments of a line along x: `Σ P_i P_j` and `Σ P_i` over its finite pixels, and `Σ P_i I`.
#[derive(Clone, Copy, Default)]
struct Moments {
    pp: [[f64; 4]; 4],
    pi: [f64; 4],
}

impl Moments {
    fn of(line: &[f64], along: &Along, degree: usize, whole: &[[f64; 4]; 4]) -> Self {
        if line.iter().all(|v| v.is_finite()) {
            let mut pi = [0.0; 4];
            for (sum, polynomial) in pi.iter_mut().zip(along).take(degree + 1) {
                *sum = dot(line, polynomial);
            }
            return Self { pp: *whole, pi };
        }
        let mut moments = Self::default();
        for (column, value) in line.iter().enumerate().filter(|(_, v)| v.is_finite()) {
            moments.add(along, column, *value, degree);
        }
        moments
    }

    fn add(&mut self, along: &Along, column: usize, value: f64, degree: usize) {
        for i in 0..=degree {
            self.pi[i] += along[i][column] * value;
            for j in 0..=i {
                self.pp[i][j] += along[i][column] * along[j][column];
            }
        }
    }
}

impl Surface {
    /// Fits a polynomial to all finite pixels; `None` where that cannot be done.
    pub(crate) fn fitted(image: &Image, degree: usize) -> Option<Self> {
        let terms: Vec<[usize; 2]> = (0..=degree)
            .flat_map(|total| (0..=total).map(move |y| [total - y, y]))
            .collect();
        let mut along = Along::default();
        for column in 0..image.columns {
            let values = legendre(position(column, image.columns));
            for (polynomial, value) in along.iter_mut().zip(values) {
                polynomial.push(value);
            }
        }
        let mut whole = Moments::default();
        for column in 0..image.columns {
            whole.add(&along, column, 0.0, degree);
        }
        let lines = (0..image.rows).into_par_iter().map(|row| {
            interrupt::check();
            Moments::of(image.row(row), &along, degree, &whole.pp)
        });
        let lines: Vec<Moments> = lines.collect();
        let n = terms.len();
        let mut normal = DMatrix::<f64>::zeros(n, n);
        let mut right = DVector::<f64>::zeros(n);
        for (row, Moments { pp, pi }) in lines.iter().enumerate() {
            let across = legendre(position(row, image.rows));
            for (a, &[ax, ay]) in terms.iter().enumerate() {
                right[a] += across[ay] * pi[ax];
                for (b, &[bx, by]) in terms.iter().enumerate() {
                    normal[(a, b)] += across[ay] * across[by] * pp[ax.max(bx)][ax.min(bx)];
                }
            }
        }
        // The pseudo-inverse copes with frames of a single line or no finite pixel at all.
        let scale = normal.amax();
        let inverse = normal.pseudo_inverse(1e-12 * scale.max(f64::MIN_POSITIVE));
        Some(Self {
            coefficients: inverse.ok()? * right,
            terms,
            along,
            rows: image.rows,
        })
    }

    /// Takes the polynomial off the values of some columns of a line.
    pub(crate) fn take_off(&self, row: usize, columns: Range<usize>, values: &mut [f64]) {
        let across = legendre(position(row, self.rows));
        let mut line = [0.0; 4];
        for (c, &[x, y]) in self.coefficients.iter().zip(&self.terms) {
            line[x] += c * across[y];
        }
        let [p0, p1, p2, p3] = self.along.each_ref().map(|p| &p[columns.clone()]);
        widest(
            #[inline(always)]
            || {
                let polynomials = p0.iter().zip(p1).zip(p2.iter().zip(p3));
                for (value, ((p0, p1), (p2, p3))) in values.iter_mut().zip(polynomials) {
                    *value -= line[0] * p0 + line[1] * p1 + line[2] * p2 + line[3] * p3;
                }
            },
        );
    }
}

fn take_polynomial_off(image: &mut Image, degree: usize) {
    let Some(surface) = Surface::fitted(image, degree) else {
        return;
    };
    let columns = image.columns;
    let lines = image.values.par_chunks_mut(columns.max(1)).enumerate();
    lines.for_each(|(row, line)| {
        interrupt::check();
        surface.take_off(row, 0..columns, line);
    });
}

fn take_line_means_off(image: &mut Image) {
    let columns = image.columns;
    for line in image.values.chunks_exact_mut(columns) {
        let (sum, count) = line
            .iter()
            .filter(|v| v.is_finite())
            .fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
        let mean = sum / count.max(1) as f64;
        for value in line {
            *value -= mean;
        }
    }
}

/// What is subtracted from an image before its lattice is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Background {
    /// Nothing but the mean.
    Mean,
    /// The mean plane.
    Plane,
    /// A 2D polynomial of total degree 2.
    Quadratic,
    /// A 2D polynomial of total degree 3.
    Cubic,
    /// The mean plane and then the mean of each line. Damages harmonics along the fast axis.
    LineMean,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cubic surface vanishes under the cubic background, to rounding, on any shape and with
    /// missing pixels.
    #[test]
    fn a_cubic_surface_vanishes() {
        let (rows, columns) = (23, 41);
        let values = (0..rows * columns)
            .map(|i| {
                let (x, y) = ((i % columns) as f64, (i / columns) as f64);
                if i % 7 == 3 {
                    f64::NAN
                } else {
                    2.0 - x + 0.3 * y + 0.01 * x * y - 1e-3 * x * x * y + 1e-3 * y * y * y
                }
            })
            .collect();
        let flat = remove_background(&Image::new(rows, columns, values), Background::Cubic);
        for (i, v) in flat.values.iter().enumerate() {
            assert!(v.is_nan() == (i % 7 == 3));
            assert!(v.is_nan() || v.abs() < 1e-10, "{v}");
        }
    }

    /// The plane leaves a curved surface with zero mean and zero mean slope, and no line of the
    /// image is touched on its own: two lines that differ by a constant still do.
    #[test]
    fn a_plane_is_no_line_levelling() {
        let image = Image::new(
            16,
            16,
            (0..256)
                .map(|i| if i / 16 == 5 { 1.0 } else { 0.0 })
                .collect(),
        );
        let plane = remove_background(&image, Background::Plane);
        assert!(plane.row(5)[3] - plane.row(6)[3] > 0.9);
        assert!(plane.values.iter().sum::<f64>().abs() < 1e-9);
        let levelled = remove_background(&image, Background::LineMean);
        assert!(levelled.row(5)[3].abs() < 1e-9);
    }
}
