//! A second and a third look for images that hide their lattice under tip events and line noise.
//!
//! In: an image in which no lattice was found. Out: the start for the fit to the pixels, which deals
//! with both by itself once it knows where to look. The other estimators have no such means and are
//! not offered this.

use std::sync::Arc;

use crate::frame::background::Background;
use crate::frame::clip::cut_off;
use crate::frame::image::Image;
use crate::spectrum::error::LatticeError;
use crate::spectrum::prepare::Prepared;

/// Looks in an image without its background with `find` once its outliers are cut off. Where that finds nothing, lines are levelled as well. The image of
/// the result is the one given.
pub(crate) fn prepare_again(
    image: &Arc<Image>,
    background: Background,
    find: impl Fn(&Image, Background) -> Result<Prepared, LatticeError>,
) -> Result<Prepared, LatticeError> {
    let clipped = cut_off(image);
    let found = match find(&clipped, background) {
        Err(LatticeError::NoLattice { .. }) => find(&clipped, Background::LineMean),
        other => other,
    };
    found.map(|prepared| Prepared {
        image: Arc::clone(image),
        ..prepared
    })
}
