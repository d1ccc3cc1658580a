//! A second and a third look for images that hide their lattice under tip events and line noise.
//!
//! In: an image in which no lattice was found. Out: the start for the fit to the pixels, which deals
//! with both by itself once it knows where to look. The other estimators have no such means and are
//! not offered this.

use nalgebra::Matrix2;

use super::fit::middle as median;
use super::prepare::{Prepared, levelled, prepare};
use super::{LatticeError, known};
use crate::background::remove_background;
use crate::geometry::Geometry;
use crate::image::Image;
use crate::settings::Background;

/// Values are cut off at this many standard deviations (by the median) from the median.
const CLIP: f64 = 3.0;

/// Looks for the lattice in the image with its outliers cut off, then with levelled lines as well. The
/// image of the result is the one given, without its background.
pub(super) fn prepare_again(
    image: &Image,
    geometry: &Geometry,
    background: Background,
) -> Result<Prepared, LatticeError> {
    let flat = remove_background(image, background);
    let clipped = cut_off(&flat);
    let found = match prepare(&clipped, geometry, background) {
        Err(LatticeError::NoLattice { .. }) => prepare(&clipped, geometry, Background::LineMean),
        other => other,
    };
    found.map(|prepared| Prepared {
        image: flat,
        ..prepared
    })
}

/// The same for a lattice of about the cell `known`.
pub(super) fn prepare_known_again(
    image: &Image,
    geometry: &Geometry,
    background: Background,
    known: &Matrix2<f64>,
) -> Result<Prepared, LatticeError> {
    let flat = levelled(image, background)?;
    let clipped = cut_off(&flat);
    let found = match known::prepare(&clipped, geometry, background, known) {
        Err(LatticeError::NoLattice { .. }) => {
            known::prepare(&clipped, geometry, Background::LineMean, known)
        }
        other => other,
    };
    found.map(|prepared| Prepared {
        image: flat,
        ..prepared
    })
}

/// The image with outliers moved to where they are none.
pub(super) fn cut_off(image: &Image) -> Image {
    let mut values: Vec<f64> = image
        .values
        .iter()
        .copied()
        .filter(|v| v.is_finite())
        .collect();
    let middle = median(&mut values);
    for value in &mut values {
        *value = (*value - middle).abs();
    }
    let reach = CLIP * 1.4826 * median(&mut values);
    let values = image
        .values
        .iter()
        .map(|v| v.clamp(middle - reach, middle + reach));
    Image::new(image.rows, image.columns, values.collect())
}
