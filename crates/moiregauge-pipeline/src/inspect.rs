//! What files hold: channels, units, sizes, directions, scaling, and what is missing for the analysis.
//!
//! Rows are counted as on the screen here: row 0 is the top line, where y is largest.

use std::fmt;
use std::path::Path;

use moiregauge::numbers::{line_name, widest};
use moiregauge::scan::image_choice;
use moiregauge::settings::Settings;
use serde::{Deserialize, Serialize};
use spmfile::{
    Channel, DateTime, FrameDirection, LineDirection, ReadError, Scan, position_sensors,
    sensor_axis,
};

use crate::campaign::{Advice, in_words};
use crate::known::Known;
use crate::names;
use crate::opened::InputError;

/// A pixel in display order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pixel {
    /// From the top.
    pub row: usize,
    /// From the left.
    pub column: usize,
}

/// What is told of one file.
#[derive(Clone, Debug, Serialize)]
pub struct FileInfo {
    /// Its name.
    pub file: String,
    /// What is wrong with it; of a damaged file the rest is told.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// What it holds.
    #[serde(flatten)]
    pub scan: Option<ScanInfo>,
}

/// What is told of a scan.
#[derive(Clone, Debug, Serialize)]
pub struct ScanInfo {
    /// Format of the file, with its version.
    pub format: String,
    /// Make of the instrument.
    pub instrument: Option<String>,
    /// Date and time of the instrument, as in `2024-05-31T12:00:00`.
    pub acquired: Option<String>,
    /// `up` or `down`.
    pub frame_direction: Option<&'static str>,
    /// Lines per second, trace and retrace together.
    pub line_rate_hz: Option<f64>,
    /// Share of a line in which the scanner turns round.
    pub rounding: Option<f64>,
    /// Of the fast axis against x, counter-clockwise.
    pub rotation_deg: f64,
    /// Of the middle of the frame.
    pub offset_nm: [f64; 2],
    /// Along the fast and the slow axis.
    pub size_nm: Option<[f64; 2]>,
    /// Whether the position was controlled.
    pub closed_loop: Option<bool>,
    /// Channels that could be read.
    pub channels: Vec<ChannelInfo>,
    /// Channels that could not.
    pub unreadable: Vec<Unreadable>,
    /// Doubts about how the file was understood.
    pub notes: Vec<String>,
    /// In words.
    pub missing_for_analysis: Vec<String>,
    /// Number of the last notes that say that the image to be analysed was chosen among several: a front end tells how to
    /// choose another one.
    #[serde(skip)]
    pub notes_on_choice: usize,
    /// What else the header says, as names and values, in the order of the file.
    #[serde(skip)]
    pub header: Vec<(String, String)>,
}

/// What is told of a channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelInfo {
    /// Its name.
    pub name: String,
    /// The name that the instrument gives it.
    pub internal_name: String,
    /// Unit of its values.
    pub unit: String,
    /// `trace` or `retrace`.
    pub line_direction: Option<&'static str>,
    /// Main or interleaved.
    pub scan_line: Option<String>,
    /// Lines.
    pub rows: usize,
    /// Samples in a line.
    pub columns: usize,
    /// Along the fast axis.
    pub width_nm: Option<f64>,
    /// Along the slow axis.
    pub height_nm: Option<f64>,
    /// The least value; NaN, which becomes null in JSON, without any.
    pub min: f64,
    /// The largest value.
    pub max: f64,
    /// The mean.
    pub mean: f64,
    /// Population standard deviation (divided by N).
    pub std: f64,
    /// Number of samples that are missing.
    pub missing: usize,
    /// How counts became values.
    pub scaling: String,
    /// The plane that the instrument took off.
    pub plane_fit: Option<String>,
    /// Values at the pixels that were asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub samples: Vec<Sample>,
}

/// The value at a pixel.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Sample {
    /// From the top.
    pub row: usize,
    /// From the left.
    pub column: usize,
    /// In the unit of the channel; `None` where it is missing or outside.
    pub value: Option<f64>,
}

/// A channel that cannot be read.
#[derive(Clone, Debug, Serialize)]
pub struct Unreadable {
    /// Its name.
    pub name: String,
    /// Why not.
    pub error: String,
}

/// A pixel that lies outside of all channels. Of several channels some may be smaller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutsideOfChannels {
    /// The pixel.
    pub pixel: Pixel,
    /// The largest channel.
    pub largest: String,
    /// Its lines.
    pub rows: usize,
    /// Its samples in a line.
    pub columns: usize,
}

