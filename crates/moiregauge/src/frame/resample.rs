//! Images on square grids along the laboratory axes: the one place where images are resampled.
//!
//! In: an image and the affine map of its pixels, position `r = r₀ + M n` (nm). Out: the same image
//! on points that are equally far apart along x and y. Nothing is measured on it: lattices are
//! measured in pixels and mapped (see [`crate::frame::geometry`]).
//!
//! - Interpolation by cubic convolution (a = −1/2): exact for quadratics, third order. Beside
//!   missing pixels and at the edges it is bilinear; a point with a missing neighbour is missing, and
//!   so is one outside the frame. Nothing is extrapolated.
//! - The pitch is the smaller of the two pixel steps, so that no detail is lost, unless the grid would
//!   have more than eight times the pixels of the image.
//!
//! # References
//! R. G. Keys, IEEE Trans. Acoust. Speech Signal Process. 29, 1153 (1981), equation 15.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::numbers::interrupt;

/// Largest number of pixels of a grid over that of the image: finer ones hold nothing new and fill the memory.
const MOST_POINTS: f64 = 8.0;
/// Points this far outside the outermost pixel centres (pixels) are on them but for rounding: far above 10⁻¹⁶ of a
/// million pixels.
const ON_EDGE: f64 = 1e-9;

/// An image on a square grid along the laboratory axes.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Resampled {
    /// The image; points outside the frame and beside missing pixels are NaN.
    pub image: Image,
    /// Distance of its points along x and y, nm.
    pub pitch: f64,
    /// Position of its bottom left point, nm.
    pub origin: Vector2<f64>,
}

impl Resampled {
    /// Position of the middle of the grid, nm.
    pub fn centre(&self) -> Vector2<f64> {
        let half = |count: usize| 0.5 * self.pitch * (count as f64 - 1.0);
        self.origin + Vector2::new(half(self.image.columns), half(self.image.rows))
    }
}

/// Resamples an image whose pixel (column, row) lies at `origin + pixel_to_nm · (column, row)`.
///
/// `None` where the map is singular or the image smaller than 2 × 2.
pub fn resample(
    image: &Image,
    pixel_to_nm: &Matrix2<f64>,
    origin: Vector2<f64>,
) -> Option<Resampled> {
    let geometry = Geometry::of_pitch([2; 2], [1.0; 2], 0.0, Vector2::zeros())?;
    let geometry = Geometry {
        pixel_to_nm: *pixel_to_nm,
        origin,
        ..geometry
    };
    on_curved_grid(image, &geometry)
}

/// The same of an image whose pixels a geometry places, curved where it is.
pub(crate) fn on_curved_grid(image: &Image, geometry: &Geometry) -> Option<Resampled> {
    let Geometry {
        pixel_to_nm,
        origin,
        ..
    } = geometry;
    let pixel = geometry.pixel_of()?;
    if image.rows < 2 || image.columns < 2 {
        return None;
    }
    let last = Vector2::new(image.columns as f64 - 1.0, image.rows as f64 - 1.0);
    let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
        .map(|(a, b)| origin + pixel_to_nm * Vector2::new(a * last.x, b * last.y));
    let low = corners.iter().fold(corners[0], |a, b| a.inf(b));
    let high = corners.iter().fold(corners[0], |a, b| a.sup(b));
    let extent = high - low;
    let steps = [pixel_to_nm.column(0).norm(), pixel_to_nm.column(1).norm()];
    let fewest = (extent.x * extent.y / (MOST_POINTS * image.values.len() as f64)).sqrt();
    let pitch = steps[0].min(steps[1]).max(fewest);
    if !(pitch > 0.0 && pitch.is_finite()) {
        return None;
    }
    let count = |length: f64| (length / pitch + 1e-6).floor() as usize + 1;
    let (columns, rows) = (count(extent.x), count(extent.y));
    // The grid lies in the middle of the frame.
    let size = Vector2::new(columns as f64 - 1.0, rows as f64 - 1.0) * pitch;
    let first = low + 0.5 * (extent - size);
    let mut values = vec![0.0; rows * columns];
    let lines = values.par_chunks_exact_mut(columns).enumerate();
    lines.for_each(|(row, line)| {
        interrupt::check();
        for (column, value) in line.iter_mut().enumerate() {
            let point = first + pitch * Vector2::new(column as f64, row as f64);
            *value = at(image, pixel(point));
        }
    });
    Some(Resampled {
        image: Image::new(rows, columns, values),
        pitch,
        origin: first,
    })
}

