//! Acceptance of a lattice by the prediction of held-out blocks.

use heterostrain::lattice::distortion;
use nalgebra::Matrix2;

use crate::explain::beside::wave_beside;
use crate::explain::cells::{better_cell, predicted_superlattice};
use crate::explain::evidence::{BETTER, gain, proposed, weakest};
use crate::explain::table::{Row, table};
use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::measured::{Candidate, Evidence, MeasuredLattice, wavelengths};
use crate::lattice::start::{Start, measure_pair};
use crate::spectrum::error::{LatticeError, SECOND};
use crate::spectrum::method::Method;
use crate::spectrum::prepare::binned;
use crate::spectrum::rivals::{ENOUGH, Rivals};
use crate::spectrum::select::{FEWEST_PERIODS, MOST_DISTORTION, candidates_beside};
use crate::spectrum::shells::shells;
use crate::spectrum::transform::Spectrum;

/// A lattice without a significant first order is accepted if the weakest family of its harmonics predicts held-out pixels by this many standard
/// errors. The best of 57 candidates in a rough background had 3.4.
const BEYOND_DOUBT: f64 = 5.0;
/// Smallest significance of the prediction, standard errors. Accepted lattices of 120 sets with one to four defects had at least 1.6 (the three
/// below 2 were right), single steps at most 0.
pub(crate) const LEAST: f64 = 1.5;
/// Largest relative change of the waves from corner to corner: gradients and waves of twist and strain make up
/// to a tenth, creep in a frame of four periods of atoms a half, and holes that pass for a coarse lattice 0.7 to 1.4.
const MOST_CHANGE: f64 = 0.6;

/// The lattice with several times the cell, or a part of it, that predicts the image better than the one that was found; that one if none does.
pub(crate) fn of_better_cell(
    found: MeasuredLattice,
    image: &Image,
    geometry: &Geometry,
    background: Background,
    method: Method,
) -> MeasuredLattice {
    let part = found.patch.as_ref().map(|patch| patch.of(image));
    let nested = better_cell(
        part.as_ref().unwrap_or(image),
        &found.reciprocal,
        bends(&found),
    );
    let measured = || {
        let part = found.patch.as_ref();
        measure_pair(&nested.better?, part, image, geometry, background, method)
    };
    let mut better = measured().unwrap_or(found);
    better.larger = nested.larger;
    better
}

/// The proposed lattice that predicts held-out pixels best, if it exceeds [`BEYOND_DOUBT`]. Spots of differing height put noise beside each peak, and the search
/// for significant peaks then finds none.
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
    let (found, method) = (start.measure(Method::Lattice).ok()?, Method::Lattice);
    Some(of_better_cell(found, image, geometry, background, method))
}

/// The lattice `found` with its evidence, or a proposed lattice that predicts the lattice region better.
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
    let part = found.patch.clone();
    let instead = |pair: Matrix2<f64>| {
        let part = part.as_ref();
        let other = measure_pair(&pair, part, image, geometry, background, Method::Lattice)?;
        let (other, _) = with_evidence(other, image, geometry);
        accepted(other, geometry).ok()
    };
    // A cell that is refused may be a part of one that predicts better.
    let larger = found.larger.into_iter().flatten();
    let larger = larger.max_by(|a, b| a.predicts.total_cmp(&b.predicts));
    let larger = larger.filter(|larger| larger.predicts > BETTER);
    match accepted(found, geometry) {
        Ok(found) => Ok(better.and_then(instead).unwrap_or(found)),
        Err(error) => larger.and_then(|larger| instead(larger.pair)).ok_or(error),
    }
}