impl fmt::Display for OutsideOfChannels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Pixel { row, column } = self.pixel;
        write!(
            f,
            "{row},{column} lies outside all channels. The largest, {:?}, has {} rows and {} columns",
            self.largest, self.rows, self.columns
        )
    }
}

/// Tells what a file holds, of the pixels `at` with their values. It never fails: what is wrong is part of the answer,
/// with what `advice` has to say about it.
///
/// ```
/// use moiregauge_pipeline::campaign::no_advice;
/// use moiregauge_pipeline::{Known, inspect};
///
/// let info = inspect("missing.spm".as_ref(), &Known::default(), &[], no_advice);
/// assert!(info.error.is_some() && info.scan.is_none());
/// ```
pub fn inspect(path: &Path, known: &Known, at: &[Pixel], advice: Advice) -> FileInfo {
    let (mut scan, mut error) = match known.source(path).content() {
        Err(error) => (None, Some(error.to_string())),
        Ok(content) => match known.decode(path, &content, &|_| true) {
            Ok(scan) => (Some(scan), None),
            Err(ReadError::Incomplete { reason, readable }) => {
                let reason = format!("the file is damaged: {reason}");
                (Some(*readable), Some(reason))
            }
            Err(error) => (None, Some(error.to_string())),
        },
    };
    if let Some(scan) = &mut scan
        && let Err(problem) = known.complete(path, scan)
    {
        error = error.or_else(|| Some(in_words(&InputError::Known(problem), advice)));
    }
    FileInfo {
        file: names::in_words(path),
        error,
        scan: scan.as_ref().map(|scan| scan_info(scan, at)),
    }
}

impl ScanInfo {
    /// The first of the pixels that lies outside of all channels.
    pub fn outside(&self, at: &[Pixel]) -> Option<OutsideOfChannels> {
        let largest = self.channels.iter().max_by_key(|c| c.rows * c.columns)?;
        let inside = |p: &&Pixel| {
            let mut channels = self.channels.iter();
            channels.any(|c| p.row < c.rows && p.column < c.columns)
        };
        let pixel = *at.iter().find(|p| !inside(p))?;
        Some(OutsideOfChannels {
            pixel,
            largest: largest.name.clone(),
            rows: largest.rows,
            columns: largest.columns,
        })
    }
}

fn scan_info(scan: &Scan, at: &[Pixel]) -> ScanInfo {
    let choice = image_choice(scan, &Settings::default());
    ScanInfo {
        format: scan.format.clone(),
        instrument: scan.instrument.clone(),
        acquired: scan.acquired.map(iso_date),
        frame_direction: scan.frame_direction.map(|direction| match direction {
            FrameDirection::Up => "up",
            FrameDirection::Down => "down",
        }),
        line_rate_hz: scan.line_rate_hz,
        rounding: scan.rounding,
        rotation_deg: scan.rotation_rad.to_degrees(),
        offset_nm: scan.offset_nm,
        size_nm: scan.size_nm,
        closed_loop: scan.closed_loop,
        channels: scan.channels.iter().map(|c| channel_info(c, at)).collect(),
        unreadable: scan
            .unreadable
            .iter()
            .map(|u| Unreadable {
                name: u.name.clone(),
                error: u.error.clone(),
            })
            .collect(),
        notes_on_choice: choice.len(),
        header: scan.metadata.clone(),
        notes: scan.notes.iter().cloned().chain(choice).collect(),
        missing_for_analysis: missing_for_analysis(scan),
    }
}

/// Samples of the lines that are processed together: they stay in the fastest memory.
const AT_ONCE: usize = 1 << 14;
/// Samples that are summed side by side, so that every vector width gives the same bits.
const LANES: usize = 8;

/// What the finite ones of some samples amount to.
#[derive(Clone, Copy)]
struct Statistics {
    count: usize,
    sums: [f64; LANES],
    min: f64,
    max: f64,
}

impl Statistics {
    /// Of all samples of a channel, each as `of` says.
    fn of(channel: &Channel, of: impl Fn(f64) -> f64) -> Self {
        let mut all = Self {
            count: 0,
            sums: [0.0; LANES],
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
        };
        let lines = (AT_ONCE / channel.columns.max(1)).max(1);
        for first in (0..channel.rows).step_by(lines) {
            all.add(
                &channel.lines(first..(first + lines).min(channel.rows)),
                &of,
            );
        }
        all
    }

