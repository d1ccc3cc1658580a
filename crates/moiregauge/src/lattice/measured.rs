//! The lattice of one image as it was measured.

use heterostrain::lattice::{Lattice, Px};
use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::coverage::bend::Change;
use crate::coverage::patch::LatticeRegion;
use crate::explain::beside::WaveBeside;
use crate::explain::cells::{Larger, MOST};
use crate::explain::evidence::BETTER;
use crate::explain::table::Row;
use crate::lattice::common::Common;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::paper::PublishedPeaks;
use crate::numbers::exact;
use crate::numbers::three::three;
use crate::spectrum::phases::Phases;

/// A grain beside the one that is measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Grain {
    /// Its share of the frame.
    #[serde(with = "exact")]
    pub share: f64,
    /// Its waves, rad per pixel.
    #[serde(with = "exact")]
    pub waves: Matrix2<f64>,
    /// Length of the boundary at which it was told apart, along columns and along rows, pixels.
    #[serde(with = "exact", default)]
    pub boundary: [f64; 2],
}

/// The atoms of a layer, in an image that shows its moiré as well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Atoms {
    /// Vectors in pixels (columns, rows).
    #[serde(with = "exact")]
    pub pixels: Lattice<Px>,
    /// As of [`Evidence`].
    #[serde(with = "exact")]
    pub predicts: Option<f64>,
    /// Amplitude over noise amplitude in one resolution cell, weakest of the first harmonics.
    #[serde(with = "exact")]
    pub signal_to_noise: f64,
}

/// The lattice of one image.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MeasuredLattice {
    /// Vectors in pixels (columns, rows).
    #[serde(with = "exact")]
    pub pixels: Lattice<Px>,
    /// The part of the frame that carries the lattice; `None` for all of it.
    pub patch: Option<LatticeRegion>,
    /// Side of the window of the running median that was taken off as ground, pixels; `None` where nothing was.
    #[serde(with = "exact", default, skip_serializing_if = "Option::is_none")]
    pub ground: Option<f64>,
    /// How it changes across that part; `None` where it is the same everywhere, as far as can be seen.
    pub change: Option<Change>,
    /// What of its errors all images of the sample share; `None` where there is nothing of the kind.
    #[serde(default)]
    pub common: Option<Common>,
    /// The other grains of the frame; this is the largest.
    pub grains: Vec<Grain>,
    /// The lattices of those that could be measured, until the scan is put together.
    #[serde(skip)]
    pub(crate) beside: Vec<MeasuredLattice>,
    /// Lattices with 2, 3 and 4 of its cells in one that the image may show.
    #[serde(skip)]
    pub(crate) larger: [Option<Larger>; 3],
    /// What the other estimator found: autocorrelation beside Fourier, Fourier beside all others.
    #[serde(with = "exact")]
    pub comparison: Option<Lattice<Px>>,
    /// The shortcut wavelengths `4π/(√3|K|)` of the three first harmonics, nm.
    #[serde(with = "exact")]
    pub shortcut_wavelengths: Option<[f64; 3]>,
    /// Reciprocal pair of the harmonics behind `phases`, rad per pixel, at 60° to each other.
    #[serde(with = "exact")]
    pub reciprocal: Matrix2<f64>,
    /// Phases of the harmonics K₁, K₂ and K₂ − K₁ of `reciprocal` at the pixel position `middle`, rad.
    /// There they are uncorrelated with the wave vectors.
    pub phases: Phases,
    /// Middle of the part of the frame that was used, (column, row), in fractions of pixels.
    #[serde(with = "exact")]
    pub middle: Vector2<f64>,
    /// What speaks for it; `None` with the other methods, and where it was told by hand.
    #[serde(default)]
    pub evidence: Option<Evidence>,
    /// Lattice periods across the shorter side of the frame.
    #[serde(with = "exact")]
    pub periods: f64,
    /// Amplitude over noise amplitude in one resolution cell, weakest of the first harmonics.
    #[serde(with = "exact")]
    pub signal_to_noise: f64,
    /// The peaks as published; `None` with the other methods.
    pub published: Option<PublishedPeaks>,
    /// The fit to the pixels; `None` with the other methods.
    pub fit: Option<LatticeFit>,
    /// The atoms of a layer that the image shows as well.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub atoms: Option<Box<Atoms>>,
}

