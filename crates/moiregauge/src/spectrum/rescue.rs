//! A second and a third look for images that hide their lattice under tip events and line noise.
//!
//! In: an image in which no lattice was found. Out: the start for the fit to the pixels, which deals
//! with both by itself once it knows where to look. The other estimators have no such means and are
//! not offered this.

use std::sync::Arc;

use nalgebra::Matrix2;

use crate::frame::background::{Background, remove_background};
use crate::frame::clip::cut_off;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::spectrum::error::LatticeError;
use crate::spectrum::known;
use crate::spectrum::prepare::{Prepared, levelled, prepare};

/// Looks for the lattice in the image with its outliers cut off, then with levelled lines as well. The
/// image of the result is the one given, without its background.
pub(crate) fn prepare_again(
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
        image: Arc::new(flat),
        ..prepared
    })
}

/// The same for a lattice of about the cell `known`.
pub(crate) fn prepare_known_again(
    image: &Image,
    geometry: &Geometry,
    background: Background,
    known: &Matrix2<f64>,
) -> Result<Prepared, LatticeError> {
    let flat = levelled(image.clone(), background)?;
    let clipped = cut_off(&flat);
    let found = match known::prepare(&clipped, geometry, background, known) {
        Err(LatticeError::NoLattice { .. }) => {
            known::prepare(&clipped, geometry, Background::LineMean, known)
        }
        other => other,
    };
    found.map(|prepared| Prepared {
        image: Arc::new(flat),
        ..prepared
    })
}
