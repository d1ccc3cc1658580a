//! The lattice of an image whose background is off, by any method: found and measured.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::Matrix2;

use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::predicted::of_better_cell;
use crate::lattice::start::Start;
use crate::numbers::three::three;
use crate::spectrum::error::LatticeError;
use crate::spectrum::method::Method;

/// Ground is taken off by windows of fewer periods than this; of shorter waves it leaves what was there before, where they were looked for already.
const MOST_PERIODS: f64 = 4.0;

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
    measure_meant(image, geometry, background, method, &|_| true)
}

/// `is_meant`: which lattices are looked for in parts of the image.
fn measure_meant(
    image: &Arc<Image>,
    geometry: &Geometry,
    background: Background,
    method: Method,
    is_meant: &dyn Fn(&Matrix2<f64>) -> bool,
) -> Result<MeasuredLattice, LatticeError> {
    let start = find_anywhere(image, geometry, background, is_meant)?;
    let found = start.measure(method)?;
    Ok(of_better_cell(found, image, geometry, background, method))
}

/// The same where the ground was a running median of windows of `side` pixels: lattices of parts of the image are those that ground hides.
///
/// # Errors
/// As [`measure`](crate::lattice::find::measure).
pub(crate) fn measure_evened(
    image: &Arc<Image>,
    geometry: &Geometry,
    background: Background,
    side: f64,
) -> Result<MeasuredLattice, LatticeError> {
    let is_meant = |pair: &Matrix2<f64>| {
        let shortest = three(pair).map(|q| TAU / q.norm());
        side < MOST_PERIODS * shortest.into_iter().fold(f64::INFINITY, f64::min)
    };
    measure_meant(image, geometry, background, Method::Lattice, &is_meant)
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

/// The lattice that is one of several and everywhere: nothing is asked of what lies beside it.
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
    is_meant: &dyn Fn(&Matrix2<f64>) -> bool,
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
    Start::find_meant(image, geometry, background, first, is_meant).ok_or(error)
}