/// What speaks for a lattice, beside its signal-to-noise ratio: its margin to an image without any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Evidence {
    /// By how many standard errors the weakest of its three waves improves the prediction of blocks of the frame that were held out; `None` where the
    /// frame is too small.
    #[serde(with = "exact")]
    pub predicts: Option<f64>,
    /// How many waves of about its period beside it are as strong as its weakest one.
    pub rivals: usize,
    /// By how many standard errors lattices with 2, 3 and 4 of its cells in one predict better, which were not taken.
    #[serde(with = "exact")]
    pub larger: [f64; 3],
    /// The lattices that were compared: this one, then the others, those that predict most first.
    #[serde(default)]
    pub candidates: Vec<Candidate>,
    /// Lengths of the three shortest vectors of a second lattice on top of it, nm, as of [`Candidate`]: the two were measured together, and the other
    /// numbers but for `candidates` are those of the image without it.
    #[serde(with = "exact", default)]
    pub second: Option<[f64; 3]>,
    /// The wave that the lattice does not explain and that predicts best, if it is not chance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beside: Option<WaveBeside>,
}

/// A lattice that an image may show.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Candidate {
    /// Lengths of its three shortest vectors before drift and calibration are taken off, nm, shortest first.
    #[serde(with = "exact")]
    pub wavelengths: [f64; 3],
    /// The same of a second lattice on top of it, where the two are described together: share and comparison are those of both.
    #[serde(with = "exact", default)]
    pub second: Option<[f64; 3]>,
    /// How many of its cells the lattice that was measured has in one: 3 and 4 where it is made of harmonics of that.
    pub cells: usize,
    /// Share of the variance of held-out blocks, without slow background, that it predicts.
    #[serde(with = "exact")]
    pub share: f64,
    /// By how many standard errors over blocks the lattice that was measured predicts better.
    #[serde(with = "exact")]
    pub behind: f64,
}

impl Evidence {
    /// The lattice that was measured, and another one, no part of its cell, that predicts at least half as much and is less than four standard errors behind.
    pub(crate) fn undecided(&self) -> Option<[Candidate; 2]> {
        // The other one may be the second lattice, which was measured too.
        self.second.is_none().then_some(())?;
        let as_well = |whole: &Candidate, other: &Candidate| {
            other.cells == 1 && other.behind < BETTER && other.share > MOST * whole.share
        };
        self.with(as_well)
    }

    /// The lattice that was measured, and that of a part of its cell that predicts at least half of what the rest of its harmonics does.
    pub(crate) fn part_of_cell(&self) -> Option<[Candidate; 2]> {
        let most = |whole: &Candidate, other: &Candidate| {
            other.cells > 1 && 2.0 * other.share > whole.share - other.share
        };
        self.with(most)
    }

    /// The lattice that was measured, and the first other one of which something is true.
    fn with(&self, is_it: impl Fn(&Candidate, &Candidate) -> bool) -> Option<[Candidate; 2]> {
        let (whole, others) = self.candidates.split_first()?;
        let other = others.iter().find(|other| is_it(whole, other))?;
        Some([*whole, *other])
    }
}

/// Lengths of the three shortest vectors, nm, shortest first, of a lattice with this reciprocal pair (rad per nm, at 60°).
pub(crate) fn wavelengths(pair: &Matrix2<f64>) -> [f64; 3] {
    // Each vector is across a wave: L = 2π |K| / |K₁ × K₂|.
    let per_wave = std::f64::consts::TAU / pair.determinant().abs();
    let mut wavelengths = three(pair).map(|wave| per_wave * wave.norm());
    wavelengths.sort_by(f64::total_cmp);
    wavelengths
}

impl Candidate {
    /// `to_physical`: wave vectors (rad per pixel) to rad per nm.
    pub(crate) fn new(row: &Row, to_physical: &Matrix2<f64>) -> Self {
        Self {
            wavelengths: wavelengths(&(to_physical * row.pair)),
            second: row.second.map(|pair| wavelengths(&(to_physical * pair))),
            cells: row.cells,
            share: row.share,
            behind: row.behind,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A second lattice that was measured is no rival, and says nothing of a lattice that may be that of a part of the cell.
    #[test]
    fn a_second_lattice_hides_no_part_of_the_cell() {
        let candidate = |cells, share, behind| Candidate {
            wavelengths: [10.0; 3],
            second: None,
            cells,
            share,
            behind,
        };
        let mut evidence = Evidence {
            predicts: None,
            rivals: 0,
            larger: [0.0; 3],
            second: None,
            candidates: vec![
                candidate(1, 0.9, 0.0),
                candidate(1, 0.8, 1.0),
                candidate(3, 0.7, 9.0),
            ],
            beside: None,
        };
        assert!(evidence.undecided().is_some() && evidence.part_of_cell().is_some());
        evidence.second = Some([9.0; 3]);
        assert!(evidence.undecided().is_none() && evidence.part_of_cell().is_some());
    }
}
