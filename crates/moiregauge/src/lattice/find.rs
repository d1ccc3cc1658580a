//! Image and geometry → the lattice, by any method.

use std::sync::Arc;

use heterostrain::lattice::shortest_pair;

use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::fit::few::FewWaves;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::ground::{WAYS, below};
use crate::lattice::measure::{beside, measure_clipped, measure_levelled, no_lattice};
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::predicted::{LEAST, best_predicted, judged};
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
    if !is_doubtful(&found) {
        return found;
    }
    let Some(waves) = FewWaves::of(image) else {
        return found;
    };
    // A lattice that covers the frame and whose waves are all there is right, if it does not seem to change: perfect waves do not.
    let plain = |fit: &LatticeFit| !fit.disagrees() && fit.change().is_none();
    let whole = found.as_ref().ok().filter(|found| found.patch.is_none());
    let plain = whole.filter(|found| found.fit.as_ref().is_some_and(plain));
    if plain.is_some_and(|found| waves.are_of(&found.reciprocal)) {
        return found;
    }
    beside_stripes(&waves, image, geometry, background).map_or(found, Ok)
}

/// Whether stripes may have made a lattice, or hidden one.
fn is_doubtful(found: &Result<MeasuredLattice, LatticeError>) -> bool {
    let Ok(found) = found else {
        return true;
    };
    found.patch.is_some()
        || beside(found).is_some()
        || found.fit.as_ref().is_none_or(LatticeFit::disagrees)
}

/// The lattice of an image of a few perfect waves, some of which are not harmonics of the lattice.
fn beside_stripes(
    waves: &FewWaves,
    image: &Image,
    geometry: &Geometry,
    background: Background,
) -> Option<MeasuredLattice> {
    let method = Method::Lattice;
    let pair = waves.pair()?;
    let to_physical = geometry.pixel_to_nm.try_inverse()?.transpose();
    let pair = pair * shortest_pair(&(to_physical * pair))?;
    let (rest, wave) = waves.taken_off(image, &pair)?;
    let start = Start::at(&rest, geometry, background, &pair)?;
    let mut found = start.measure(method).ok()?;
    if no_lattice(&found).is_some() {
        return None;
    }
    if let Some(fit) = &mut found.fit {
        let told = fit.foreign_wave.map_or(0.0, |told| told.significance);
        if wave.significance > told {
            fit.foreign_wave = Some(wave);
        }
    }
    Some(found)
}
