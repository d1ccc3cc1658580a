//! Maps of images too large for memory, band by band.
//!
//! The lattice is looked for in the middle of the image; its fit is the reference of all bands, and the window that
//! the middle wants is that of all. Positions are nominal, corrected by the calibration of the scanner and for a drift
//! that the user gives.

use std::f64::consts::TAU;
use std::ops::Range;

use heterostrain::lattice::{Lattice, Nm, Px, Waves, canonical, labelled_like, reciprocal};
use heterostrain::strain::StrainError;
use nalgebra::{Matrix2, Vector2};

use crate::caveat::Caveat;
use crate::domains::cells::DomainMap;
use crate::domains::nodes::Contrast;
use crate::frame::background::remove_background;
use crate::frame::geometry::{Geometry, Timing};
use crate::frame::image::Image;
use crate::lattice::find::measure;
use crate::lattice::measured::MeasuredLattice;
use crate::map::local::local_lattices;
use crate::map::nodes::Grid;
use crate::map::quantities::TwistStrainMap;
use crate::map::sample::LatticeMap;
use crate::map::survey::Survey;
use crate::meaning::about::name_caveats;
use crate::meaning::naming::named_waves;
use crate::meaning::strengths::WaveStrengths;
use crate::scan::place::Place;
use crate::settings::knobs::Settings;
use crate::spectrum::error::LatticeError;
use crate::spectrum::method::Method;
use crate::survey::domain_mapping::domains_of;
use crate::survey::mapping::pitch;
use crate::window::types::{FULL_WIDTH, Reference, Resolution, ResolutionError, UsedHarmonic};

/// Side of the middle block that is looked at first, pixels. Chosen by eye.
const MIDDLE: usize = 2048;
/// Pixels of a band, halo not counted, for the memory's sake.
const BAND: usize = 1 << 24;
/// Number of bands of smaller images, so that work can be resumed.
const FEWEST_BANDS: usize = 4;

/// Pixels of an image in which domains are looked for, for the memory's sake.
const DOMAIN_PIXELS: f64 = (1 << 24) as f64;
/// How many pixels there should be to a period: nodes are then some two pixels wide.
const PER_PERIOD: f64 = 24.0;
/// Pixels to a period at least: below, a node is a pixel.
const COARSEST: f64 = 8.0;

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
    /// Doubts about which waves of the lattice belong to the atoms.
    pub caveats: Vec<Caveat>,
    /// The harmonics of the middle.
    pub harmonics: Vec<UsedHarmonic>,
}

