//! One scan once it is measured: a few numbers, and no pixels.

use std::ops::Deref;
use std::sync::Arc;

use heterostrain::Estimate;
use heterostrain::lattice::{Lattice, Px, block, labelled_like};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use spmfile::{DateTime, FrameDirection, LineDirection};

use crate::caveat::Caveat;
use crate::drift::linear::Observation;
use crate::frame::geometry::{Geometry, Timing};
use crate::frame::grid_errors::GridErrors;
use crate::lattice::measured::MeasuredLattice;
use crate::numbers::exact;
use crate::scan::fingerprint::Fingerprint;
use crate::scan::written;
use crate::settings::knobs::Settings;
use crate::settings::ranges::OutOfRange;
use crate::spectrum::error::LatticeError;

/// What the pixels of one scan gave.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MeasuredScan {
    /// The file as the user named it.
    pub file: String,
    /// When it was saved, by the instrument's clock.
    #[serde(with = "written::date")]
    pub acquired: Option<DateTime>,
    /// Sense of the slow motion.
    #[serde(with = "written::frame_direction")]
    pub frame_direction: Option<FrameDirection>,
    /// Lines per second.
    #[serde(with = "exact")]
    pub line_rate_hz: Option<f64>,
    /// Name of the analysed channel.
    pub channel: String,
    /// Nominal size (fast, slow), nm.
    #[serde(with = "exact")]
    pub size_nm: Option<[f64; 2]>,
    /// Name of the set to which the user assigned it by hand.
    pub set: Option<String>,
    /// Hash of the bytes of its file, where whoever read it tells it; files of equal bytes are one.
    pub digest: Option<String>,
    /// One entry for each line direction that was used.
    pub lines: MeasuredLines,
    /// Why it is shown but not used; `None` where it is used.
    pub excluded: Option<String>,
    /// The file that holds the same data and is used in its place.
    pub repeats: Option<String>,
    /// Doubts about this scan, of its trace and of its retrace.
    pub caveats: Vec<Caveat>,
    /// The same scan in the other grains that it shows: the analysis makes a set of each grain.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub grains: Vec<MeasuredScan>,
}

/// What the trace or the retrace of one scan gave.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MeasuredLine {
    /// Trace or retrace.
    #[serde(with = "written::line")]
    pub line: LineDirection,
    /// Where the pixels were.
    pub geometry: Geometry,
    /// Where they should have been.
    pub nominal: Option<Geometry>,
    /// When they were recorded; `None` where the file does not tell.
    pub timing: Option<Timing>,
    /// Samples in a line of the whole frame.
    pub frame_columns: usize,
    /// Lines that were recorded after the part of the frame that was used.
    pub lines_after: usize,
    /// The lattice in pixels.
    pub lattice: MeasuredLattice,
    /// Tip speeds along the fast and slow axes, nm/s; σ is the spread over the lines. NaN without timing.
    #[serde(with = "exact")]
    pub speeds: [Estimate; 2],
    /// Relative standard errors of the pitch along the fast and the slow axis where nobody knows what the size of the
    /// frame spans; `None` where sensors or the format tell.
    #[serde(with = "exact")]
    pub pitch_sigma: Option<[f64; 2]>,
    /// Relative standard error of the mean speeds.
    #[serde(with = "exact")]
    pub speed_error: [f64; 2],
    /// As [`LineAnalysis`](crate::campaign::LineAnalysis) has it.
    #[serde(skip)]
    pub(crate) displacement: Vec<[f64; 2]>,
    /// To know the whole image again.
    pub(crate) pixels: Fingerprint,
}

/// What the lines of one scan gave, one entry for each line direction. They are nearly all that a measured scan is, and nothing
/// changes them once the scan is put together: copies share them.
#[derive(Clone, Debug)]
pub struct MeasuredLines(Arc<[MeasuredLine]>);

impl From<Vec<MeasuredLine>> for MeasuredLines {
    fn from(lines: Vec<MeasuredLine>) -> Self {
        Self(lines.into())
    }
}

impl Deref for MeasuredLines {
    type Target = [MeasuredLine];

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl<'a> IntoIterator for &'a MeasuredLines {
    type Item = &'a MeasuredLine;
    type IntoIter = std::slice::Iter<'a, MeasuredLine>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl Serialize for MeasuredLines {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(to)
    }
}

impl<'de> Deserialize<'de> for MeasuredLines {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Vec::deserialize(from).map(Self::from)
    }
}

impl MeasuredLine {
    /// The lattice in sensor coordinates, nm, with the error of the plane fit.
    pub fn in_sensor_coordinates(&self) -> Lattice {
        let mut mapped = self.lattice.pixels.in_nm(&self.geometry.pixel_to_nm);
        mapped.covariance += self.sensor_part().covariance;
        mapped
    }

