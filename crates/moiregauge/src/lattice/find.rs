//! Image and geometry → the lattice, by any method.

use std::sync::Arc;

use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::ground::{below, on_even_ground};
use crate::lattice::measure::{beside, is_torn, measure_levelled};
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::predicted::{best_predicted, judged};
use crate::spectrum::error::LatticeError;
use crate::spectrum::method::Method;
use crate::spectrum::prepare::levelled;

/// The image without ground is taken where that leaves less than this share of the variance of the wave vectors: what it makes of the edges of holes is no
/// better than leaving it.
const CLEARER: f64 = 0.7;

/// Finds and measures the lattice of an image.
///
/// # Errors
/// - [`LatticeError::TooSmall`], [`LatticeError::Constant`], [`LatticeError::Missing`]: nothing to
///   measure.
/// - [`LatticeError::NoLattice`]: no consistent lattice stands out of the noise.
/// - [`LatticeError::NoPeaks`]: there is one, but the method cannot measure it.
pub fn measure(
    image: &Image,
    geometry: &Geometry,
    background: Background,
    method: Method,
) -> Result<MeasuredLattice, LatticeError> {
    measure_own(image.clone(), geometry, background, method)
}

/// The same of an image that nobody needs any more: its background is taken off in its place.
///
/// # Errors
/// As [`measure`].
pub(crate) fn measure_own(
    image: Image,
    geometry: &Geometry,
    background: Background,
    method: Method,
) -> Result<MeasuredLattice, LatticeError> {
    let image = Arc::new(levelled(image, background)?);
    let found = measure_levelled(&image, geometry, background, method);
    // Other methods have no fit that would name the ground that is taken off.
    if method != Method::Lattice {
        return found;
    }
    let found = match found {
        Ok(found) => clearer(found, &image, geometry, background),
        Err(error) => {
            let find = |even: &Arc<Image>, geometry: &Geometry| {
                measure_levelled(even, geometry, background, method).ok()
            };
            below(&image, geometry, background, &find)
                .filter(|found| !is_torn(found))
                .or_else(|| best_predicted(&image, geometry, background))
                .ok_or(error)?
        }
    };
    judged(found, &image, geometry)
}

/// The same lattice in the image without ground, where something stands out beside it and the image without ground says much more of it.
fn clearer(
    found: MeasuredLattice,
    image: &Image,
    geometry: &Geometry,
    background: Background,
) -> MeasuredLattice {
    let variance = |found: &MeasuredLattice| {
        let fit = found.fit.as_ref();
        fit.map_or(f64::INFINITY, |fit| fit.wave_vectors.covariance.trace())
    };
    let Some(fit) = &found.fit else { return found };
    if beside(&found).is_none() || !found.beside.is_empty() {
        return found;
    }
    let most = CLEARER * variance(&found);
    on_even_ground(image, fit, geometry, background)
        .filter(|even| !is_torn(even) && variance(even) < most)
        .unwrap_or(found)
}
