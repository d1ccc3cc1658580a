//! What is not lattice: mean, plane, low polynomials, and (on request) line means.
//!
//! In: an image; out: the image without its background. The polynomial is fitted by least squares
//! to all finite pixels in a basis of Legendre polynomials, which stays well conditioned on any
//! frame. Per-line levelling removes harmonics near the fast axis, so it is never the default.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::frame::image::Image;
use crate::numbers::interrupt;

/// The image without its background. Missing pixels stay missing.
pub fn remove_background(image: &Image, background: Background) -> Image {
    match background {
        Background::Mean => without_polynomial(image, 0),
        Background::Plane => without_polynomial(image, 1),
        Background::Quadratic => without_polynomial(image, 2),
        Background::Cubic => without_polynomial(image, 3),
        Background::LineMean => without_line_means(without_polynomial(image, 1)),
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

fn without_polynomial(image: &Image, degree: usize) -> Image {
    let terms: Vec<[usize; 2]> = (0..=degree)
        .flat_map(|total| (0..=total).map(move |y| [total - y, y]))
        .collect();
    let along: Vec<[f64; 4]> = (0..image.columns)
        .map(|c| legendre(position(c, image.columns)))
        .collect();
    let n = terms.len();
    let mut normal = DMatrix::<f64>::zeros(n, n);
    let mut right = DVector::<f64>::zeros(n);
    for row in 0..image.rows {
        interrupt::check();
        // Moments of this line along x: Σ P_i and Σ P_i P_j over its finite pixels, and Σ P_i I.
        let (mut pp, mut pi) = ([[0.0; 4]; 4], [0.0; 4]);
        for (value, p) in image.row(row).iter().zip(&along) {
            if !value.is_finite() {
                continue;
            }
            for i in 0..=degree {
                pi[i] += p[i] * value;
                for j in 0..=i {
                    pp[i][j] += p[i] * p[j];
                }
            }
        }
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
    let Ok(inverse) = normal.pseudo_inverse(1e-12 * scale.max(f64::MIN_POSITIVE)) else {
        return image.clone();
    };
    let coefficients = inverse * right;
    let mut out = image.clone();
    for row in 0..image.rows {
        let across = legendre(position(row, image.rows));
        let mut line = [0.0; 4];
        for (c, &[x, y]) in coefficients.iter().zip(&terms) {
            line[x] += c * across[y];
        }
        let values = &mut out.values[row * image.columns..(row + 1) * image.columns];
        for (value, p) in values.iter_mut().zip(&along) {
            *value -= line[0] * p[0] + line[1] * p[1] + line[2] * p[2] + line[3] * p[3];
        }
    }
    out
}

fn without_line_means(mut image: Image) -> Image {
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
    image
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
