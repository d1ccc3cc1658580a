//! An image made ready for measuring, and where its lattice is, roughly.

use std::borrow::Cow;
use std::sync::Arc;

use heterostrain::lattice::reciprocal;
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::frame::background::{Background, take_background_off};
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::numbers::three::three;
use crate::spectrum::error::LatticeError;
use crate::spectrum::harmonics::Harmonics;
use crate::spectrum::look::{Look, in_other_bins};
use crate::spectrum::phases::Phases;
use crate::spectrum::transform::Spectrum;
use crate::spectrum::verdict::{is_lattice, refine, signal_to_noise};
use crate::spectrum::{high_orders, select};

/// What is left of a constant or a plane when it is taken off, as a share of the values: a few hundred units of
/// rounding.
const ROUNDING: f64 = 1e-13;
/// The smallest side of a frame, pixels: fewer hold no periods that are sampled. Chosen by eye.
const SMALLEST_SIDE: usize = 16;

/// An image without background and what its spectrum says: where the lattice is, roughly.
pub(crate) struct Prepared {
    /// The image at full resolution.
    pub(crate) image: Arc<Image>,
    /// Pixels of the image per bin. Everything below counts in bins.
    pub(crate) binning: usize,
    /// The first look that showed harmonics and peaks; they are then good enough to start a fit from.
    pub(crate) look: Option<Look>,
    pub(crate) harmonics: Harmonics,
    /// The first three wave vectors, each by itself, rad per bin.
    pub(crate) peaks: [Vector2<f64>; 3],
    /// Real-space pair at 60°.
    pub(crate) start: Matrix2<f64>,
}

impl Prepared {
    /// The image in bins.
    pub(crate) fn binned(&self) -> Cow<'_, Image> {
        match self.binning {
            1 => Cow::Borrowed(&self.image),
            size => Cow::Owned(self.image.binned(size)),
        }
    }

    /// Bins along columns and rows.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.image.columns, self.image.rows].map(|n| n / self.binning)
    }

    /// Harmonics and peaks by the bins themselves, where a first look is not enough.
    pub(crate) fn refined(&self, background: Background) -> Option<(Harmonics, [Vector2<f64>; 3])> {
        if self.look.is_some() {
            refine(&self.binned(), &self.harmonics.pair, background)
        } else {
            Some((self.harmonics.clone(), self.peaks))
        }
    }
}

/// What a first look at a large image finds.
fn looked_at(
    look: &Look,
    image: &Arc<Image>,
    geometry: &Geometry,
    background: Background,
) -> Option<Prepared> {
    let found = look.lattice(image, geometry, background)?;
    let binning = binning(&(found.harmonics.pair / look.bins as f64));
    let harmonics = in_other_bins(&found.harmonics, look.bins, binning);
    let ratio = binning as f64 / look.bins as f64;
    let start = reciprocal(&harmonics.pair)?;
    Some(Prepared {
        image: Arc::clone(image),
        binning,
        look: Some(look.clone()),
        start,
        peaks: found.peaks.map(|q| q * ratio),
        harmonics,
    })
}

pub(crate) fn prepare(
    image: &Image,
    geometry: &Geometry,
    background: Background,
) -> Result<Prepared, LatticeError> {
    let image = levelled(image.clone(), background)?;
    prepare_levelled(Arc::new(image), geometry, background)
}

/// The same for an image without its background.
pub(crate) fn prepare_levelled(
    image: Arc<Image>,
    geometry: &Geometry,
    background: Background,
) -> Result<Prepared, LatticeError> {
    let look = Look::at(&image);
    let looked = look
        .as_ref()
        .and_then(|look| looked_at(look, &image, geometry, background));
    if let Some(found) = looked {
        return Ok(found);
    }
    let full = Spectrum::new(&image);
    let mut best = [0.0; 3];
    for candidate in select::candidates(&full, &geometry.pixel_to_nm) {
        let look = look.as_ref();
        let roughly = look.and_then(|look| look.shows(&image, &candidate.pair, background));
        if let Some((false, ratios)) = roughly {
            best = better(best, ratios);
            continue;
        }
        let (binning, binned) = binned(&image, &candidate.pair);
        let pair = candidate.pair * binning as f64;
        let Some((mut harmonics, mut peaks)) = refine(&binned, &pair, background) else {
            continue;
        };
        if !is_lattice(&harmonics) {
            let Some(found) = high_orders::refine(&binned, &pair, background) else {
                best = better(best, signal_to_noise(&harmonics));
                continue;
            };
            (harmonics, peaks) = found;
        }
        let Some(start) = reciprocal(&harmonics.pair) else {
            continue;
        };
        return Ok(Prepared {
            image,
            binning,
            look: None,
            harmonics,
            peaks,
            start,
        });
    }
    Err(LatticeError::NoLattice { best })
}

