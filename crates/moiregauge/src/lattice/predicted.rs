//! Acceptance of a lattice by the prediction of held-out blocks.

use heterostrain::lattice::distortion;
use nalgebra::Matrix2;

use crate::explain::cells::{BETTER, Supercell, Superlattice, better_cell, superlattice};
use crate::explain::evidence::{proposed, weakest};
use crate::explain::table::{Row, table};
use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::fit::hidden::Hidden;
use crate::lattice::measure::{hidden, measure_pair, no_lattice};
use crate::lattice::measured::{Candidate, Evidence, MeasuredLattice};
use crate::lattice::start::Start;
use crate::spectrum::error::{LatticeError, SECOND};
use crate::spectrum::method::Method;
use crate::spectrum::prepare::binned;
use crate::spectrum::rivals::{ENOUGH, Rivals};
use crate::spectrum::select::{MOST_DISTORTION, candidates_beside};
use crate::spectrum::shells::shells;
use crate::spectrum::transform::Spectrum;

/// A lattice without a first order that stands out is accepted where the weakest family of its waves predicts by this many standard errors. The best of
/// 57 candidates in rough ground had 3.4.
const BEYOND_DOUBT: f64 = 5.0;
/// Smallest significance of the prediction, standard errors. Right answers had 2.3 and more (60 sets of one to four troubles; that one covers half the frame and fades), lone steps 0 at
/// most.
const LEAST: f64 = 1.5;
/// Largest relative change of the waves from corner to corner: gradients and waves of twist and strain make up
/// to a tenth, creep in a frame of four periods of atoms a half, and holes that pass for a coarse lattice 0.7 to 1.4.
const MOST_CHANGE: f64 = 0.6;
/// Fewest periods across the frame: a few protrusions can mimic a lattice. Of simulated discs with sharp edges 0.8 to 1.0 fit across the
/// frame, of the smallest recorded images three.
const FEWEST_PERIODS: f64 = 1.5;
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

/// Whether the waves near the points of a suppressed first order are not its harmonics.
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

/// A lattice with what speaks for it, or the proposed one that predicts the part of the image that shows it better.
///
/// # Errors
/// As [`accepted`].
pub(crate) fn judged(
    found: MeasuredLattice,
    image: &Image,
    geometry: &Geometry,
    background: Background,
) -> Result<MeasuredLattice, LatticeError> {
    let (found, better) = with_evidence(found, image, geometry);
    let found = accepted(found, geometry)?;
    let instead = || {
        let part = found.patch.as_ref();
        let other = measure_pair(&better?, part, image, geometry, background, Method::Lattice)?;
        let (other, _) = with_evidence(other, image, geometry);
        let other = accepted(other, geometry).ok()?;
        no_lattice(&other).is_none().then_some(other)
    };
    Ok(instead().unwrap_or(found))
}

/// A lattice, and grains beside it, with what they predict of the part of the image that shows them; and the reciprocal pair (rad per pixel) of another
/// that predicts better.
pub(crate) fn with_evidence(
    mut found: MeasuredLattice,
    image: &Image,
    geometry: &Geometry,
) -> (MeasuredLattice, Option<Matrix2<f64>>) {
    let beside = std::mem::take(&mut found.beside);
    let of_grain = |grain| with_evidence(grain, image, geometry).0;
    found.beside = beside.into_iter().map(of_grain).collect();
    let Some(to_physical) = geometry.pixel_to_nm.try_inverse().map(|m| m.transpose()) else {
        return (found, None);
    };
    let part = found.patch.as_ref().map(|patch| patch.of(image));
    let part = part.as_ref().unwrap_or(image);
    let (binning, bins) = binned(part, &found.reciprocal);
    let (binning, spectrum) = (binning as f64, Spectrum::new(&bins));
    let bends = bends(&found);
    let own = found.reciprocal * binning;
    let proposals = candidates_beside(&own, &spectrum, &(geometry.pixel_to_nm * binning));
    let proposals: Vec<Matrix2<f64>> = proposals.iter().map(|c| c.pair / binning).collect();
    let rows = table(part, &found.reciprocal, &proposals, bends).unwrap_or_default();
    let is_better = |row: &&Row| {
        let weakest = || weakest(part, &row.pair, bends);
        row.cells == 1 && row.behind < -BETTER && weakest().is_some_and(|least| least > BETTER)
    };
    let better = rows.iter().find(is_better).map(|row| row.pair);
    let candidates = rows.iter().map(|row| Candidate::new(row, &to_physical));
    // A cell of many atoms is made by its harmonics.
    let rivals = if is_made_by_many(&found) {
        0
    } else {
        Rivals::new(&spectrum).of(&own, &to_physical)
    };
    found.evidence = Some(Evidence {
        predicts: weakest(part, &found.reciprocal, bends),
        rivals,
        candidates: candidates.collect(),
    });
    (found, better)
}

/// A lattice that its evidence does not refute, with those grains beside it of which this is true.
///
/// # Errors
/// [`LatticeError::OneOfMany`]: other waves of the image could be one as well. [`LatticeError::NotPredicted`]: next to nothing.
/// [`LatticeError::Distorted`]: its cell is too far from a hexagon. [`LatticeError::TooFewPeriods`]: it does not repeat.
/// [`LatticeError::NowhereTogether`]: it varies too much.
fn accepted(
    mut found: MeasuredLattice,
    geometry: &Geometry,
) -> Result<MeasuredLattice, LatticeError> {
    let beside = std::mem::take(&mut found.beside).into_iter();
    found.beside = beside
        .filter_map(|grain| accepted(grain, geometry).ok())
        .collect();
    let to_physical = geometry.pixel_to_nm.try_inverse().map(|m| m.transpose());
    if to_physical.is_some_and(|m| distortion(&(m * found.reciprocal)) > MOST_DISTORTION) {
        return Err(LatticeError::Distorted);
    }
    if found.periods < FEWEST_PERIODS {
        let periods = found.periods;
        return Err(LatticeError::TooFewPeriods { periods });
    }
    let change = found.fit.as_ref().and_then(LatticeFit::change);
    if change.is_some_and(|change| change.wavelength.hypot(change.angle) > MOST_CHANGE) {
        return Err(LatticeError::NowhereTogether);
    }
    let evidence = found.evidence.as_ref();
    let rivals = evidence.map_or(0, |evidence| evidence.rivals);
    if rivals >= ENOUGH {
        return Err(LatticeError::OneOfMany { rivals });
    }
    // Phases of a lattice that changes are no cubic polynomials.
    let predicts = evidence.and_then(|evidence| evidence.predicts);
    let is_plain = found.change.is_none() && !is_made_by_many(&found);
    match predicts.filter(|least| *least < LEAST && is_plain) {
        Some(standard_errors) => Err(LatticeError::NotPredicted { standard_errors }),
        None => Ok(found),
    }
}

/// Whether it changes across the frame.
pub(crate) fn bends(found: &MeasuredLattice) -> bool {
    let fit = found.fit.as_ref();
    found.change.is_some() || fit.is_some_and(|fit| fit.change().is_some())
}

/// Whether more harmonics stand out than two shells have.
fn is_made_by_many(found: &MeasuredLattice) -> bool {
    let harmonics = found.fit.iter().flat_map(|fit| &fit.harmonics);
    let strong = harmonics.filter(|harmonic| harmonic.signal_to_noise.powi(2) > SECOND);
    strong.count() > shells(2).len()
}