    /// The same with the error of the plane fit alone.
    pub(crate) fn sensor_part(&self) -> Lattice {
        // r_i = J a_i, so δr_i = (a_ix I, a_iy I) δ(J₁₁, J₂₁, J₁₂, J₂₂).
        let b = &self.lattice.pixels.basis;
        let i = Matrix2::identity();
        let lever = block(&(i * b.m11), &(i * b.m21), &(i * b.m12), &(i * b.m22));
        Lattice::new(
            self.geometry.pixel_to_nm * b,
            lever * self.geometry.covariance * lever.transpose(),
        )
    }

    /// What it has in common with the other images of its sample (nm), labelled like `reference`: by how much its vectors would differ with the finest
    /// description of their change, and their covariance from where the area ends.
    pub(crate) fn common(&self, reference: &Matrix2<f64>) -> Option<(Vector4<f64>, Matrix4<f64>)> {
        let common = self.lattice.common.as_ref()?;
        let named = |basis: Matrix2<f64>, covariance: Matrix4<f64>| {
            let lattice = Lattice::<Px>::new(basis, covariance);
            labelled_like(&lattice.in_nm(&self.geometry.pixel_to_nm), reference)
        };
        let own = named(self.lattice.pixels.basis, common.edges);
        let off = named(common.other, Matrix4::zeros()).basis - own.basis;
        Some((Vector4::from_column_slice(off.as_slice()), own.covariance))
    }

    /// What the pitch, and bends that no sensor told, may do to the lattice.
    pub(crate) fn grid_errors(&self, settings: &Settings) -> GridErrors {
        let j = self.geometry.pixel_to_nm;
        let inverse = j.try_inverse().unwrap_or_else(Matrix2::zeros);
        let pitch = |sigma| j * Matrix2::from_diagonal(&Vector2::from(sigma)) * inverse;
        let place = self.geometry.place(self.lattice.middle);
        let bends = self.geometry.bends();
        GridErrors {
            pitch: self.pitch_sigma.map_or_else(Matrix2::zeros, pitch),
            shape: bends.stretch(place).component_mul(&settings.bends(&bends)),
        }
    }

    /// The lattice in nominal coordinates, nm.
    pub fn in_nominal_coordinates(&self) -> Option<Lattice> {
        let nominal = self.nominal.as_ref()?;
        Some(self.lattice.pixels.in_nm(&nominal.pixel_to_nm))
    }

    /// What the drift problem needs, labelled like `reference` (nm); no time gradient without timing.
    pub(crate) fn observation(&self, reference: &Matrix2<f64>) -> Observation {
        let gradient = self
            .timing
            .and_then(|timing| self.geometry.time_gradient(&timing));
        Observation {
            lattice: labelled_like(&self.in_sensor_coordinates(), reference),
            time_gradient: gradient.unwrap_or_else(Vector2::zeros),
            speed_error: self.speed_error,
            sensor: labelled_like(&self.sensor_part(), reference).covariance,
        }
    }
}

/// Why a scan cannot be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// The channel is not there.
    #[error("no channel {wanted:?}; the file has {present}")]
    NoChannel {
        /// What was asked for.
        wanted: String,
        /// The channels that are there.
        present: String,
    },
    /// The channel has fewer images.
    #[error("expected image {wanted} of {channel:?}, found {found} in the file")]
    NoSuchImage {
        /// The channel.
        channel: String,
        /// What was asked for, counted from 1.
        wanted: usize,
        /// How many there are.
        found: usize,
    },
    /// The line direction is not there.
    #[error("channel {channel:?} has no {wanted} lines, only {present}")]
    NoLine {
        /// The channel.
        channel: String,
        /// What was asked for.
        wanted: &'static str,
        /// What is there.
        present: &'static str,
    },
    /// A setting that makes no sense.
    #[error(transparent)]
    Settings(#[from] OutOfRange),
    /// A calibration that no scanner can have.
    #[error("the calibration of the scanner cannot be used: {0}")]
    Calibration(String),
    /// No size.
    #[error("the file has neither position sensors nor a scan size")]
    NoSize,
    /// Nothing is left of the frame.
    #[error("the scans have no region in common: this one lies outside the others")]
    NoOverlap,
    /// A mask for images of another size.
    #[error(
        "the mask has {} × {} pixels (columns × rows), the image {} × {}",
        mask[0], mask[1], image[0], image[1]
    )]
    OtherMask {
        /// Columns and rows of the mask.
        mask: [usize; 2],
        /// Those of the image.
        image: [usize; 2],
    },
    /// The image shows no lattice.
    #[error("{line} of {channel:?}: {error}")]
    Lattice {
        /// Trace or retrace.
        line: &'static str,
        /// The channel.
        channel: String,
        /// Why.
        error: LatticeError,
    },
}