/// Adds to a lattice, and to the grains beside it, their evidence within their lattice regions. Also returns the reciprocal pair (rad per pixel) of a
/// lattice that predicts better, if there is one.
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
    let bends = bends(&found);
    let (rows, rivals) = compared(&found, part, geometry, &to_physical);
    let is_better = |row: &&Row| {
        let weakest = || weakest(part, &row.pair, bends);
        let is_other = row.cells == 1 && row.second.is_none() && row.behind < -BETTER;
        is_other && weakest().is_some_and(|least| least > BETTER)
    };
    let better = rows.iter().find(is_better).map(|row| row.pair);
    let candidates = rows.iter().map(|row| Candidate::new(row, &to_physical));
    // Waves near the points of larger cells that may be their own.
    let larger = found.larger.into_iter().flatten();
    let doubtful = larger.filter(|larger| larger.predicts > BETTER);
    let doubtful = doubtful.map(|larger| Row {
        share: gain(part, &larger.pair, bends).unwrap_or(0.0),
        cells: 1,
        pair: larger.pair,
        second: None,
        behind: -larger.predicts,
    });
    let doubtful = doubtful.map(|row| Candidate::new(&row, &to_physical));
    let own = weakest(part, &found.reciprocal, bends);
    // Of a superlattice with faint waves one direction may drown in offsets of lines.
    let predicts = own.map(|own| {
        let shown = || predicted_superlattice(part, &found.reciprocal, bends);
        let shown = if own < LEAST { shown() } else { None };
        shown.unwrap_or(own)
    });
    found.evidence = Some(Evidence {
        predicts,
        rivals,
        larger: found.larger.map(|l| l.map_or(0.0, |l| l.predicts)),
        candidates: candidates.chain(doubtful).collect(),
        second: None,
        beside: wave_beside(part, &found.reciprocal, bends),
    });
    (found, better)
}

/// The lattices that an image shows in place of the one that was found, and how many rival waves there are. `to_physical`: wave vectors (rad per pixel) to
/// rad per nm.
fn compared(
    found: &MeasuredLattice,
    image: &Image,
    geometry: &Geometry,
    to_physical: &Matrix2<f64>,
) -> (Vec<Row>, usize) {
    let (binning, bins) = binned(image, &found.reciprocal);
    let (binning, spectrum) = (binning as f64, Spectrum::new(&bins));
    let own = found.reciprocal * binning;
    let proposals = candidates_beside(&own, &spectrum, &(geometry.pixel_to_nm * binning));
    let proposals: Vec<Matrix2<f64>> = proposals.iter().map(|c| c.pair / binning).collect();
    // A cell of many atoms has many strong harmonics, and peaks of its own period are no rivals.
    let rivals = if is_made_by_many(found) {
        0
    } else {
        Rivals::new(&spectrum).of(&own, to_physical, usize::MAX)
    };
    drop((spectrum, bins));
    let rows = table(image, &found.reciprocal, &proposals, bends(found));
    (rows.unwrap_or_default(), rivals)
}

/// The lattice measured beside `second` (reciprocal pair, rad per pixel), with its evidence: in `rest`, the image without that one. The lattices that are
/// compared are those of the image.
pub(crate) fn with_evidence_beside(
    found: MeasuredLattice,
    second: &Matrix2<f64>,
    [image, rest]: [&Image; 2],
    geometry: &Geometry,
) -> Option<MeasuredLattice> {
    let to_physical = geometry.pixel_to_nm.try_inverse()?.transpose();
    let (mut found, _) = with_evidence(found, rest, geometry);
    let (rows, _) = compared(&found, image, geometry, &to_physical);
    let evidence = found.evidence.as_mut()?;
    let candidates = rows.iter().map(|row| Candidate::new(row, &to_physical));
    evidence.candidates = candidates.collect();
    evidence.second = Some(wavelengths(&(to_physical * second)));
    accepted(found, geometry).ok()
}

