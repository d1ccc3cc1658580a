//! `moiregauge info`: what scan files hold, how it is scaled, what the analysis would miss.
//!
//! Rows are counted as on the screen here: row 0 is the top line, where y is largest.

use std::fmt::Write as _;
use std::io::{ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde::Serialize;
use spmfile::{
    Channel, DateTime, FrameDirection, LineDirection, ReadError, Scan, position_sensors,
    sensor_axis,
};

/// Show what scan files hold: channels, units, sizes, directions, scaling
///
/// Reads each file and prints its channels with their statistics, how counts become values, and
/// what is missing for the moiré analysis. Damaged files are shown as far as they are whole; the
/// exit code then tells of the failure.
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
    for file in expand(&args.files) {
        let info = match file {
            Ok(path) => file_info(&path, &args.at),
            Err((path, error)) => FileInfo {
                file: path.to_string_lossy().into_owned(),
                error: Some(error),
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

fn file_info(path: &Path, at: &[Pixel]) -> FileInfo {
    let (scan, mut error) = match std::fs::read(path) {
        Err(error) => (None, Some(error.to_string())),
        Ok(bytes) => match spmfile::read(&bytes) {
            Ok(scan) => (Some(scan), None),
            Err(ReadError::Incomplete { reason, readable }) => {
                let reason = format!("the file is damaged: {reason}");
                (Some(*readable), Some(reason))
            }
            Err(error) => (None, Some(error.to_string())),
        },
    };
    let outside = scan.iter().flat_map(|scan| &scan.channels).find_map(|c| {
        let pixel = at
            .iter()
            .find(|p| p.row >= c.rows || p.column >= c.columns)?;
        Some(format!(
            "--at {},{} lies outside channel {:?} with {} rows and {} columns",
            pixel.row, pixel.column, c.name, c.rows, c.columns
        ))
    });
    error = error.or(outside);
    FileInfo {
        file: path.to_string_lossy().into_owned(),
        error,
        scan: scan.as_ref().map(|scan| scan_info(scan, at)),
    }
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

fn line_name(line: LineDirection) -> &'static str {
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

/// The readable form of one file.
fn table(info: &FileInfo) -> String {
    let mut text = format!("{}\n", info.file);
    let Some(scan) = &info.scan else {
        text += "  not read\n";
        return text;
    };
    // Writing to a string cannot fail.
    let _ = writeln!(text, "  {}", head_line(scan));
    let _ = writeln!(text, "  {}", frame_line(scan));
    if !scan.channels.is_empty() {
        text.push('\n');
        text += &aligned(&channel_cells(&scan.channels));
    }
    for channel in &scan.unreadable {
        let _ = writeln!(text, "  unreadable: {}: {}", channel.name, channel.error);
    }
    if scan.missing_for_analysis.is_empty() {
        text += "\n  nothing is missing for the moiré analysis\n";
    } else {
        text += "\n  missing for the moiré analysis:\n";
        for words in &scan.missing_for_analysis {
            let _ = writeln!(text, "    {words}");
        }
    }
    text
}

fn head_line(scan: &ScanInfo) -> String {
    let mut words = vec![scan.format.clone()];
    words.extend(scan.instrument.clone());
    words.extend(scan.acquired.as_ref().map(|date| date.replace('T', " ")));
    words.join(", ")
}

fn frame_line(scan: &ScanInfo) -> String {
    let number = |value: Option<f64>, unit: &str| {
        value.map_or("unknown".to_owned(), |v| format!("{}{unit}", short(v)))
    };
    let size = scan.size_nm.map_or("unknown".to_owned(), |[fast, slow]| {
        format!("{} × {} nm", short(fast), short(slow))
    });
    let closed_loop = match scan.closed_loop {
        Some(true) => "on",
        Some(false) => "off",
        None => "unknown",
    };
    format!(
        "frame {}, line rate {}, size {size}, rotation {}°, offset {}, {} nm, rounding {}, closed loop {closed_loop}",
        scan.frame_direction.unwrap_or("direction unknown"),
        number(scan.line_rate_hz, " Hz"),
        short(scan.rotation_deg),
        short(scan.offset_nm[0]),
        short(scan.offset_nm[1]),
        number(scan.rounding, ""),
    )
}

fn channel_cells(channels: &[ChannelInfo]) -> Vec<Vec<String>> {
    let mut head: Vec<String> = [
        "channel",
        "line",
        "rows × cols",
        "size nm",
        "unit",
        "min",
        "max",
        "mean",
        "std",
        "missing",
    ]
    .map(str::to_owned)
    .to_vec();
    let pixels = channels.first().map_or(&[][..], |c| &c.samples);
    head.extend(pixels.iter().map(|s| format!("at {},{}", s.row, s.column)));
    head.extend(["plane fit", "value"].map(str::to_owned));
    let row = |c: &ChannelInfo| {
        let interleaved = c.scan_line.as_deref().filter(|s| *s != "Main");
        let line = [c.line_direction, interleaved].into_iter().flatten();
        let size = match (c.width_nm, c.height_nm) {
            (Some(width), Some(height)) => format!("{} × {}", short(width), short(height)),
            _ => "?".to_owned(),
        };
        let mut cells = vec![
            c.name.clone(),
            line.collect::<Vec<_>>().join(" "),
            format!("{} × {}", c.rows, c.columns),
            size,
            c.unit.clone(),
        ];
        cells.extend([c.min, c.max, c.mean, c.std].map(short));
        cells.push(c.missing.to_string());
        let value = |s: &Sample| s.value.map_or("-".to_owned(), short);
        cells.extend(c.samples.iter().map(value));
        cells.push(c.plane_fit.clone().unwrap_or_else(|| "none".to_owned()));
        cells.push(c.scaling.clone());
        cells
    };
    std::iter::once(head)
        .chain(channels.iter().map(row))
        .collect()
}

/// Columns two blanks apart.
fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row
            .iter()
            .zip(&widths)
            .map(|(cell, width)| format!("{cell:width$}"));
        format!("  {}\n", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

/// Six significant digits, without trailing zeros.
fn short(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let magnitude = if value == 0.0 {
        0.0
    } else {
        value.abs().log10().floor()
    };
    if (-4.0..6.0).contains(&magnitude) {
        let digits = (5.0 - magnitude) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') {
            return text.trim_end_matches('0').trim_end_matches('.').to_owned();
        }
        return text;
    }
    format!("{value:.5e}")
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

/// The files meant by names of files, folders and wildcards, in order; names that mean none come
/// back with the reason.
pub(crate) fn expand(paths: &[PathBuf]) -> Vec<Result<PathBuf, (PathBuf, String)>> {
    let mut files = Vec::new();
    for path in paths {
        let found = if path.is_dir() {
            folder(
                path,
                &|_, file| holds_scan(file),
                "the folder holds no scan files (subfolders are not searched)",
            )
        } else if path.exists() {
            Ok(vec![path.clone()])
        } else {
            matching(path)
        };
        match found {
            Ok(found) => files.extend(found.into_iter().map(Ok)),
            Err(error) => files.push(Err((path.clone(), error))),
        }
    }
    files
}

/// The files of a folder that pass `wanted`, by name.
fn folder(
    path: &Path,
    wanted: &dyn Fn(&str, &Path) -> bool,
    otherwise: &str,
) -> Result<Vec<PathBuf>, String> {
    let entries = std::fs::read_dir(path).map_err(|e| e.to_string())?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| {
            let entry = entry.ok()?;
            let file = entry.path();
            let name = entry.file_name().to_string_lossy().into_owned();
            (file.is_file() && wanted(&name, &file)).then_some(file)
        })
        .collect();
    files.sort();
    if files.is_empty() {
        return Err(otherwise.to_owned());
    }
    Ok(files)
}

/// Whether a file's first bytes are those of a scan.
fn holds_scan(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(512).read_to_end(&mut head));
    read.is_ok() && spmfile::looks_like_scan(&head)
}

/// Wildcards in the last part of a path, for shells that leave them alone.
fn matching(path: &Path) -> Result<Vec<PathBuf>, String> {
    let pattern = path
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    let Some(pattern) = pattern.filter(|p| p.contains(['*', '?'])) else {
        return Err("no such file or folder".to_owned());
    };
    let pattern: Vec<char> = pattern.chars().collect();
    let parent = match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    let fits = |name: &str, _: &Path| fits(&pattern, &name.chars().collect::<Vec<_>>());
    folder(parent, &fits, "no file fits this name")
}

/// `*` stands for any characters, `?` for one. Remembers the last star only: earlier ones never
/// have to take more than they did.
fn fits(pattern: &[char], name: &[char]) -> bool {
    let (mut p, mut n) = (0, 0);
    let mut star = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                star = Some((p + 1, n));
                p += 1;
            }
            Some(&c) if c == '?' || c == name[n] => {
                p += 1;
                n += 1;
            }
            _ => match star {
                Some((after, taken)) => {
                    star = Some((after, taken + 1));
                    p = after;
                    n = taken + 1;
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
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

    #[test]
    fn numbers_are_short() {
        assert_eq!(short(70.0), "70");
        assert_eq!(short(209.765_625), "209.766");
        assert_eq!(short(-0.001_234_567_89), "-0.00123457");
        assert_eq!(short(1e-9), "1.00000e-9");
        assert_eq!(short(100_000.0), "100000");
        assert_eq!(short(f64::NAN), "-");
    }

    #[test]
    fn wildcards() {
        let fit = |p: &str, n: &str| {
            fits(
                &p.chars().collect::<Vec<_>>(),
                &n.chars().collect::<Vec<_>>(),
            )
        };
        assert!(fit("*.spm", "scän 1.spm") && fit("a?c*", "abc") && fit("*a*b", "xaab"));
        assert!(!fit("*.spm", "scan.000") && !fit("a?c", "ac") && !fit("", "a"));
    }
}
