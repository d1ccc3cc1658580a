//! Lattice vectors of one image.
//!
//! In: an image and its geometry. Out: two primitive vectors with their covariance, in pixels. The
//! image is a lattice of pixels under an affine map, so the lattice is measured in pixels and the
//! vectors are mapped; nothing is resampled (but by the published method, for reproduction).

mod autocorrelation;
mod fit;
mod fourier;
mod harmonics;
mod high_orders;
pub(crate) mod known;
pub(crate) mod noise;
mod paper;
mod phases;
mod pictures;
mod prepare;
pub(crate) mod reciprocal;
mod rescue;
mod select;
mod several;
pub(crate) mod transform;
pub(crate) mod vectors;

use nalgebra::{Matrix2, Vector2};

pub use fit::{Closure, FittedHarmonic, ForeignWave, Inhomogeneity, LatticeFit};
pub use paper::PublishedPeaks;
pub use phases::Phases;
pub(crate) use pictures::pictures;
pub use several::measure_several;
pub use vectors::LatticeVectors;

use crate::background::remove_background;
use crate::geometry::Geometry;
use crate::image::Image;
use crate::settings::{Background, Method};
use prepare::{Prepared, binning, middle, phases, prepare, refine, signal_to_noise};
use transform::Spectrum;

/// The lattice of one image.
#[derive(Clone, Debug)]
pub struct MeasuredLattice {
    /// Vectors in pixels (columns, rows).
    pub pixels: LatticeVectors,
    /// What the other estimator found: autocorrelation beside Fourier, Fourier beside all others.
    pub comparison: Option<LatticeVectors>,
    /// The shortcut wavelengths `4π/(√3|K|)` of the three first harmonics, nm.
    pub shortcut_wavelengths: Option<[f64; 3]>,
    /// Reciprocal pair of the harmonics behind `phases`, rad per pixel, at 60° to each other.
    pub reciprocal: Matrix2<f64>,
    /// Phases of the harmonics K₁, K₂ and K₂ − K₁ of `reciprocal` at the pixel position `middle`, rad.
    /// There they are uncorrelated with the wave vectors.
    pub phases: Phases,
    /// Middle of the part of the frame that was used, (column, row), in fractions of pixels.
    pub middle: Vector2<f64>,
    /// Lattice periods across the shorter side of the frame.
    pub periods: f64,
    /// Amplitude over noise amplitude in one resolution cell, weakest of the first harmonics.
    pub signal_to_noise: f64,
    /// The peaks as published; `None` with the other methods.
    pub published: Option<PublishedPeaks>,
    /// The fit to the pixels; `None` with the other methods.
    pub fit: Option<LatticeFit>,
}

/// Why an image gives no lattice.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LatticeError {
    /// The frame is too small.
    #[error("the frame has {columns} × {rows} pixels; at least 16 × 16 are needed")]
    TooSmall {
        /// Samples in a line.
        columns: usize,
        /// Lines.
        rows: usize,
    },
    /// There is nothing in it.
    #[error("the channel is constant or has no valid pixel")]
    Constant,
    /// Too many pixels are missing.
    #[error("{missing} of {total} pixels are missing; at most half may be")]
    Missing {
        /// Missing pixels.
        missing: usize,
        /// All pixels.
        total: usize,
    },
    /// There is no lattice in it.
    #[error("the image shows no lattice: {}", prepare::too_weak(best))]
    NoLattice {
        /// Signal-to-noise ratios (amplitude) of the best three wave vectors, largest first; 0 where none were found.
        best: [f64; 3],
    },
    /// The lattice shows in the spectrum, but this method gets no hold of it.
    #[error(
        "the spectrum shows a lattice, but the {method:?} method finds too few of its peaks: noise \
         hides them or the frame is too small for them; the Fourier transform of the image may do"
    )]
    NoPeaks {
        /// The method.
        method: Method,
    },
    /// Several lattices were asked for.
    #[error(
        "{wanted} lattices were asked for, of which {found} can be found: what else stands out is noise or lies on \
         the waves of these, as their harmonics do and those of a lattice that is nearly commensurate with them"
    )]
    FewerLattices {
        /// How many there are.
        found: usize,
        /// How many were wanted.
        wanted: usize,
    },
    /// Several lattices lie too close to each other.
    #[error(
        "the wave vectors of two lattices lie so close to each other that this frame cannot tell them apart; \
         a larger frame can"
    )]
    Entangled,
}

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
    let start = match Start::find(image, geometry, background) {
        Err(error @ LatticeError::NoLattice { .. }) if method == Method::Lattice => {
            Start::find_again(image, geometry, background).map_err(|_| error)?
        }
        other => other?,
    };
    start.measure(method)
}

/// Where the lattice of an image is, roughly: what every method starts from.
pub struct Start {
    prepared: Prepared,
    geometry: Geometry,
    background: Background,
    /// (columns, rows).
    size: [usize; 2],
}

impl Start {
    /// Looks for the lattice in the spectrum.
    ///
    /// # Errors
    /// As [`measure`], but for [`LatticeError::NoPeaks`].
    pub fn find(
        image: &Image,
        geometry: &Geometry,
        background: Background,
    ) -> Result<Self, LatticeError> {
        let prepared = prepare(image, geometry, background)?;
        Ok(Self::new(prepared, image, geometry, background))
    }

