//! A lattice of known size and shape in a spectrum.
//!
//! In: the peaks of the spectrum, the positions of pixels and the cell that has to be there, at any
//! orientation and distorted by no more than an uncalibrated scanner and drift do it. Out: the lattices
//! of about that cell, best first. A cell with a large basis (a reconstructed surface) has higher harmonics
//! that are stronger than its first ones; without its size one of these would be taken for the lattice.

use std::sync::Arc;

use heterostrain::ComplexPair;
use heterostrain::lattice::{reciprocal, renamings, shortest_pair};
use nalgebra::{Matrix2, Vector2};

use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::numbers::three::three;
use crate::spectrum::error::LatticeError;
use crate::spectrum::harmonics::Windowed;
use crate::spectrum::prepare::{Prepared, binned, levelled};
use crate::spectrum::select::{
    Candidate, GENERATORS, Orders, Peak, TOLERANCE, by_score, frame_cycles, score, spectrum_peaks,
    well_explained,
};
use crate::spectrum::shells::shells;
use crate::spectrum::transform::Spectrum;
use crate::spectrum::verdict::{is_lattice, signal_to_noise};

/// The lattice may be smaller or larger than expected by this factor: less than √3, by which the second
/// harmonics of a hexagon differ from the first.
const MOST_SCALE: f64 = 1.6;
/// Largest distortion `|q|/|p|`: half of the stretch of one axis against the other.
const MOST_DISTORTION: f64 = 0.25;
/// The same where no lattice is as little distorted: a drift of half a frame does that.
const DRIFTING: f64 = 0.45;
/// Harmonics up to this order count: twice the fourth, which reconstructions show strongest.
const ORDERS: f64 = 8.0;

/// What the spectrum says about a lattice of about the cell `known` (real-space pair, nm).
pub(crate) fn prepare(
    image: &Image,
    geometry: &Geometry,
    background: Background,
    known: &Matrix2<f64>,
) -> Result<Prepared, LatticeError> {
    let image = levelled(image.clone(), background)?;
    let full = Spectrum::new(&image);
    let mut best = [0.0; 3];
    let little = candidates(&full, &geometry.pixel_to_nm, known, MOST_DISTORTION);
    let drifting = || candidates(&full, &geometry.pixel_to_nm, known, DRIFTING);
    let all = little
        .into_iter()
        .chain(std::iter::once_with(drifting).flatten());
    for candidate in all {
        let (binning, binned) = binned(&image, &candidate.pair);
        // The pair goes through all peaks that it explains; the first harmonics may be faint.
        let pair = candidate.pair * binning as f64;
        let Some(harmonics) = Windowed::new(&binned).fit(&binned, &pair, background, shells(3))
        else {
            continue;
        };
        if !is_lattice(&harmonics) && !well_explained(&candidate) {
            let ratios = signal_to_noise(&harmonics);
            if ratios[2] > best[2] {
                best = ratios;
            }
            continue;
        }
        let Some(start) = reciprocal(&harmonics.pair) else {
            continue;
        };
        return Ok(Prepared {
            image: Arc::new(image),
            binning,
            look: None,
            peaks: three(&pair),
            harmonics,
            start,
        });
    }
    Err(LatticeError::NoLattice { best })
}

/// Lattices of about the cell `known`, best first.
fn candidates(
    spectrum: &Spectrum,
    pixel_to_nm: &Matrix2<f64>,
    known: &Matrix2<f64>,
    most: f64,
) -> Vec<Candidate> {
    let to_physical = pixel_to_nm.try_inverse().map(|m| m.transpose());
    let (Some(to_physical), Some(wanted)) = (to_physical, reciprocal(known)) else {
        return Vec::new();
    };
    let names = names(&wanted);
    let like = |pair: &Matrix2<f64>| resembles(&(to_physical * pair), &names, most);
    let peaks = spectrum_peaks(spectrum);
    let generators = generators(&peaks, spectrum, &to_physical, &wanted, most);
    let mut found = Vec::new();
    // |p|² − |q|²: what most pairs have wrong is told by their area.
    let area = (wanted.determinant() / to_physical.determinant()).abs();
    let areas = area / MOST_SCALE.powi(2) * (1.0 - most.powi(2))..=area * MOST_SCALE.powi(2);
    for (i, a) in generators.iter().enumerate() {
        for b in &generators[i + 1..] {
            let pair = Matrix2::from_columns(&[*a, *b]);
            if !areas.contains(&pair.determinant().abs()) {
                continue;
            }
            let Some(change) = shortest_pair(&(to_physical * pair)) else {
                continue;
            };
            let pair = pair * change;
            if like(&pair)
                && !known_already(&found, &pair, spectrum)
                && let Some(candidate) = score(&pair, &peaks, spectrum, Orders(ORDERS))
                && like(&candidate.pair)
            {
                found.push(candidate);
            }
        }
    }
    by_score(found, spectrum, |_| true)
}