/// Why a large image cannot be mapped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurveyError {
    /// No image of this size has such a map.
    #[error(transparent)]
    Resolution(#[from] ResolutionError),
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

/// The columns and rows of the middle block.
fn middle_of(geometry: &Geometry) -> [Range<usize>; 2] {
    geometry.size.map(|n| {
        let side = n.min(MIDDLE);
        (n - side) / 2..(n - side) / 2 + side
    })
}

/// The wave vectors (rad/pixel) of the middle, under the names of the `first` image where there is one.
fn waves_of(
    found: &MeasuredLattice,
    first: Option<&SurveyPlan>,
    pixel_to_nm: &Matrix2<f64>,
) -> Option<Matrix2<f64>> {
    let Some(first) = first else {
        return named(&found.reciprocal, pixel_to_nm);
    };
    let back = pixel_to_nm.try_inverse()?.transpose().try_inverse()?;
    let exact = Waves::<Px>::exact(found.reciprocal);
    Some(labelled_like(&exact, &(back * first.whole)).basis)
}

/// Names the waves of the lattice by their strengths in the middle of the image.
fn name(
    whole: &Matrix2<f64>,
    found: &MeasuredLattice,
    placed: &Geometry,
    settings: &mut Settings,
) -> Vec<Caveat> {
    let Some(real) = Waves::exact(*whole).lattice() else {
        return Vec::new();
    };
    let mut strengths = WaveStrengths::new(&real.basis);
    if let Some(fit) = &found.fit {
        strengths.add(fit, &placed.pixel_to_nm);
    }
    settings.moire_waves = named_waves(&real, &strengths, settings).or(settings.moire_waves);
    name_caveats("map", &real, &strengths, settings)
}

fn block(
    read: &ReadBlock,
    columns: Range<usize>,
    rows: Range<usize>,
) -> Result<Image, SurveyError> {
    let (from, to) = (rows.start, rows.end);
    read([columns, rows]).map_err(|why| SurveyError::Lines { from, to, why })
}

/// The wave vectors (rad/pixel) of the lattice whose vectors have the names that an analysis would give them.
fn named(waves: &Matrix2<f64>, pixel_to_nm: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    let real = Lattice::<Nm>::exact(pixel_to_nm * reciprocal(waves)?);
    reciprocal(&(pixel_to_nm.try_inverse()? * canonical(&real).basis))
}

impl SurveyPlan {
    /// Looks at the middle of an image of this geometry, timing known or not. Other images of a survey take the
    /// window and the labelling of the first.
    ///
    /// # Errors
    /// [`SurveyError`]: no lines, or no lattice in the middle.
    pub fn new(
        geometry: &Geometry,
        timing: Option<&Timing>,
        settings: &Settings,
        resolution: &Resolution,
        first: Option<&Self>,
        read: &ReadBlock,
    ) -> Result<Self, SurveyError> {
        let place = Place::given(geometry, timing.copied(), settings);
        let still = place.still(settings.drift.map(|d| d.velocity()));
        let geometry = &place.geometry;
        let drift_corrected = still.is_some();
        let placed = still.unwrap_or_else(|| geometry.clone());
        let dual = placed.pixel_to_nm.try_inverse().ok_or(SurveyError::NoMap)?;
        let dual = dual.transpose();
        let [columns, rows] = middle_of(geometry);
        let corner = [columns.start, rows.start];
        resolution.fits(geometry.extent(), FULL_WIDTH)?;
        let middle = block(read, columns, rows)?;
        let of_middle = geometry.cropped(corner, [middle.columns, middle.rows]);
        let found = measure(&middle, &of_middle, settings.background, Method::Lattice)
            .map_err(SurveyError::Lattice)?;
        let pair = waves_of(&found, first, &placed.pixel_to_nm).ok_or(SurveyError::NoMap)?;
        let resolution = &Resolution {
            window_nm: first.map(|f| f.window_nm).or(resolution.window_nm),
            ..*resolution
        };
        let reference = Reference {
            pair,
            pitch: pitch(geometry),
        };
        let flat = remove_background(&middle, settings.background);
        let map = local_lattices(&flat, &reference, resolution).ok_or(SurveyError::NoMap)?;
        let whole = dual * reference.pair;
        let mut settings = settings.clone();
        let caveats = match first {
            Some(first) => {
                settings.moire_waves = first.settings.moire_waves;
                Vec::new()
            }
            None => name(&whole, &found, &placed, &mut settings),
        };
        Ok(Self {
            caveats,
            survey: Survey::new(
                geometry.size,
                reference,
                *resolution,
                map.window_nm,
                (BAND / geometry.size[0].max(1)).min(geometry.size[1].div_ceil(FEWEST_BANDS)),
            ),
            placed,
            drift_corrected,
            settings,
            window_nm: map.window_nm,
            whole,
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
        let of_bends = lattices.of_bends(&self.whole, layers, convention, &self.settings);
        let of_bends = of_bends.map_err(SurveyError::Strain)?;
        Ok(TwistStrainMap::new(&lattices, &found).with_bends(&of_bends))
    }

    /// Nodes and triangles of the whole image, its pixels averaged over blocks that leave some 24 to a period, and 16
    /// million in all. `None` where there is no mesh, or such blocks would be too coarse for one.
    ///
    /// # Errors
    /// [`SurveyError`], where its lines cannot be read.
    pub fn domains(
        &self,
        read: &ReadBlock,
        contrast: Contrast,
    ) -> Result<Option<DomainMap>, SurveyError> {
        let j = self.placed.pixel_to_nm;
        // Two primitive vectors of the lattice, nm; in pixels.
        let Some(real) = self.whole.transpose().try_inverse() else {
            return Ok(None);
        };
        // A pair at 60° where that of the wave vectors is.
        let (a, b) = (real.column(0) * TAU, real.column(1) * TAU);
        let real = Matrix2::from_columns(&[a, a + b]);
        let Some(pixels) = j.try_inverse().map(|back| back * real) else {
            return Ok(None);
        };
        let shortest = pixels.column(0).norm().min(pixels.column(1).norm());
        let [columns, rows] = self.placed.size;
        let by_size = (columns as f64 * rows as f64 / DOMAIN_PIXELS).sqrt().ceil();
        let bin = (shortest / PER_PERIOD).floor().max(by_size).max(1.0) as usize;
        if shortest < COARSEST * bin as f64 {
            return Ok(None);
        }
        let mut values = Vec::with_capacity((columns / bin) * (rows / bin));
        let together = (BAND / columns.max(1) / bin).max(1) * bin;
        for from in (0..rows / bin * bin).step_by(together) {
            let lines = block(
                read,
                0..columns,
                from..(from + together).min(rows / bin * bin),
            )?;
            values.extend(lines.binned(bin).values);
        }
        let image = Image::new(rows / bin, columns / bin, values);
        let share = bin as f64;
        let binned = Geometry {
            size: [image.columns, image.rows],
            pixel_to_nm: j * share,
            origin: self.placed.origin + j * Vector2::repeat(0.5 * (share - 1.0)),
            covariance: self.placed.covariance * (share * share),
            from_sensors: self.placed.from_sensors,
            departure: None,
        };
        let (pixels, pitch) = (pixels / share, pitch(&binned));
        Ok(domains_of(
            &image,
            &pixels,
            pitch,
            &binned,
            &self.settings,
            contrast,
        ))
    }

    /// A map of this window that has no nodes yet, on the grid of `first`.
    pub fn start(&self, first: &Grid) -> TwistStrainMap {
        TwistStrainMap::empty(*first, self.window_nm)
    }
}
