//! `moiregauge info`: what scan files hold, how it is scaled, what the analysis would miss.
//!
//! Rows are counted as on the screen here: row 0 is the top line, where y is largest.

mod paths;
mod table;

use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use moiregauge::series::image_choice;
use moiregauge::settings::Settings;
use moiregauge_pipeline::Content;
use serde::Serialize;
use spmfile::{
    Channel, DateTime, FrameDirection, LineDirection, ReadError, Scan, position_sensors,
    sensor_axis,
};

pub(crate) use paths::{expand, inputs};
use table::table;

use crate::input::{Known, KnownArgs, with_option};

/// Show what scan files hold: channels, units, sizes, directions, scaling
///
/// Reads each file and prints its channels with their statistics, how counts become values, and
/// what is missing for the moiré analysis. Of a damaged file the rest is shown; the exit code tells
/// of the failure.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge info scan.spm
  moiregauge info folder/                    all scans of a folder
  moiregauge info 'scan.0_*.spm' --json      one JSON object per file, in a list
  moiregauge info scan.spm --at 0,0 --at 255,128")]
pub(crate) struct InfoArgs {
    /// Scan files, folders (the scans in them, without subfolders) or names with * and ?
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Print a JSON list with one object per file, also for a single file
    #[arg(long)]
    json: bool,
    /// Print the value at a pixel too; row 0 is the top line; may be repeated
    #[arg(long, value_name = "ROW,COL", value_parser = parse_pixel)]
    at: Vec<Pixel>,
    #[command(flatten)]
    known: KnownArgs,
}

/// A pixel in display order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pixel {
    row: usize,
    column: usize,
}

/// What is told of one file.
#[derive(Serialize)]
struct FileInfo {
    file: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    #[serde(flatten)]
    scan: Option<ScanInfo>,
}

#[derive(Serialize)]
struct ScanInfo {
    format: String,
    instrument: Option<String>,
    acquired: Option<String>,
    frame_direction: Option<&'static str>,
    line_rate_hz: Option<f64>,
    rounding: Option<f64>,
    rotation_deg: f64,
    offset_nm: [f64; 2],
    size_nm: Option<[f64; 2]>,
    closed_loop: Option<bool>,
    channels: Vec<ChannelInfo>,
    unreadable: Vec<Unreadable>,
    /// Doubts about how the file was understood.
    notes: Vec<String>,
    missing_for_analysis: Vec<String>,
}

#[derive(Serialize)]
struct ChannelInfo {
    name: String,
    internal_name: String,
    unit: String,
    line_direction: Option<&'static str>,
    scan_line: Option<String>,
    rows: usize,
    columns: usize,
    width_nm: Option<f64>,
    height_nm: Option<f64>,
    /// NaN becomes null in JSON.
    min: f64,
    max: f64,
    mean: f64,
    /// Population standard deviation (divided by N).
    std: f64,
    /// Number of samples that are missing.
    missing: usize,
    scaling: String,
    plane_fit: Option<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    samples: Vec<Sample>,
}

#[derive(Serialize)]
struct Sample {
    row: usize,
    column: usize,
    value: Option<f64>,
}

#[derive(Serialize)]
struct Unreadable {
    name: String,
    error: String,
}

/// Prints the files; the exit code tells whether all of them could be read.
///
/// # Errors
/// If the output cannot be written.
pub(crate) fn run(args: &InfoArgs) -> anyhow::Result<ExitCode> {
    let mut infos = Vec::new();
    let files = expand(&args.files, !args.json);
    let paths: Vec<PathBuf> = files.iter().flatten().cloned().collect();
    let known = args.known.of(&paths);
    for file in files {
        let info = match file {
            Ok(path) => file_info(&path, &args.at, &known),
            Err(failed) => FileInfo {
                file: failed.file,
                error: Some(failed.error),
                scan: None,
            },
        };
        infos.push(info);
    }
    let text = if args.json {
        serde_json::to_string_pretty(&infos)? + "\n"
    } else {
        infos.iter().map(table).collect::<Vec<_>>().join("\n")
    };
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        // The reader of a pipe may stop early, as `head` does.
        Err(error) if error.kind() != ErrorKind::BrokenPipe => return Err(error.into()),
        _ => {}
    }
    let mut failed = false;
    for info in &infos {
        if let Some(error) = &info.error {
            failed = true;
            eprintln!("error: {}: {error}", info.file);
        }
    }
    Ok(if failed {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}

fn file_info(path: &Path, at: &[Pixel], known: &Known) -> FileInfo {
    let (mut scan, mut error) = match Content::read(path) {
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
        error = error.or(Some(format!("{:#}", with_option(problem))));
    }
    error = error.or_else(|| outside(scan.as_ref()?, at));
    FileInfo {
        file: path.to_string_lossy().into_owned(),
        error,
        scan: scan.as_ref().map(|scan| scan_info(scan, at)),
    }
}

/// Words for a pixel that lies outside of all channels. Of several channels some may be smaller.
fn outside(scan: &Scan, at: &[Pixel]) -> Option<String> {
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

fn scan_info(scan: &Scan, at: &[Pixel]) -> ScanInfo {
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

pub(crate) fn line_name(line: LineDirection) -> &'static str {
    match line {
        LineDirection::Trace => "trace",
        LineDirection::Retrace => "retrace",
    }
}

fn iso_date(t: DateTime) -> String {
    format!(
        "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}",
        t.year, t.month, t.day, t.hour, t.minute, t.second
    )
}

fn parse_pixel(text: &str) -> Result<Pixel, String> {
    let parsed = || {
        let (row, column) = text.split_once(',')?;
        Some(Pixel {
            row: row.trim().parse().ok()?,
            column: column.trim().parse().ok()?,
        })
    };
    parsed().ok_or_else(|| "expected ROW,COL as two whole numbers, as in 0,511".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_two_whole_numbers() {
        assert_eq!(
            parse_pixel("3, 511"),
            Ok(Pixel {
                row: 3,
                column: 511
            })
        );
        for wrong in ["", "3", "3;4", "-1,2", "1,2,3", "a,b"] {
            assert!(parse_pixel(wrong).is_err(), "{wrong}");
        }
    }
}
