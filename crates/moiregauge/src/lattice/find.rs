//! Image and geometry → the lattice, by any method.

use std::sync::Arc;

use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::beside::{with_another, without_waves};
use crate::lattice::ground::below;
use crate::lattice::measure::{measure_clipped, measure_evened, measure_levelled};
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::predicted::{LEAST, best_predicted, judged, with_evidence};
use crate::spectrum::error::LatticeError;
use crate::spectrum::method::Method;
use crate::spectrum::prepare::levelled;

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
    // Other methods have no fit that would name the wave, or the ground, that is taken off.
    if method != Method::Lattice {
        return measure_levelled(&image, geometry, background, method);
    }
    let freed = |image: &Arc<Image>, found: MeasuredLattice| {
        let freed = without_waves(image, &found, geometry, background);
        let freed = freed.and_then(|freed| judged(freed, image, geometry, background).ok());
        freed.map_or_else(|| judged(found, image, geometry, background), Ok)
    };
    let clipped = || {
        let found = measure_clipped(&image, geometry, background).ok()?;
        judged(found, &image, geometry, background).ok()
    };
    let by_prediction = || {
        let found = best_predicted(&image, geometry, background)?;
        judged(found, &image, geometry, background).ok()
    };
    // Of several even images each may show a lattice by chance.
    let surely = |found: &MeasuredLattice| {
        let predicts = found.evidence.as_ref().and_then(|e| e.predicts);
        predicts.is_some_and(|least| least > 2.0 * LEAST)
    };
    let by_peaks_below = |even: &Arc<Image>, side| {
        let found = measure_evened(even, geometry, background, side).ok()?;
        let mut found = freed(even, found).ok().filter(surely)?;
        // What was taken off as ground may be a lattice, too.
        let (whole, _) = with_evidence(found.clone(), &image, geometry);
        if let (Some(own), Some(whole)) = (&mut found.evidence, whole.evidence) {
            own.candidates = whole.candidates;
        }
        Some(found)
    };
    let found = measure_levelled(&image, geometry, background, method);
    found
        .and_then(|found| freed(&image, found))
        .or_else(|error| {
            clipped()
                .or_else(|| below(&image, geometry, background, &by_peaks_below))
                .or_else(by_prediction)
                .ok_or(error)
        })
        .map(|found| with_another(&image, &found, geometry, background).unwrap_or(found))
}