    /// Looks for a lattice of about the cell `known` (real-space pair, nm), at any orientation.
    ///
    /// # Errors
    /// As [`Start::find`]: [`LatticeError::NoLattice`] where there is none of that size and shape.
    pub fn find_known(
        image: &Image,
        geometry: &Geometry,
        background: Background,
        known: &Matrix2<f64>,
    ) -> Result<Self, LatticeError> {
        let prepared = known::prepare(image, geometry, background, known)
            .or_else(|_| rescue::prepare_known_again(image, geometry, background, known))?;
        Ok(Self::new(prepared, image, geometry, background))
    }

    /// The same for an image whose lattice hides under tip events and line noise.
    fn find_again(
        image: &Image,
        geometry: &Geometry,
        background: Background,
    ) -> Result<Self, LatticeError> {
        let prepared = rescue::prepare_again(image, geometry, background)?;
        Ok(Self::new(prepared, image, geometry, background))
    }

    /// The reciprocal pairs (rad per pixel) that the spectrum proposes, whether they stand out or not.
    fn proposals(image: &Image, geometry: &Geometry, background: Background) -> Vec<Matrix2<f64>> {
        let flat = remove_background(image, background);
        let proposed = select::candidates(&Spectrum::new(&flat), &geometry.pixel_to_nm);
        proposed.into_iter().map(|c| c.pair).collect()
    }

    /// Starts from a reciprocal pair (rad per pixel) that is known to within half a cycle over the frame.
    /// `None` where it cannot be measured.
    fn near(
        image: &Image,
        geometry: &Geometry,
        background: Background,
        pair: &Matrix2<f64>,
    ) -> Option<Self> {
        let flat = remove_background(image, background);
        let binning = binning(pair);
        let binned = if binning == 1 {
            flat.clone()
        } else {
            flat.binned(binning)
        };
        let (harmonics, peaks) = refine(&binned, &(pair * binning as f64), background)?;
        let prepared = Prepared {
            start: reciprocal::reciprocal(&harmonics.pair)?,
            spectrum: Spectrum::new(&binned),
            image: flat,
            binning,
            harmonics,
            peaks,
        };
        Some(Self::new(prepared, image, geometry, background))
    }

    fn new(prepared: Prepared, image: &Image, geometry: &Geometry, background: Background) -> Self {
        Self {
            prepared,
            geometry: geometry.clone(),
            background,
            size: [image.columns, image.rows],
        }
    }

    /// Measures the lattice.
    ///
    /// # Errors
    /// [`LatticeError::NoPeaks`]: the method gets no hold of it.
    pub fn measure(&self, method: Method) -> Result<MeasuredLattice, LatticeError> {
        let Prepared {
            harmonics,
            spectrum,
            peaks,
            start,
            ..
        } = &self.prepared;
        let pixels_per_bin = self.prepared.binning as f64;
        let in_pixels = |l: LatticeVectors| l.mapped(&(Matrix2::identity() * pixels_per_bin));
        let fourier = || fourier::measure(harmonics, peaks, spectrum.image_size).map(in_pixels);
        let autocorrelation =
            || autocorrelation::measure(spectrum, harmonics, start).map(in_pixels);
        let (mut fit, mut published) = (None, None);
        let (pixels, comparison) = match method {
            Method::Autocorrelation => (autocorrelation(), fourier()),
            Method::Fourier => (fourier(), autocorrelation()),
            Method::Lattice => {
                fit = fitted(&self.prepared, self.background);
                (fit.as_ref().map(|(lattice, _)| *lattice), fourier())
            }
            Method::Paper => {
                let image = &self.prepared.image;
                let found = paper::measure(image, &self.geometry, &(start * pixels_per_bin));
                published = found.map(|(_, peaks)| peaks);
                (found.map(|(lattice, _)| lattice), fourier())
            }
        };
        let fit = fit.map(|(_, fit)| fit);
        let pixels = pixels.ok_or(LatticeError::NoPeaks { method })?;
        let label = |l: LatticeVectors| reciprocal::labelled_like(&l, &pixels.basis);
        let longest = (0..3)
            .map(|i| pixels.vector(i))
            .map(|v| (v.x / self.size[0] as f64).hypot(v.y / self.size[1] as f64));
        let bin_to_nm = self.geometry.pixel_to_nm * pixels_per_bin;
        Ok(MeasuredLattice {
            pixels,
            comparison: comparison.map(label),
            reciprocal: fit.as_ref().map_or(harmonics.pair / pixels_per_bin, |fit| {
                fit.wave_vectors.basis
            }),
            phases: fit.as_ref().map_or_else(
                || phases(harmonics, spectrum.image_size),
                LatticeFit::first_phases,
            ),
            middle: middle(spectrum.image_size) * pixels_per_bin
                + Vector2::repeat((pixels_per_bin - 1.0) / 2.0),
            shortcut_wavelengths: fourier::shortcut_wavelengths(peaks, &bin_to_nm),
            periods: 1.0 / longest.fold(0.0, f64::max),
            signal_to_noise: fit.as_ref().map_or_else(
                || signal_to_noise(harmonics)[2],
                LatticeFit::weakest_signal_to_noise,
            ),
            published,
            fit,
        })
    }
}

/// The lattice fitted to the pixels, in pixels.
fn fitted(prepared: &Prepared, background: Background) -> Option<(LatticeVectors, LatticeFit)> {
    let binning = prepared.binning;
    let start = &prepared.harmonics;
    let (lattice, fit) = if binning == 1 {
        fit::measure(&prepared.image, start, background)?
    } else {
        fit::measure(&prepared.image.binned(binning), start, background)?
    };
    let to_pixels = Matrix2::identity() * binning as f64;
    Some((lattice.mapped(&to_pixels), fit.in_pixels(binning)))
}