/// The lattice, if its evidence does not refute it, with the grains beside it that pass the same tests.
///
/// # Errors
/// [`LatticeError::OneOfMany`]: other peaks of the image could form a lattice as well. [`LatticeError::NotPredicted`]: it does not predict held-out
/// pixels. [`LatticeError::Distorted`]: its cell is too far from a hexagon. [`LatticeError::TooFewPeriods`]: fewer than two periods fit across the frame.
/// [`LatticeError::NowhereTogether`]: it varies too much. [`LatticeError::NoPeaks`]: its errors are as large as half of its vectors.
pub(crate) fn accepted(
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
    let pixels = &found.pixels;
    let is_open = |i: usize| {
        let variance = pixels.covariance.fixed_view::<2, 2>(2 * i, 2 * i).trace();
        !(4.0 * variance < pixels.basis.column(i).norm_squared())
    };
    if is_open(0) || is_open(1) {
        let method = Method::Lattice;
        return Err(LatticeError::NoPeaks { method });
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
    // The prediction follows phases as cubic polynomials, which an inhomogeneous lattice does not have.
    let predicts = evidence.and_then(|evidence| evidence.predicts);
    let is_plain = found.change.is_none() && !is_made_by_many(&found);
    match predicts.filter(|least| *least < LEAST && is_plain) {
        Some(standard_errors) => Err(LatticeError::NotPredicted { standard_errors }),
        None => Ok(found),
    }
}

/// True if the lattice varies across the frame.
pub(crate) fn bends(found: &MeasuredLattice) -> bool {
    let fit = found.fit.as_ref();
    found.change.is_some() || fit.is_some_and(|fit| fit.change().is_some())
}

/// True if more harmonics are strong than two shells have.
fn is_made_by_many(found: &MeasuredLattice) -> bool {
    let harmonics = found.fit.iter().flat_map(|fit| &fit.harmonics);
    let strong = harmonics.filter(|harmonic| harmonic.signal_to_noise.powi(2) > SECOND);
    strong.count() > shells(2).len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::find::measure;
    use crate::numbers::rng::normals;
    use crate::numbers::three::three;
    use nalgebra::Vector2;

    /// A lattice whose errors are as large as half of its vectors, or no numbers, is refused; the same with its own errors is not.
    #[test]
    fn what_is_not_known_to_half_of_itself_is_refused() {
        let (pair, mut normal) = (Matrix2::new(0.7, 0.35, 0.0, 0.61), normals(1, "open", 0));
        let value = |i: usize| {
            let at = Vector2::new((i % 96) as f64, (i / 96) as f64);
            three(&pair).iter().map(|q| q.dot(&at).cos()).sum::<f64>() + 0.3 * normal()
        };
        let image = Image::new(80, 96, (0..96 * 80).map(value).collect());
        let geometry = Geometry {
            pixel_to_nm: Matrix2::identity(),
            origin: Vector2::zeros(),
            size: [96, 80],
            covariance: nalgebra::Matrix4::zeros(),
            from_sensors: false,
            departure: None,
        };
        let found = measure(&image, &geometry, Background::Plane, Method::Lattice).unwrap();
        assert!(accepted(found.clone(), &geometry).is_ok());
        for times in [1e12, f64::NAN] {
            let mut open = found.clone();
            open.pixels.covariance *= times;
            let refused = accepted(open, &geometry).err();
            assert!(
                matches!(refused, Some(LatticeError::NoPeaks { .. })),
                "{refused:?}"
            );
        }
    }

    /// A first shell of 3 % of the second, of which one wave runs across the lines and drowns in their offsets: the larger cell is found.
    #[test]
    fn offsets_of_lines_hide_no_superlattice() {
        let pair = Matrix2::new(0.2578, 0.0061, 0.1265, 0.2918);
        let [columns, rows] = [208, 192];
        for seed in 0..3 {
            let mut normal = normals(seed, "faint", 0);
            let offsets: Vec<f64> = (0..rows).map(|_| 0.4 * normal()).collect();
            let value = |i: usize| {
                let at = Vector2::new((i % columns) as f64, (i / columns) as f64);
                let [a, b] = [0, 1].map(|j| pair.column(j).dot(&at) + 0.8);
                let first = a.cos() + b.cos() + (b - a).cos();
                let second = (a + b).cos() + (2.0 * b - a).cos() + (2.0 * a - b).cos();
                0.03 * first + second + offsets[i / columns] + 0.2 * normal()
            };
            let image = Image::new(rows, columns, (0..rows * columns).map(value).collect());
            let geometry = Geometry {
                pixel_to_nm: Matrix2::identity(),
                origin: Vector2::zeros(),
                size: [columns, rows],
                covariance: nalgebra::Matrix4::zeros(),
                from_sensors: false,
                departure: None,
            };
            let found = measure(&image, &geometry, Background::Plane, Method::Lattice).unwrap();
            let cells = found.reciprocal.determinant().abs() / pair.determinant().abs();
            assert!((cells - 1.0).abs() < 0.01, "{seed}: {cells}");
        }
    }
}
