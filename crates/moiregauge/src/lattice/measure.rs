//! The lattice of an image whose background is off, by any method: found and measured.

use std::sync::Arc;

use heterostrain::lattice::shortest_pair;
use nalgebra::Matrix2;

use crate::coverage::patch::LatticeRegion;
use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::predicted::of_better_cell;
use crate::lattice::start::Start;
use crate::spectrum::error::LatticeError;
use crate::spectrum::method::Method;

/// The lattice of an image whose background is off already.
///
/// # Errors
/// As [`measure`](crate::lattice::find::measure).
pub(crate) fn measure_levelled(
    image: &Arc<Image>,
    geometry: &Geometry,
    background: Background,
    method: Method,
) -> Result<MeasuredLattice, LatticeError> {
    let found = find_anywhere(image, geometry, background)?.measure(method)?;
    Ok(of_better_cell(found, image, geometry, background, method))
}

/// The same with outliers cut off and lines levelled while the lattice is looked for.
pub(crate) fn measure_clipped(
    image: &Arc<Image>,
    geometry: &Geometry,
    background: Background,
) -> Result<MeasuredLattice, LatticeError> {
    let method = Method::Lattice;
    let found = Start::find_clipped(image, geometry, background)?.measure(method)?;
    Ok(of_better_cell(found, image, geometry, background, method))
}

/// The lattice of some pair of waves (rad per pixel) in a part of an image, or in all of it; `None` where it cannot be measured.
pub(crate) fn measure_pair(
    pair: &Matrix2<f64>,
    part: Option<&LatticeRegion>,
    image: &Image,
    geometry: &Geometry,
    background: Background,
    method: Method,
) -> Option<MeasuredLattice> {
    let to_physical = geometry.pixel_to_nm.try_inverse()?.transpose();
    let pair = pair * shortest_pair(&(to_physical * pair))?;
    let start = Start::at_on(part, image, geometry, background, &pair)?;
    start.measure(method).ok()
}

/// The same for a lattice that is one of several and everywhere: nothing is asked of what lies beside it.
///
/// # Errors
/// As [`measure`](crate::lattice::find::measure).
pub(crate) fn measure_whole(
    image: &Image,
    geometry: &Geometry,
    background: Background,
    method: Method,
) -> Result<MeasuredLattice, LatticeError> {
    Start::find(image, geometry, background)?.measure(method)
}

/// The lattice of the whole frame or, where it does not cover it, of the part that it covers. The background is off already.
fn find_anywhere(
    image: &Arc<Image>,
    geometry: &Geometry,
    background: Background,
) -> Result<Start, LatticeError> {
    let whole = match Start::find_in_levelled(image, geometry, background) {
        Ok(start) => start.on_the_whole_frame(image),
        Err(error) => Err((None, error)),
    };
    let (first, error) = match whole {
        Ok(start) => return Ok(start),
        Err((first, error)) => (first, error),
    };
    if first.is_none() && !matches!(error, LatticeError::NoLattice { .. }) {
        return Err(error);
    }
    Start::find_patch(image, geometry, background, first).ok_or(error)
}