/// The value at a place in pixels (column, row); NaN outside.
pub(crate) fn at(image: &Image, place: Vector2<f64>) -> f64 {
    let (samples, _) = image.values.as_chunks();
    let [value] = all_at(samples, [image.columns, image.rows], place);
    value
}

/// The same of several quantities that have their pixels in common, which lie side by side; `size`: columns and rows.
pub(crate) fn all_at<const N: usize>(
    samples: &[[f64; N]],
    size: [usize; 2],
    place: Vector2<f64>,
) -> [f64; N] {
    let Some(((column, u), (row, v))) = cell(place.x, size[0]).zip(cell(place.y, size[1])) else {
        return [f64::NAN; N];
    };
    let first = row * size[0] + column;
    let inside = |first: usize, count: usize| first >= 1 && first + 2 < count;
    if !(inside(column, size[0]) && inside(row, size[1])) {
        return between(samples, size[0], first, [u, v]);
    }
    let (across, along) = (keys(v), keys(u));
    // Sums start from −0, which changes no sign.
    let mut found = [-0.0; N];
    for (j, across) in across.into_iter().enumerate() {
        let start = first + j * size[0] - size[0] - 1;
        let mut sum = [-0.0; N];
        for (sample, weight) in samples[start..start + 4].iter().zip(along) {
            for (sum, value) in sum.iter_mut().zip(sample) {
                *sum += value * weight;
            }
        }
        for (found, sum) in found.iter_mut().zip(sum) {
            *found += sum * across;
        }
    }
    if found.iter().all(|value| value.is_finite()) {
        return found;
    }
    let linear = between(samples, size[0], first, [u, v]);
    for (found, linear) in found.iter_mut().zip(linear) {
        if !found.is_finite() {
            *found = linear;
        }
    }
    found
}

/// Bilinear between the pixel `first` and the next ones.
fn between<const N: usize>(
    samples: &[[f64; N]],
    columns: usize,
    first: usize,
    [u, v]: [f64; 2],
) -> [f64; N] {
    // A missing pixel of no weight is no loss.
    let part = |value: f64, weight: f64| if weight == 0.0 { 0.0 } else { weight * value };
    let (below, above) = (&samples[first..first + 2], &samples[first + columns..][..2]);
    std::array::from_fn(|i| {
        part(below[0][i], (1.0 - u) * (1.0 - v))
            + part(below[1][i], u * (1.0 - v))
            + part(above[0][i], (1.0 - u) * v)
            + part(above[1][i], u * v)
    })
}

/// The pixel before a coordinate and the way to the next one, 0 to 1.
fn cell(x: f64, count: usize) -> Option<(usize, f64)> {
    let last = count as f64 - 1.0;
    if !(-ON_EDGE..=last + ON_EDGE).contains(&x) {
        return None;
    }
    let x = x.clamp(0.0, last);
    let first = (x as usize).min(count - 2);
    Some((first, x - first as f64))
}

