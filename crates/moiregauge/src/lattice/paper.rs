//! Lattice vectors as published, for reproduction: resampled image, summed autocorrelation,
//! whole-pixel peaks, σ = 1.5/√3 pixels per component.
//!
//! Two errors are part of the method. The autocorrelation is not divided by the overlap, which falls
//! with the lag, so peaks move inwards: lengths come out too short by about a per cent at four to
//! five periods. And whole pixels quantise every vector.
//!
//! # References
//! Tran et al., arXiv:2406.08681.

use heterostrain::lattice::{Lattice, Px, three_vectors};
use nalgebra::{Matrix2, Matrix6, Vector2};
use serde::{Deserialize, Serialize};

use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::numbers::exact;
use crate::spectrum::transform::Spectrum;

/// The assumed half-width of a peak, pixels; a uniform distribution of that width has σ = w/√3.
const PEAK_HALF_WIDTH: f64 = 1.5;

/// Peaks of the autocorrelation as published: each for itself, not made to close.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PublishedPeaks {
    /// Three of the six peaks, about 60° apart; the others are their opposites. Pixels (columns, rows).
    #[serde(with = "exact")]
    pub vectors: [Vector2<f64>; 3],
    /// Covariance of each, px²: a uniform distribution over ±1.5 steps of the grid along x and along y.
    #[serde(with = "exact")]
    pub covariance: Matrix2<f64>,
}

/// Measures the three vectors (px of the original image), looking around `start` (px): the lattice that fits them
/// best, and the peaks themselves.
///
/// `None` where the frame is too small to hold the peaks.
pub(crate) fn measure(
    image: &Image,
    geometry: &Geometry,
    start: &Matrix2<f64>,
) -> Option<(Lattice<Px>, PublishedPeaks)> {
    let (grid, pitch) = resampled(image, geometry)?;
    let spectrum = Spectrum::unwindowed(&grid);
    let summed = spectrum.summed_autocorrelation();
    let to_grid = Matrix2::from_diagonal(&pitch.map(|p| 1.0 / p)) * geometry.pixel_to_nm;
    let expected = to_grid * start;
    let third = expected.column(1) - expected.column(0);
    let radius = 0.35
        * expected
            .column(0)
            .norm()
            .min(expected.column(1).norm())
            .min(third.norm());
    let highest = |near: Vector2<f64>| {
        let reach = radius.ceil() as i64;
        let mut best: Option<(f64, Vector2<f64>)> = None;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let (x, y) = (near.x.round() as i64 + dx, near.y.round() as i64 + dy);
                let lag = Vector2::new(x as f64, y as f64);
                let value = summed.at(x, y)?;
                if (lag - near).norm() <= radius && best.is_none_or(|(top, _)| value > top) {
                    best = Some((value, lag));
                }
            }
        }
        best.map(|(_, lag)| lag.component_mul(&pitch))
    };
    let vectors = [
        highest(expected.column(0).into_owned())?,
        highest(expected.column(1).into_owned())?,
        highest(third)?,
    ];
    let sigma = pitch * (PEAK_HALF_WIDTH / 3.0f64.sqrt());
    let variances = [sigma.x, sigma.y, sigma.x, sigma.y, sigma.x, sigma.y].map(|s| s * s);
    let (lattice, _closure) = three_vectors(&vectors, &Matrix6::from_diagonal(&variances.into()));
    let to_pixels = geometry.pixel_to_nm.try_inverse()?;
    let peaks = PublishedPeaks {
        vectors: vectors.map(|v| to_pixels * v),
        covariance: to_pixels
            * Matrix2::from_diagonal(&sigma.component_mul(&sigma))
            * to_pixels.transpose(),
    };
    Some((lattice.in_pixels(&to_pixels), peaks))
}

/// The image on a regular x, y grid over its bounding box, and the pitch of that grid, nm.
///
/// Points outside the frame are 0, the mean of the image.
fn resampled(image: &Image, geometry: &Geometry) -> Option<(Image, Vector2<f64>)> {
    let [columns, rows] = [image.columns as f64 - 1.0, image.rows as f64 - 1.0];
    let corners = [
        Vector2::zeros(),
        Vector2::new(columns, 0.0),
        Vector2::new(0.0, rows),
        Vector2::new(columns, rows),
    ]
    .map(|n| geometry.pixel_to_nm * n);
    let low = corners.iter().fold(corners[0], |a, c| a.inf(c));
    let high = corners.iter().fold(corners[0], |a, c| a.sup(c));
    let upright = geometry.fast_step().x.abs() >= geometry.fast_step().y.abs();
    let (nx, ny) = if upright {
        (image.columns, image.rows)
    } else {
        (image.rows, image.columns)
    };
    let pitch = Vector2::new(
        (high.x - low.x) / (nx as f64 - 1.0),
        (high.y - low.y) / (ny as f64 - 1.0),
    );
    let inverse = geometry.pixel_to_nm.try_inverse()?;
    let values = (0..nx * ny)
        .map(|i| {
            let place = low + Vector2::new((i % nx) as f64 * pitch.x, (i / nx) as f64 * pitch.y);
            bilinear(image, inverse * place).unwrap_or(0.0)
        })
        .collect();
    Some((Image::new(ny, nx, values), pitch))
}

/// The image between pixels; `None` outside the frame or beside a missing pixel.
fn bilinear(image: &Image, n: Vector2<f64>) -> Option<f64> {
    let slack = 1e-6;
    let inside = |x: f64, count: usize| x >= -slack && x <= count as f64 - 1.0 + slack;
    if !(inside(n.x, image.columns) && inside(n.y, image.rows)) {
        return None;
    }
    let cell = |x: f64, count: usize| {
        let first = (x.max(0.0) as usize).min(count.saturating_sub(2));
        (first, (x - first as f64).clamp(0.0, 1.0))
    };
    let ((c, fx), (r, fy)) = (cell(n.x, image.columns), cell(n.y, image.rows));
    let (low, high) = (image.row(r), image.row(r + 1));
    let value = (1.0 - fy) * ((1.0 - fx) * low[c] + fx * low[c + 1])
        + fy * ((1.0 - fx) * high[c] + fx * high[c + 1]);
    value.is_finite().then_some(value)
}
