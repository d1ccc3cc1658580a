//! One scan: geometry, timing and lattice of each of its lines, trace and retrace.

use nalgebra::{Matrix2, Vector2};
use spmfile::{Channel, DateTime, FrameDirection, LineDirection, Scan};

use super::channel::choose_channel;
use super::doubts::{about_fit, few_periods, lines_disagree, turned};
use super::identity::Fingerprint;
use super::images::{first_of_several, images_of};
use super::moires::in_order;
use super::overlap::Window;
use super::positions::{nominal, speeds, usable_sensors};
use super::scanner::{about_calibration, calibrated};
use super::shared::correlation;
use crate::calibration::Calibration;
use crate::caveat::{Caveat, FileDoubt};
use crate::drift::Observation;
use crate::estimate::Estimate;
use crate::geometry::{Geometry, Timing};
use crate::image::Image;
use crate::lattice::reciprocal::labelled_like;
use crate::lattice::{
    LatticeError, LatticeVectors, MeasuredLattice, Start, measure, measure_several, vectors,
};
use crate::settings::{Lines, OutOfRange, Settings};
use crate::words::line_name;

/// Bytes of memory that the analysis of an image takes for each of its pixels at most: measured with 2048 × 2048
/// single-precision samples and eight pixels per period, where nothing can be binned.
pub const BYTES_PER_PIXEL: u64 = 105;

/// What the pixels of one scan gave.
#[derive(Clone, Debug)]
pub struct MeasuredScan {
    /// The file as the user named it.
    pub file: String,
    /// When it was saved, by the instrument's clock.
    pub acquired: Option<DateTime>,
    /// Sense of the slow motion.
    pub frame_direction: Option<FrameDirection>,
    /// Lines per second.
    pub line_rate_hz: Option<f64>,
    /// Name of the analysed channel.
    pub channel: String,
    /// Nominal size (fast, slow), nm.
    pub size_nm: Option<[f64; 2]>,
    /// Name of the set to which the user assigned it by hand.
    pub set: Option<String>,
    /// Hash of the bytes of its file, where whoever read it tells it; files of equal bytes are one.
    pub digest: Option<String>,
    /// One entry for each line direction that was used.
    pub lines: Vec<MeasuredLine>,
    /// Why it is shown but not used; `None` where it is used.
    pub excluded: Option<String>,
    /// The file that holds the same data and is used in its place.
    pub repeats: Option<String>,
    /// Doubts about this scan.
    pub caveats: Vec<Caveat>,
}

/// What the trace or the retrace of one scan gave.
#[derive(Clone, Debug)]
pub struct MeasuredLine {
    /// Trace or retrace.
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
    pub speeds: [Estimate; 2],
    /// Relative standard error of the mean speeds.
    pub speed_error: [f64; 2],
    /// To know the whole image again.
    pub(super) pixels: Fingerprint,
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
    /// There are not so many images of the channel.
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
    #[error("the file gives neither position sensors nor a scan size")]
    NoSize,
    /// Nothing is left of the frame.
    #[error("the scans have no region in common: this one lies outside the others")]
    NoOverlap,
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

impl MeasuredLine {
    /// The lattice in sensor coordinates, nm, with the error of the plane fit.
    pub fn in_sensor_coordinates(&self) -> LatticeVectors {
        let mut mapped = self.lattice.pixels.mapped(&self.geometry.pixel_to_nm);
        mapped.covariance += self.sensor_part().covariance;
        mapped
    }

    /// The same with the error of the plane fit alone.
    pub(super) fn sensor_part(&self) -> LatticeVectors {
        // r_i = J a_i, so δr_i = (a_ix I, a_iy I) δ(J₁₁, J₂₁, J₁₂, J₂₂).
        let b = &self.lattice.pixels.basis;
        let i = Matrix2::identity();
        let lever = vectors::block(&(i * b.m11), &(i * b.m21), &(i * b.m12), &(i * b.m22));
        LatticeVectors {
            basis: self.geometry.pixel_to_nm * b,
            covariance: lever * self.geometry.covariance * lever.transpose(),
        }
    }

    /// The lattice in nominal coordinates, nm.
    pub fn in_nominal_coordinates(&self) -> Option<LatticeVectors> {
        let nominal = self.nominal.as_ref()?;
        Some(self.lattice.pixels.mapped(&nominal.pixel_to_nm))
    }

