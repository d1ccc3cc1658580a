//! Image and geometry → the lattice, by any method.

use std::sync::Arc;

use heterostrain::lattice::shortest_pair;

use crate::explain::beside::{WaveBeside, wave_beside};
use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::fit::few::FewWaves;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::ground::{WAYS, below};
use crate::lattice::measure::{measure_clipped, measure_levelled, no_lattice};
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::predicted::{LEAST, bends, best_predicted, judged};
use crate::lattice::start::Start;
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
    let by_peaks = |image: &Arc<Image>| {
        let found = measure_beside(image, geometry, background);
        found.and_then(|found| judged(found, image, geometry, background))
    };
    let clipped = || {
        let found = measure_clipped(&image, geometry, background).ok()?;
        judged(found, &image, geometry, background).ok()
    };
    let by_prediction = |image: &Arc<Image>| {
        let found = best_predicted(image, geometry, background)?;
        judged(found, image, geometry, background).ok()
    };
    let below = |find: &dyn Fn(&Arc<Image>) -> Option<MeasuredLattice>, ways| {
        below(&image, geometry, background, find, ways)
    };
    // Of several even images each may show a lattice by chance.
    let surely = |found: &MeasuredLattice| {
        let predicts = found.evidence.as_ref().and_then(|e| e.predicts);
        predicts.is_some_and(|least| least > 2.0 * LEAST)
    };
    by_peaks(&image).or_else(|error| {
        clipped()
            .or_else(|| below(&|even| by_peaks(even).ok().filter(surely), WAYS))
            .or_else(|| by_prediction(&image))
            .or_else(|| below(&by_prediction, 1))
            .ok_or(error)
    })
}

/// The lattice of an image without its background, and of perfect waves beside it.
fn measure_beside(
    image: &Arc<Image>,
    geometry: &Geometry,
    background: Background,
) -> Result<MeasuredLattice, LatticeError> {
    let found = measure_levelled(image, geometry, background, Method::Lattice);
    // Stripes as strong as the waves of a lattice may have made it, or hidden one.
    let is_strong = |wave: WaveBeside| wave.strength >= 1.0;
    let is_doubtful = |found: &MeasuredLattice| {
        found.patch.is_some()
            || found.fit.as_ref().is_none_or(LatticeFit::disagrees)
            || wave_beside(image, &found.reciprocal, bends(found)).is_some_and(is_strong)
    };
    match found {
        Ok(found) if !is_doubtful(&found) => Ok(found),
        before => match beside_stripes(image, geometry, background) {
            // The waves that are taken off may be those of a larger cell.
            Some(mut found) => {
                found.larger = before.map_or([None; 3], |before| before.larger);
                Ok(found)
            }
            None => before,
        },
    }
}

/// The lattice of an image of a few perfect waves, some of which are not harmonics of the lattice.
fn beside_stripes(
    image: &Image,
    geometry: &Geometry,
    background: Background,
) -> Option<MeasuredLattice> {
    let waves = FewWaves::of(image)?;
    let pair = waves.pair()?;
    let to_physical = geometry.pixel_to_nm.try_inverse()?.transpose();
    let pair = pair * shortest_pair(&(to_physical * pair))?;
    let rest = waves.taken_off(image, &pair)?;
    let start = Start::at(&rest, geometry, background, &pair)?;
    let found = start.measure(Method::Lattice).ok()?;
    no_lattice(&found).is_none().then_some(found)
}