/// Weights of the four pixels around a place `t` beyond the second.
fn keys(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quadratic of the position, which cubic convolution reproduces.
    fn height(r: Vector2<f64>) -> f64 {
        3.0 + 0.4 * r.x - 0.3 * r.y + 0.02 * r.x * r.x - 0.01 * r.x * r.y + 0.015 * r.y * r.y
    }

    fn sheared() -> (Image, Matrix2<f64>, Vector2<f64>) {
        let map = Matrix2::new(0.5, -0.2, 0.15, 0.7);
        let origin = Vector2::new(-3.0, 2.0);
        let (rows, columns) = (30, 40);
        let values = (0..rows * columns)
            .map(|i| {
                height(origin + map * Vector2::new((i % columns) as f64, (i / columns) as f64))
            })
            .collect();
        (Image::new(rows, columns, values), map, origin)
    }

    #[test]
    fn quadratics_are_exact_on_sheared_frames() {
        let (image, map, origin) = sheared();
        let found = resample(&image, &map, origin).unwrap();
        assert!((found.pitch - map.column(0).norm()).abs() < 1e-12);
        let inverse = map.try_inverse().unwrap();
        let (mut inner, mut outside) = (0, 0);
        for row in 0..found.image.rows {
            for (column, value) in found.image.row(row).iter().enumerate() {
                let r = found.origin + found.pitch * Vector2::new(column as f64, row as f64);
                let n = inverse * (r - origin);
                let depth = n.x.min(n.y).min(39.0 - n.x).min(29.0 - n.y);
                if depth > 1.0 {
                    inner += 1;
                    assert!((value - height(r)).abs() < 1e-9);
                } else if depth > 0.0 {
                    // Bilinear: an eighth of the second differences.
                    assert!((value - height(r)).abs() < 0.01, "{value} at {n}");
                } else if depth < -1e-6 {
                    outside += 1;
                    assert!(value.is_nan());
                }
            }
        }
        assert!(inner > 1000 && outside > 100, "{inner} {outside}");
    }

    #[test]
    fn missing_pixels_stay_missing() {
        let (mut image, map, origin) = sheared();
        image.values[15 * 40 + 20] = f64::NAN;
        let found = resample(&image, &map, origin).unwrap();
        let hole = origin + map * Vector2::new(20.0, 15.0);
        let inverse = map.try_inverse().unwrap();
        let mut missing = 0;
        for (i, value) in found.image.values.iter().enumerate() {
            let place = Vector2::new(
                (i % found.image.columns) as f64,
                (i / found.image.columns) as f64,
            );
            let away = inverse * (found.origin + found.pitch * place - hole);
            let within = away.x.abs() < 1.0 - 1e-9 && away.y.abs() < 1.0 - 1e-9;
            if within {
                missing += 1;
                assert!(value.is_nan());
            } else if away.norm() < 5.0 {
                assert!(value.is_finite());
            }
        }
        assert!(missing > 0);
    }

    /// A map along the axes with the image's own pitch gives the image back.
    #[test]
    fn grids_that_are_square_already_stay() {
        let values: Vec<f64> = (0..35).map(|n| f64::from(n * n % 17)).collect();
        let image = Image::new(5, 7, values);
        let map = Matrix2::new(0.3, 0.0, 0.0, 0.3);
        let found = resample(&image, &map, Vector2::new(1.0, 2.0)).unwrap();
        assert_eq!((found.image.rows, found.image.columns), (5, 7));
        for (a, b) in found.image.values.iter().zip(&image.values) {
            assert!((a - b).abs() < 1e-9);
        }
        assert!((found.centre() - Vector2::new(1.9, 2.6)).norm() < 1e-12);
    }

    /// A flat frame does not become a huge grid.
    #[test]
    fn coarse_lines_do_not_make_huge_grids() {
        let image = Image::new(4, 1000, vec![1.0; 4000]);
        let map = Matrix2::new(0.01, 0.0, 0.0, 100.0);
        let found = resample(&image, &map, Vector2::zeros()).unwrap();
        assert!(found.image.values.len() < 40_000);
        assert!(resample(&image, &Matrix2::zeros(), Vector2::zeros()).is_none());
    }
}
