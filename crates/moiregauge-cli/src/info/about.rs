//! A scan → what is told of it.
//!
//! Rows are counted as on the screen here: row 0 is the top line, where y is largest.

use moiregauge::numbers::line_name;
use moiregauge::scan::image_choice;
use moiregauge::settings::Settings;
use serde::Serialize;
use spmfile::{
    Channel, DateTime, FrameDirection, LineDirection, Scan, position_sensors, sensor_axis,
};

/// A pixel in display order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pixel {
    pub(super) row: usize,
    pub(super) column: usize,
}

/// What is told of one file.
#[derive(Serialize)]
pub(super) struct FileInfo {
    pub(super) file: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) error: Option<String>,
    #[serde(flatten)]
    pub(super) scan: Option<ScanInfo>,
}

#[derive(Serialize)]
pub(super) struct ScanInfo {
    pub(super) format: String,
    pub(super) instrument: Option<String>,
    pub(super) acquired: Option<String>,
    pub(super) frame_direction: Option<&'static str>,
    pub(super) line_rate_hz: Option<f64>,
    pub(super) rounding: Option<f64>,
    pub(super) rotation_deg: f64,
    pub(super) offset_nm: [f64; 2],
    pub(super) size_nm: Option<[f64; 2]>,
    pub(super) closed_loop: Option<bool>,
    pub(super) channels: Vec<ChannelInfo>,
    pub(super) unreadable: Vec<Unreadable>,
    /// Doubts about how the file was understood.
    pub(super) notes: Vec<String>,
    pub(super) missing_for_analysis: Vec<String>,
}

#[derive(Serialize)]
pub(super) struct ChannelInfo {
    pub(super) name: String,
    pub(super) internal_name: String,
    pub(super) unit: String,
    pub(super) line_direction: Option<&'static str>,
    pub(super) scan_line: Option<String>,
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) width_nm: Option<f64>,
    pub(super) height_nm: Option<f64>,
    /// NaN becomes null in JSON.
    pub(super) min: f64,
    pub(super) max: f64,
    pub(super) mean: f64,
    /// Population standard deviation (divided by N).
    pub(super) std: f64,
    /// Number of samples that are missing.
    pub(super) missing: usize,
    pub(super) scaling: String,
    pub(super) plane_fit: Option<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) samples: Vec<Sample>,
}

#[derive(Serialize)]
pub(super) struct Sample {
    pub(super) row: usize,
    pub(super) column: usize,
    pub(super) value: Option<f64>,
}

#[derive(Serialize)]
pub(super) struct Unreadable {
    pub(super) name: String,
    pub(super) error: String,
}

/// Words for a pixel that lies outside of all channels. Of several channels some may be smaller.
pub(super) fn outside(scan: &Scan, at: &[Pixel]) -> Option<String> {
    let largest = scan.channels.iter().max_by_key(|c| c.samples.len())?;
    let inside = |p: &Pixel| {
        let mut channels = scan.channels.iter();
        channels.any(|c| p.row < c.rows && p.column < c.columns)
    };
    let pixel = at.iter().find(|p| !inside(p))?;
    Some(format!(
        "--at {},{} lies outside of all channels; the largest, {:?}, has {} rows and {} columns",
        pixel.row, pixel.column, largest.name, largest.rows, largest.columns
    ))
}

/// Notes of the reader, and which image would be analysed.
fn notes(scan: &Scan) -> Vec<String> {
    let choice = image_choice(scan, &Settings::default());
    let hint =
        |words| format!("{words} (--channel NAME and --image N of analyze say which one is)");
    scan.notes
        .iter()
        .cloned()
        .chain(choice.into_iter().map(hint))
        .collect()
}

pub(super) fn scan_info(scan: &Scan, at: &[Pixel]) -> ScanInfo {
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
        notes: notes(scan),
        missing_for_analysis: missing_for_analysis(scan),
    }
}

fn channel_info(channel: &Channel, at: &[Pixel]) -> ChannelInfo {
    let values = channel.values();
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let n = finite().count();
    let mean = finite().sum::<f64>() / n as f64;
    let variance = finite().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
    let sample = |pixel: &Pixel| {
        let inside = pixel.row < channel.rows && pixel.column < channel.columns;
        let value = inside.then(|| {
            let row = channel.rows - 1 - pixel.row;
            values[row * channel.columns + pixel.column]
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
        // Folding from NaN: `min` and `max` prefer the other operand.
        min: finite().fold(f64::NAN, f64::min),
        max: finite().fold(f64::NAN, f64::max),
        mean,
        std: variance.sqrt(),
        missing: values.len() - n,
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
        "no line rate: no drift without the time of each line",
    );
    lack(
        scan.frame_direction.is_none(),
        "no frame direction, or images that contradict each other: the sign of the drift is unknown",
    );
    lack(
        scan.acquired.is_none(),
        "no date: the order of frames is unknown",
    );
    lack(
        !scan.channels.iter().any(|c| is_image(&c)),
        "no channel but the position sensors",
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