/// Of two candidates' signal-to-noise ratios those whose weakest wave is stronger.
fn better(best: [f64; 3], ratios: [f64; 3]) -> [f64; 3] {
    if ratios[2] > best[2] { ratios } else { best }
}

/// The image without its background, if there is anything in it to measure.
pub(crate) fn levelled(mut image: Image, background: Background) -> Result<Image, LatticeError> {
    let (rows, columns) = (image.rows, image.columns);
    if rows < SMALLEST_SIDE || columns < SMALLEST_SIDE {
        return Err(LatticeError::TooSmall { columns, rows });
    }
    let total = image.values.len();
    let missing = image.values.par_iter().filter(|v| !v.is_finite()).count();
    if missing == total {
        return Err(LatticeError::Constant);
    }
    if 2 * missing > total {
        return Err(LatticeError::Missing { missing, total });
    }
    let largest = |image: &Image| {
        let lines = image.values.par_chunks(image.columns);
        let of_line = |line: &[f64]| {
            let finite = line.iter().filter(|v| v.is_finite());
            finite.fold(0.0f64, |a, v| a.max(v.abs()))
        };
        lines.map(of_line).reduce(|| 0.0, f64::max)
    };
    let before = largest(&image);
    take_background_off(&mut image, background);
    if largest(&image) <= ROUNDING * before {
        return Err(LatticeError::Constant);
    }
    Ok(image)
}

/// Bins per shortest period of the first harmonics: enough for their second order.
const BINS_PER_PERIOD: f64 = 16.0;

/// How many pixels may be averaged without touching the lattice: it is band-limited, and what the
/// mean over a bin does to a harmonic is to its amplitude, not to its wave vector.
pub(crate) fn binning(pair: &Matrix2<f64>) -> usize {
    let [a, b, c] = three(pair).map(|wave| wave.norm());
    let shortest_period = std::f64::consts::TAU / a.max(b).max(c);
    ((shortest_period / BINS_PER_PERIOD) as usize).max(1)
}

/// The image with as many pixels averaged as [`binning`] allows, and how many these are along each axis.
pub(crate) fn binned<'a>(image: &'a Image, pair: &Matrix2<f64>) -> (usize, Cow<'a, Image>) {
    match binning(pair) {
        1 => (1, Cow::Borrowed(image)),
        size => (size, Cow::Owned(image.binned(size))),
    }
}

/// The middle of a frame of (columns, rows), as a position among its pixels or bins.
pub(crate) fn middle(size: [usize; 2]) -> Vector2<f64> {
    Vector2::new(size[0] as f64 - 1.0, size[1] as f64 - 1.0) / 2.0
}

/// Phases of the first three harmonics at the middle of the frame.
///
/// The variance of a phase is that of the amplitude across it: `S Σw² / (2 |c|² (Σw)²)`.
pub(crate) fn phases(harmonics: &Harmonics, size: [usize; 2]) -> Phases {
    let middle = middle(size);
    let (mut values, mut variances) = ([0.0; 3], [f64::INFINITY; 3]);
    for (h, harmonic) in harmonics.list.iter().take(3).enumerate() {
        values[h] = harmonic.amplitude.arg() + harmonic.q.dot(&middle);
        variances[h] = 1.0 / (2.0 * harmonic.significance(harmonics.window_sums));
    }
    Phases::independent(values, variances)
}