/// Whether a candidate has the same vectors already, before it was refined or after.
fn known_already(found: &[Candidate], pair: &Matrix2<f64>, spectrum: &Spectrum) -> bool {
    let frame = frame_cycles(spectrum);
    let near = |d: &Matrix2<f64>| {
        let d = frame * d;
        d.column(0).norm() < TOLERANCE && d.column(1).norm() < TOLERANCE
    };
    found
        .iter()
        .any(|c| near(&(c.pair - pair)) || near(&(c.pair + pair)))
}

/// Wave vectors that may be first harmonics, rad per pixel: those of peaks, and differences of peaks where
/// the first harmonics are fainter than higher ones.
fn generators(
    peaks: &[Peak],
    spectrum: &Spectrum,
    to_physical: &Matrix2<f64>,
    wanted: &Matrix2<f64>,
    most: f64,
) -> Vec<Vector2<f64>> {
    let (a, b) = (wanted.column(0), wanted.column(1));
    let lengths = [a.norm(), b.norm(), (b - a).norm()];
    let stretch = MOST_SCALE * (1.0 + most);
    let low = lengths.iter().copied().fold(f64::INFINITY, f64::min) / stretch;
    let high = lengths.iter().copied().fold(0.0, f64::max) * stretch;
    let frame = frame_cycles(spectrum);
    let mut kept: Vec<Vector2<f64>> = Vec::new();
    let mut offer = |q: Vector2<f64>| {
        let length = (to_physical * q).norm();
        let near = |other: &Vector2<f64>| {
            (frame * (q - other)).norm() < TOLERANCE || (frame * (q + other)).norm() < TOLERANCE
        };
        if length > low && length < high && !kept.iter().any(near) {
            kept.push(q);
        }
    };
    let strong = &peaks[..peaks.len().min(GENERATORS)];
    for peak in strong {
        offer(peak.q);
    }
    for (i, first) in strong.iter().enumerate() {
        for second in &strong[..i] {
            offer(first.q - second.q);
            offer(first.q + second.q);
        }
    }
    kept
}

/// `U W⁻¹` for each renaming U of the pair W (`wanted`): a pair P is W after the map `P U W⁻¹`. Empty for parallel vectors.
fn names(wanted: &Matrix2<f64>) -> Vec<Matrix2<f64>> {
    let inverse = wanted.try_inverse();
    let each = inverse.map(|inverse| renamings(1).map(move |name| name * inverse));
    each.into_iter().flatten().collect()
}

/// Whether `pair` is the lattice of these `names`, turned and a little distorted, under any of them.
fn resembles(pair: &Matrix2<f64>, names: &[Matrix2<f64>], most: f64) -> bool {
    names.iter().any(|name| {
        let shape = ComplexPair::from(pair * name);
        let [size, stretch] = [shape.p, shape.q].map(|z| z.norm_sqr());
        let sizes = MOST_SCALE.powi(-2)..MOST_SCALE.powi(2);
        sizes.contains(&size) && stretch < most.powi(2) * size
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hexagon turned and stretched by 5 % is the lattice, its second shell and a rectangle are not.
    #[test]
    fn the_known_cell_is_recognised_at_any_angle() {
        let hexagon = Matrix2::new(1.0, 0.5, 0.0, 0.75_f64.sqrt());
        let names = names(&hexagon);
        for turn in [0.0, 0.7, 2.1, 4.4] {
            let turn = nalgebra::Rotation2::new(turn).into_inner();
            let stretched = Matrix2::new(1.05, 0.02, 0.0, 0.97) * turn * hexagon;
            let resembles = |pair: Matrix2<f64>| resembles(&pair, &names, MOST_DISTORTION);
            assert!(resembles(stretched));
            assert!(!resembles(stretched * 3_f64.sqrt()));
            let rectangle = turn * Matrix2::new(1.0, 0.0, 0.0, 2.0);
            assert!(!resembles(rectangle));
        }
        // p = 1 and q the stretch.
        let stretched = |by: f64| Matrix2::new(1.0 + by, 0.0, 0.0, 1.0 - by) * hexagon;
        let resembles = |pair: Matrix2<f64>| resembles(&pair, &names, MOST_DISTORTION);
        assert!(resembles(stretched(0.24)) && !resembles(stretched(0.26)));
        assert!(resembles(hexagon * 1.59) && !resembles(hexagon * 1.61));
        assert!(resembles(hexagon / 1.59) && !resembles(hexagon / 1.61));
    }
}
