//! What held-out prediction says of a lattice that was found.

use heterostrain::lattice::distortion;

use crate::explain::cells::{Supercell, Superlattice, better_cell, superlattice};
use crate::explain::evidence::{proposed, weakest};
use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::fit::hidden::Hidden;
use crate::lattice::measure::{hidden, measure_pair, no_lattice};
use crate::lattice::measured::{Evidence, MeasuredLattice};
use crate::lattice::start::Start;
use crate::spectrum::error::{LatticeError, SECOND};
use crate::spectrum::method::Method;
use crate::spectrum::prepare::binned;
use crate::spectrum::rivals::{ENOUGH, Rivals};
use crate::spectrum::select::MOST_DISTORTION;
use crate::spectrum::shells::shells;
use crate::spectrum::transform::Spectrum;

/// A lattice without a first order that stands out is taken where the weakest family of its waves predicts by so many standard errors. The best of
/// 57 candidates in rough ground had 3.4.
const BEYOND_DOUBT: f64 = 5.0;
/// With less a lattice is none. Right answers had 2.3 and more (60 sets of one to four troubles; that one covers half the frame and fades), lone steps 0 at
/// most.
const LEAST: f64 = 1.5;
/// As in `scan::shells`: below this probability of chance an image may hide a first order.
const SUSPECTED: f64 = 0.2;

/// The lattice with three or four times the cell, or a third or a fourth of it, that predicts the image better than the one that was found.
pub(crate) fn of_better_cell(
    found: &MeasuredLattice,
    image: &Image,
    geometry: &Geometry,
    background: Background,
    method: Method,
) -> Option<MeasuredLattice> {
    let part = found.patch.as_ref().map(|patch| patch.of(image));
    let pair = better_cell(part.as_ref().unwrap_or(image), &found.reciprocal)?;
    let part = found.patch.as_ref();
    let other = measure_pair(&pair, part, image, geometry, background, method)?;
    no_lattice(&other).is_none().then_some(other)
}

/// Clears the evidence for a hidden first order where what predicts pixels refutes it, so that the set does not use it.
pub(crate) fn without_refuted_shell(mut found: MeasuredLattice, image: &Image) -> MeasuredLattice {
    if hidden(&found).chance() < SUSPECTED
        && is_refuted(&found, image) == Some(true)
        && let Some(fit) = &mut found.fit
    {
        fit.hidden = Hidden::default();
    }
    found
}

/// Whether what is near the points of a hidden first order is none of its harmonics.
fn is_refuted(found: &MeasuredLattice, image: &Image) -> Option<bool> {
    let part = found.patch.as_ref().map(|patch| patch.of(image));
    let coarse = Supercell::Root3.coarse(&found.reciprocal)?;
    let said = superlattice(
        part.as_ref().unwrap_or(image),
        &coarse,
        Supercell::Root3,
        true,
    )?;
    Some(said == Superlattice::Refuted)
}

/// The proposed lattice that predicts pixels which were held out best, where it does so beyond doubt. Spots that differ are noise beside each wave, and no
/// wave stands out of that.
pub(crate) fn best_predicted(
    image: &Image,
    geometry: &Geometry,
    background: Background,
) -> Option<MeasuredLattice> {
    let (pair, weakest) = Start::proposals(image, geometry, background)
        .iter()
        .filter_map(|pair| proposed(image, pair))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let predicts = weakest > BEYOND_DOUBT;
    let start = predicts.then(|| Start::at(image, geometry, background, &pair))??;
    start.measure(Method::Lattice).ok()
}

/// A lattice with what it predicts of the part of the image that shows it.
///
/// # Errors
/// [`LatticeError::OneOfMany`]: other waves of the image could be one as well. [`LatticeError::NotPredicted`]: next to nothing. [`LatticeError::Distorted`]: its cell is none that a proposal may have.
pub(crate) fn judged(
    mut found: MeasuredLattice,
    image: &Image,
    geometry: &Geometry,
) -> Result<MeasuredLattice, LatticeError> {
    found.beside = std::mem::take(&mut found.beside)
        .into_iter()
        .filter_map(|grain| judged(grain, image, geometry).ok())
        .collect();
    let to_physical = geometry.pixel_to_nm.try_inverse().map(|m| m.transpose());
    if to_physical.is_some_and(|m| distortion(&(m * found.reciprocal)) > MOST_DISTORTION) {
        return Err(LatticeError::Distorted);
    }
    let part = found.patch.as_ref().map(|patch| patch.of(image));
    let rivals = to_physical.map_or(0, |metric| {
        let (binning, bins) = binned(part.as_ref().unwrap_or(image), &found.reciprocal);
        Rivals::new(&Spectrum::new(&bins)).of(&(found.reciprocal * binning as f64), &metric)
    });
    // A cell of many atoms is made by its harmonics.
    let by_few = !is_made_by_many(&found);
    if rivals >= ENOUGH && by_few {
        return Err(LatticeError::OneOfMany { rivals });
    }
    let fit = found.fit.as_ref();
    let bends = found.change.is_some() || fit.is_some_and(|fit| fit.change().is_some());
    let predicts = weakest(part.as_ref().unwrap_or(image), &found.reciprocal, bends);
    // Phases of a lattice that changes are no cubic polynomials.
    let is_plain = found.change.is_none() && by_few;
    if let Some(standard_errors) = predicts.filter(|p| *p < LEAST && is_plain) {
        return Err(LatticeError::NotPredicted { standard_errors });
    }
    found.evidence = Some(Evidence { predicts, rivals });
    Ok(found)
}

/// Whether its harmonics do not agree on one lattice.
pub(crate) fn disagrees(fit: &LatticeFit) -> bool {
    fit.closure
        .is_some_and(|closure| closure.enlargement() > 1.0)
}

/// Whether more harmonics stand out than two shells have.
fn is_made_by_many(found: &MeasuredLattice) -> bool {
    let harmonics = found.fit.iter().flat_map(|fit| &fit.harmonics);
    let strong = harmonics.filter(|harmonic| harmonic.signal_to_noise.powi(2) > SECOND);
    strong.count() > shells(2).len()
}