    /// What the drift problem needs, labelled like `reference` (nm); no time gradient without timing.
    pub(super) fn observation(&self, reference: &Matrix2<f64>) -> Observation {
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

/// Measures one scan, restricted to the window if one is given.
///
/// # Errors
/// [`MeasureError`] says what the file lacks, or that its image shows no lattice. With both line
/// directions asked for, one of them is enough.
pub fn measure_scan(
    file: &str,
    scan: &Scan,
    settings: &Settings,
    window: Option<&Window>,
) -> Result<MeasuredScan, MeasureError> {
    Ok(measure_moires(file, scan, settings, window)?.swap_remove(0))
}

/// Measures a scan of a lattice whose cell is known: `cell` is its real-space pair, nm, at any orientation.
///
/// # Errors
/// As [`measure_scan`]; an image that shows another lattice shows none.
pub fn measure_known(
    file: &str,
    scan: &Scan,
    settings: &Settings,
    cell: &Matrix2<f64>,
) -> Result<MeasuredScan, MeasureError> {
    let find = |image: &Image, geometry: &Geometry| {
        let start = Start::find_known(image, geometry, settings.background, cell)?;
        Ok(vec![start.measure(settings.method)?])
    };
    Ok(measure_with(file, scan, settings, None, &find)?.swap_remove(0))
}

/// Measures every moiré of one scan, as many as `settings` say, the largest cell first; otherwise as
/// [`measure_scan`]. There is at least one.
///
/// # Errors
/// As [`measure_scan`]; also where there are fewer moirés, or two that cannot be told apart.
pub fn measure_moires(
    file: &str,
    scan: &Scan,
    settings: &Settings,
    window: Option<&Window>,
) -> Result<Vec<MeasuredScan>, MeasureError> {
    if let Some(problem) = settings.out_of_range() {
        return Err(problem.into());
    }
    let (background, method) = (settings.background, settings.method);
    let find = |image: &Image, geometry: &Geometry| match settings.moires {
        0 | 1 => measure(image, geometry, background, method).map(|lattice| vec![lattice]),
        n => measure_several(image, geometry, background, n),
    };
    measure_with(file, scan, settings, window, &find)
}

/// How the lattices of an image are found and measured; at least one.
type Find<'a> = &'a dyn Fn(&Image, &Geometry) -> Result<Vec<MeasuredLattice>, LatticeError>;

fn measure_with(
    file: &str,
    scan: &Scan,
    settings: &Settings,
    window: Option<&Window>,
    find: Find,
) -> Result<Vec<MeasuredScan>, MeasureError> {
    let problem = settings.scanner.as_ref().and_then(Calibration::problem);
    if let Some(problem) = problem {
        return Err(MeasureError::Calibration(problem));
    }
    let channels = channels(scan, settings)?;
    let several = first_of_several(scan, &channels[0].name, settings);
    let mut caveats: Vec<Caveat> = several
        .into_iter()
        .map(|choice| Caveat::new(FileDoubt::SeveralImages(choice), file))
        .collect();
    let mut moires: Vec<Vec<MeasuredLine>> = Vec::new();
    let mut failures = Vec::new();
    for channel in &channels {
        match measure_line(file, scan, channel, settings, (window, find), &mut caveats) {
            Ok(lines) if moires.is_empty() => {
                moires = lines.into_iter().map(|line| vec![line]).collect();
            }
            Ok(lines) => {
                let first: Vec<_> = moires
                    .iter()
                    .map(|lines| lines[0].in_sensor_coordinates())
                    .collect();
                let lines = in_order(&first, lines, |l| Some(l.in_sensor_coordinates()));
                for (all, line) in moires.iter_mut().zip(lines) {
                    all.push(line);
                }
            }
            Err(error) => failures.push(error),
        }
    }
    if moires.is_empty() {
        return Err(failures.swap_remove(0));
    }
    for error in failures {
        caveats.push(Caveat::new(
            FileDoubt::LineLeftOut {
                reason: error.to_string(),
            },
            file,
        ));
    }
    about_calibration(file, scan, moires.iter().flatten(), settings, &mut caveats);
    caveats.dedup_by(|a, b| a.says_the_same(b));
    let measured = moires.into_iter().map(|mut lines| {
        share_noise(&mut lines);
        let mut caveats = caveats.clone();
        let excluded = lines_disagree(file, &lines, &mut caveats);
        MeasuredScan {
            file: file.to_owned(),
            acquired: scan.acquired,
            frame_direction: scan.frame_direction,
            line_rate_hz: scan.line_rate_hz,
            channel: channels[0].name.clone(),
            size_nm: scan.size_nm,
            set: None,
            digest: None,
            lines,
            excluded,
            repeats: None,
            caveats,
        }
    });
    Ok(measured.collect())
}

/// Enlarges the errors of trace and retrace by what their noise has in common, so that they can be
/// taken as independent.
fn share_noise(lines: &mut [MeasuredLine]) {
    let [first, second] = lines else { return };
    let (Some(a), Some(b)) = (&first.lattice.fit, &second.lattice.fit) else {
        return;
    };
    let correlations = [correlation(a, b), correlation(b, a)];
    for (line, correlation) in [first, second].into_iter().zip(correlations) {
        let (mut weighted, mut weights) = (0.0, 0.0);
        let variances = line.lattice.phases.covariance.diagonal();
        for (variance, correlation) in variances.iter().zip(correlation) {
            weighted += correlation / variance;
            weights += variance.recip();
        }
        line.lattice.phases = line.lattice.phases.enlarged(correlation.map(|c| 1.0 + c));
        if weights > 0.0 {
            line.lattice.pixels.covariance *= 1.0 + weighted / weights;
        }
    }
}

/// The images to measure: the chosen channel in the chosen line directions, main scan line first.
pub(super) fn channels<'a>(
    scan: &'a Scan,
    settings: &Settings,
) -> Result<Vec<&'a Channel>, MeasureError> {
    let names: Vec<(&str, &str)> = scan
        .channels
        .iter()
        .map(|c| (c.name.as_str(), c.internal_name.as_str()))
        .collect();
    let Some(name) = choose_channel(&names, settings.channel.as_deref()) else {
        let mut present: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
        present.dedup();
        return Err(MeasureError::NoChannel {
            wanted: settings.channel.clone().unwrap_or_default(),
            present: present.join(", "),
        });
    };
    let number = settings.image.unwrap_or(1);
    let of = |direction| images_of(scan, name, direction);
    let all = [LineDirection::Trace, LineDirection::Retrace].map(of);
    let found = all.iter().map(Vec::len).max().unwrap_or(0);
    if settings.image.is_some() && !(1..=found).contains(&number) {
        return Err(MeasureError::NoSuchImage {
            channel: name.to_owned(),
            wanted: number,
            found,
        });
    }
    let [trace, retrace] = all.map(|images| images.get(number.wrapping_sub(1)).copied());
    let lacking = |wanted, present| MeasureError::NoLine {
        channel: name.to_owned(),
        wanted,
        present,
    };
    let chosen = match settings.line {
        Lines::Trace => vec![trace.ok_or(lacking("trace", "retrace"))?],
        Lines::Retrace => vec![retrace.ok_or(lacking("retrace", "trace"))?],
        Lines::Both => trace.into_iter().chain(retrace).collect(),
    };
    Ok(chosen)
}

fn measure_line(
    file: &str,
    scan: &Scan,
    channel: &Channel,
    settings: &Settings,
    (window, find): (Option<&Window>, Find),
    caveats: &mut Vec<Caveat>,
) -> Result<Vec<MeasuredLine>, MeasureError> {
    let line = channel.line_direction.unwrap_or(LineDirection::Trace);
    let nominal = nominal(scan, channel);
    let sensors = usable_sensors(file, scan, channel, nominal.as_ref(), caveats);
    let timing = scan
        .frame_direction
        .and_then(|frame| Timing::of_scan(scan, channel.columns, frame, line));
    let geometry = match (&sensors, &nominal) {
        (Some(sensors), _) => sensors.geometry.clone(),
        (None, Some(nominal)) => {
            turned(file, scan.rotation_rad, caveats);
            nominal.clone()
        }
        (None, None) => return Err(MeasureError::NoSize),
    };
    let (speeds, speed_error) = speeds(&geometry, sensors.as_ref(), timing.as_ref());
    let mut image = image_of(channel);
    let pixels = Fingerprint::of(&image);
    let (mut geometry, mut nominal) = (geometry, nominal);
    let mut lines_after = 0;
    if let Some(window) = window {
        let (first, size) = window.pixels(&geometry).ok_or(MeasureError::NoOverlap)?;
        lines_after = match scan.frame_direction {
            Some(FrameDirection::Down) => first[1],
            _ => image.rows - first[1] - size[1],
        };
        image = image.cropped(first, size);
        geometry = geometry.cropped(first, size);
        nominal = nominal.map(|n| n.cropped(first, size));
    }
    let geometry = calibrated(&geometry, settings);
    let speeds = match (&timing, &settings.scanner) {
        (Some(timing), Some(_)) => {
            let now = geometry.speeds(timing);
            [0, 1].map(|i| speeds[i].scaled(now[i] / speeds[i].value))
        }
        _ => speeds,
    };
    let mut lattices = find(&image, &geometry).map_err(|error| MeasureError::Lattice {
        line: line_name(line),
        channel: channel.name.clone(),
        error,
    })?;
    let cell = |lattice: &MeasuredLattice| lattice.pixels.basis.determinant().abs();
    lattices.sort_by(|a, b| cell(b).total_cmp(&cell(a)));
    let lines = lattices.into_iter().map(|lattice| {
        about_lattice(file, &lattice, &geometry, caveats);
        MeasuredLine {
            line,
            geometry: geometry.clone(),
            nominal: nominal.clone(),
            timing,
            frame_columns: channel.columns,
            lines_after,
            lattice,
            speeds,
            speed_error,
            pixels: pixels.clone(),
        }
    });
    Ok(lines.collect())
}

fn about_lattice(
    file: &str,
    lattice: &MeasuredLattice,
    geometry: &Geometry,
    caveats: &mut Vec<Caveat>,
) {
    few_periods(file, lattice, caveats);
    if let Some(fit) = &lattice.fit {
        about_fit(file, fit, geometry, caveats);
    }
}

/// The values of a channel as an image.
pub(super) fn image_of(channel: &Channel) -> Image {
    Image::new(channel.rows, channel.columns, channel.values())
}
