//! Maps of images too large for memory, band by band.
//!
//! The lattice is looked for in the middle of the image; its fit is the reference of all bands, and the window that
//! the middle wants is that of all. Positions are nominal, corrected by the calibration of the scanner and for a drift
//! that the user gives.

use std::ops::Range;

use nalgebra::{Matrix2, Matrix4};

use super::scanner::calibrated;
use crate::background::remove_background;
use crate::geometry::{Geometry, Timing};
use crate::image::Image;
use crate::lattice::reciprocal::labelled_like;
use crate::lattice::{LatticeError, LatticeVectors, measure};
use crate::map::{
    Grid, LatticeMap, Reference, Resolution, Survey, TwistStrainMap, UsedHarmonic, local_lattices,
};
use crate::resample::at_rest;
use crate::settings::{Method, Settings};
use crate::strain::StrainError;

/// Side of the middle block that is looked at first, pixels.
const MIDDLE: usize = 2048;
/// Pixels of a band, halo not counted.
const BAND: usize = 1 << 24;
/// Smaller images are cut into so many bands.
const FEWEST_BANDS: usize = 4;

/// A large image, ready to be mapped band by band.
#[derive(Clone, Debug)]
pub struct SurveyPlan {
    survey: Survey,
    /// Of the pixels on the sample at rest.
    placed: Geometry,
    /// Whether a drift was taken off.
    pub drift_corrected: bool,
    settings: Settings,
    /// Width of the window, nm.
    pub window_nm: f64,
    /// The lattice of the middle, wave vectors as columns, rad/nm: labelling and branch of all nodes.
    pub whole: Matrix2<f64>,
    /// The harmonics of the middle.
    pub harmonics: Vec<UsedHarmonic>,
}

/// Why a large image cannot be mapped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurveyError {
    /// The lines could not be had.
    #[error("lines {from} to {to} cannot be read: {why}")]
    Lines {
        /// First line.
        from: usize,
        /// The line after the last.
        to: usize,
        /// Why.
        why: String,
    },
    /// There is no lattice in the middle.
    #[error("the middle of the image: {0}")]
    Lattice(LatticeError),
    /// No twist and strain explain it.
    #[error("the middle of the image: {0}")]
    Strain(StrainError),
    /// The lattice is there but cannot be mapped.
    #[error("the middle of the image shows a lattice, but nowhere clearly enough for a map")]
    NoMap,
}

/// The block of an image: columns and rows, the bottom line being row 0.
pub type ReadBlock<'a> = dyn Fn([Range<usize>; 2]) -> Result<Image, String> + 'a;

fn block(
    read: &ReadBlock,
    columns: Range<usize>,
    rows: Range<usize>,
) -> Result<Image, SurveyError> {
    let (from, to) = (rows.start, rows.end);
    read([columns, rows]).map_err(|why| SurveyError::Lines { from, to, why })
}

impl SurveyPlan {
    /// Looks at the middle of an image of this geometry, timing known or not. Other images of a survey take the
    /// window and the labelling of the first.
    ///
    /// # Errors
    /// [`SurveyError`]: no lines, or no lattice in the middle.
    pub fn new(
        (geometry, timing): (&Geometry, Option<&Timing>),
        (settings, resolution): (&Settings, &Resolution),
        first: Option<&Self>,
        read: &ReadBlock,
    ) -> Result<Self, SurveyError> {
        let geometry = &calibrated(geometry, settings);
        let drift = settings.drift.map(|d| d.velocity());
        let still = timing
            .zip(drift)
            .map(|(timing, d)| at_rest(geometry, timing, d));
        let drift_corrected = still.is_some();
        let placed = still.unwrap_or_else(|| geometry.clone());
        let dual = placed.pixel_to_nm.try_inverse().ok_or(SurveyError::NoMap)?;
        let dual = dual.transpose();
        let [columns, rows] = geometry.size.map(|n| {
            let side = n.min(MIDDLE);
            (n - side) / 2..(n - side) / 2 + side
        });
        let corner = [columns.start, rows.start];
        let middle = block(read, columns, rows)?;
        let of_middle = geometry.cropped(corner, [middle.columns, middle.rows]);
        let found = measure(&middle, &of_middle, settings.background, Method::Lattice)
            .map_err(SurveyError::Lattice)?;
        let pair = match first {
            Some(first) => {
                let back = dual.try_inverse().ok_or(SurveyError::NoMap)?;
                let exact = LatticeVectors {
                    basis: found.reciprocal,
                    covariance: Matrix4::zeros(),
                };
                labelled_like(&exact, &(back * first.whole)).basis
            }
            None => found.reciprocal,
        };
        let resolution = &Resolution {
            window_nm: first.map(|f| f.window_nm).or(resolution.window_nm),
            ..*resolution
        };
        let reference = Reference {
            pair,
            pitch: [geometry.fast_step().norm(), geometry.slow_step().norm()],
        };
        let flat = remove_background(&middle, settings.background);
        let map = local_lattices(&flat, &reference, resolution).ok_or(SurveyError::NoMap)?;
        Ok(Self {
            survey: Survey::new(
                geometry.size,
                reference,
                *resolution,
                map.window_nm,
                (BAND / geometry.size[0].max(1)).min(geometry.size[1].div_ceil(FEWEST_BANDS)),
            ),
            placed,
            drift_corrected,
            settings: settings.clone(),
            window_nm: map.window_nm,
            whole: dual * reference.pair,
            harmonics: map.harmonics,
        })
    }

    /// Number of bands.
    pub fn bands(&self) -> usize {
        self.survey.bands()
    }

    /// The map of one band, bottom first; a band without lattice has no nodes to believe but keeps its place.
    ///
    /// # Errors
    /// [`SurveyError`], where its lines cannot be read.
    pub fn band(&self, band: usize, read: &ReadBlock) -> Result<TwistStrainMap, SurveyError> {
        let rows = self.survey.rows(band);
        let lines = block(read, 0..self.placed.size[0], rows)?;
        let flat = remove_background(&lines, self.settings.background);
        drop(lines);
        let map = self.survey.map(band, &flat).ok_or(SurveyError::NoMap)?;
        let mut lattices = LatticeMap::new(&map, &self.placed).ok_or(SurveyError::NoMap)?;
        for node in &mut lattices.nodes {
            // Phases are followed within a band only.
            node.displacement.fill(f64::NAN);
        }
        let (layers, convention) = (self.settings.bilayer(), self.settings.strain_convention);
        let found = lattices
            .twist_strain(&self.whole, layers, convention)
            .map_err(SurveyError::Strain)?;
        Ok(TwistStrainMap::new(&lattices, &found))
    }

    /// A map of this window that has no nodes yet, on the grid of `first`.
    pub fn start(&self, first: &Grid) -> TwistStrainMap {
        TwistStrainMap::empty(*first, self.window_nm)
    }
}
