//! The lattice of an image whose background is off, by any method: found, measured, and what contradicts it asked.

use std::sync::Arc;

use heterostrain::lattice::shortest_pair;
use nalgebra::Matrix2;

use crate::coverage::patch::LatticeRegion;
use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::fit::fitted::{FittedHarmonic, LatticeFit};
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::predicted::of_better_cell;
use crate::lattice::start::Start;
use crate::spectrum::error::{LatticeError, SECOND, THIRD};
use crate::spectrum::method::Method;
use crate::spectrum::shells::FIRST_SHELL;

/// Amplitude of the higher orders over the first from which the first order has to be significant. Chosen by eye.
const MIN_HIGHER_ORDER_RATIO: f64 = 2.0;
/// Number of significant harmonics that replace it. Chosen by eye.
const FEWEST_BESIDE: usize = 3;

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
    let start = find_anywhere(image, geometry, background)?;
    measured(&start, image, geometry, background, method)
}

/// The same with outliers cut off and lines levelled while the lattice is looked for.
pub(crate) fn measure_clipped(
    image: &Arc<Image>,
    geometry: &Geometry,
    background: Background,
) -> Result<MeasuredLattice, LatticeError> {
    let start = Start::find_again(image, geometry, background)?;
    measured(&start, image, geometry, background, Method::Lattice)
}

fn measured(
    start: &Start,
    image: &Image,
    geometry: &Geometry,
    background: Background,
    method: Method,
) -> Result<MeasuredLattice, LatticeError> {
    let found = start.measure(method)?;
    if let Some(error) = no_lattice(&found) {
        return Err(error);
    }
    Ok(of_better_cell(found, image, geometry, background, method))
}

/// Why the amplitudes of the fit refuse a lattice.
pub(crate) fn no_lattice(found: &MeasuredLattice) -> Option<LatticeError> {
    first_order_is_missing(found).then_some(LatticeError::NowhereTogether)
}

/// The significant harmonics outside its second shell, which has a third of its points, and its third, which has a quarter.
fn harmonics_beside(fit: &LatticeFit, cells: i32) -> Vec<[i32; 2]> {
    let is_of = |[h, k]: [i32; 2]| match cells {
        3 => (h - k).rem_euclid(3) == 0,
        _ => h % 2 == 0 && k % 2 == 0,
    };
    let strong = fit.harmonics.iter();
    let strong = strong.filter(|h| h.signal_to_noise.powi(2) > SECOND);
    let indices = strong.map(|h| h.index);
    indices.filter(|index| !is_of(*index)).collect()
}

/// Whether its first shell is nowhere to be seen beside stronger harmonics, of which all that stand out are those of another lattice, but for one or
/// two that may be chance: slow ground makes a coarser lattice of every lattice.
fn first_order_is_missing(found: &MeasuredLattice) -> bool {
    let Some(fit) = &found.fit else { return false };
    let (first, higher) = fit.harmonics.split_at(FIRST_SHELL.len());
    let largest = |some: &[FittedHarmonic]| some.iter().map(|h| h.amplitude).fold(0.0, f64::max);
    let mut ratios: Vec<f64> = first.iter().map(|h| h.signal_to_noise.powi(2)).collect();
    ratios.sort_by(|a, b| b.total_cmp(a));
    if largest(higher) < MIN_HIGHER_ORDER_RATIO * largest(first) || ratios[1] > THIRD {
        return false;
    }
    [3, 4]
        .iter()
        .any(|cells| harmonics_beside(fit, *cells).len() < FEWEST_BESIDE)
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