    fn add(&mut self, values: &[f64], of: impl Fn(f64) -> f64) {
        let (mut low, mut high) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
        let mut counts = [0u64; LANES];
        let sums = &mut self.sums;
        let (eights, rest) = values.as_chunks::<LANES>();
        // What is missing changes nothing.
        let mut last = [f64::NAN; LANES];
        last[..rest.len()].copy_from_slice(rest);
        widest(
            #[inline(always)]
            || {
                for eight in eights.iter().chain([&last]) {
                    for (lane, value) in eight.iter().enumerate() {
                        let there = value.is_finite();
                        counts[lane] += u64::from(there);
                        sums[lane] += if there { of(*value) } else { 0.0 };
                        let lower = there && *value < low[lane];
                        low[lane] = if lower { *value } else { low[lane] };
                        let higher = there && *value > high[lane];
                        high[lane] = if higher { *value } else { high[lane] };
                    }
                }
            },
        );
        self.count += counts.iter().sum::<u64>() as usize;
        self.min = low.into_iter().fold(self.min, f64::min);
        self.max = high.into_iter().fold(self.max, f64::max);
    }

    /// NaN of none.
    fn mean(&self) -> f64 {
        self.sums.iter().sum::<f64>() / self.count as f64
    }
}

fn channel_info(channel: &Channel, at: &[Pixel]) -> ChannelInfo {
    let found = Statistics::of(channel, |v| v);
    let mean = found.mean();
    let variance = Statistics::of(channel, |v| (v - mean).powi(2)).mean();
    let none = found.count == 0;
    let sample = |pixel: &Pixel| {
        let inside = pixel.row < channel.rows && pixel.column < channel.columns;
        let value = inside.then(|| {
            let row = channel.rows - 1 - pixel.row;
            channel.lines(row..row + 1)[pixel.column]
        });
        Sample {
            row: pixel.row,
            column: pixel.column,
            value: value.filter(|v| v.is_finite()),
        }
    };
    ChannelInfo {
        name: channel.name.clone(),
        internal_name: channel.internal_name.clone(),
        unit: channel.unit.clone(),
        line_direction: channel.line_direction.map(line_name),
        scan_line: channel.scan_line.clone(),
        rows: channel.rows,
        columns: channel.columns,
        width_nm: channel.width_nm,
        height_nm: channel.height_nm,
        min: if none { f64::NAN } else { found.min },
        max: if none { f64::NAN } else { found.max },
        mean,
        std: variance.sqrt(),
        missing: channel.samples.len() - found.count,
        scaling: channel.scaling.clone(),
        plane_fit: channel.plane_fit.clone(),
        samples: at.iter().map(sample).collect(),
    }
}

/// What the moiré analysis would like to know and the file does not tell.
fn missing_for_analysis(scan: &Scan) -> Vec<String> {
    let mut missing = Vec::new();
    let mut lack = |absent: bool, words: &str| {
        if absent {
            missing.push(words.to_owned());
        }
    };
    let is_image = |c: &&Channel| sensor_axis(&c.name, &c.internal_name).is_none();
    let has = |line| {
        let mut images = scan.channels.iter().filter(is_image);
        images.any(|c| c.line_direction == Some(line))
    };
    lack(scan.size_nm.is_none(), "no scan size");
    lack(
        scan.line_rate_hz.is_none(),
        "no line rate: without the time of each line the drift cannot be measured",
    );
    lack(
        scan.frame_direction.is_none(),
        "no frame direction, or images with different ones: the sign of the drift is unknown",
    );
    lack(
        scan.acquired.is_none(),
        "no date: the order of frames is unknown",
    );
    lack(
        !scan.channels.iter().any(|c| is_image(&c)),
        "no channel except the position sensors",
    );
    lack(!has(LineDirection::Trace), "no trace");
    lack(!has(LineDirection::Retrace), "no retrace");
    for line in [LineDirection::Trace, LineDirection::Retrace] {
        if !has(line) {
            continue;
        }
        let name = line_name(line);
        match position_sensors(scan, line) {
            Err(problem) => missing.push(format!(
                "{name}: {problem}; the nominal scan size would be used"
            )),
            Ok(sensors) => {
                for sensor in [sensors.x, sensors.y] {
                    if let Some(fit) = &sensor.plane_fit {
                        missing.push(format!(
                            "{name}: channel {:?} was plane-fitted by the instrument ({fit}) and no longer holds positions",
                            sensor.name
                        ));
                    }
                }
            }
        }
    }
    missing
}

fn iso_date(t: DateTime) -> String {
    format!(
        "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}",
        t.year, t.month, t.day, t.hour, t.minute, t.second
    )
}
