//! `Scan` → a NanoScope 9.70 file with 32-bit samples, for simulated scans.
//!
//! Lengths are stored as an instrument stores them: a voltage and a sensitivity in nm/V. Values are
//! rounded to counts of a range just wide enough for the channel, 2⁻³² of it each; the header
//! carries every number with all its digits, so that a reader gets exactly what was rounded.

use std::fmt::Write as _;

use crate::scan::{Channel, DateTime, FrameDirection, LineDirection, Samples, Scan};
use crate::sensors::sensor_axis;
use crate::units::nm_per;

/// Where the data of NanoScope 9 files begin, if the header is not longer.
const USUAL_START: usize = 80960;
const BLOCK: usize = 4096;
const RANGE: f64 = 4_294_967_296.0;

/// Why a scan cannot be written.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// Samples and shape disagree.
    #[error("channel {name:?} has {samples} samples for {rows} lines of {columns}")]
    Shape {
        /// The channel.
        name: String,
        /// Its number of samples.
        samples: usize,
        /// Its lines.
        rows: usize,
        /// Its samples per line.
        columns: usize,
    },
    /// Integer counts cannot say "missing".
    #[error(
        "channel {name:?} has values that are missing or infinite, which the format cannot hold"
    )]
    NotFinite {
        /// The channel.
        name: String,
    },
}

/// A channel as counts and the two factors of its scale.
struct Encoded<'a> {
    channel: &'a Channel,
    counts: Vec<i32>,
    hard_value: f64,
    hard_unit: String,
    sensitivity: Sensitivity,
}

struct Sensitivity {
    name: String,
    /// Value and unit above `/V`; `None` leaves the hard unit.
    value: Option<(f64, String)>,
    in_scanner_list: bool,
}

/// The bytes of a file that holds the scan's channels.
///
/// `unreadable` channels, `instrument` strings aside from the description and scalings in words are
/// not written.
///
/// # Errors
/// - [`WriteError::Shape`] if a channel's samples do not fill its lines.
/// - [`WriteError::NotFinite`] if a value is NaN or infinite.
pub fn write(scan: &Scan) -> Result<Vec<u8>, WriteError> {
    let channels: Vec<Encoded<'_>> = scan
        .channels
        .iter()
        .map(encode)
        .collect::<Result<_, WriteError>>()?;
    let mut start = USUAL_START;
    let header = loop {
        let header = encoding_rs::WINDOWS_1252
            .encode(&header(scan, &channels, start))
            .0
            .into_owned();
        if header.len() < start {
            break header;
        }
        start = (header.len() / BLOCK + 2) * BLOCK;
    };
    let data: usize = channels.iter().map(|c| 4 * c.counts.len()).sum();
    let mut bytes = Vec::with_capacity(start + data);
    bytes.extend_from_slice(&header);
    bytes.push(0x1a);
    bytes.resize(start, 0);
    for channel in &channels {
        bytes.extend(channel.counts.iter().flat_map(|c| c.to_le_bytes()));
    }
    Ok(bytes)
}

fn encode(channel: &Channel) -> Result<Encoded<'_>, WriteError> {
    if channel.samples.len() != channel.rows * channel.columns {
        return Err(WriteError::Shape {
            name: channel.name.clone(),
            samples: channel.samples.len(),
            rows: channel.rows,
            columns: channel.columns,
        });
    }
    let sensitivity = sensitivity(channel);
    let factor = sensitivity.value.as_ref().map_or(1.0, |(value, _)| *value);
    let (counts, hard_value) = match &channel.samples {
        Samples::I32(counts) if channel.offset == 0.0 => {
            (counts.clone(), channel.scale * RANGE / factor)
        }
        _ => {
            let values = channel.values();
            if values.iter().any(|v| !v.is_finite()) {
                return Err(WriteError::NotFinite {
                    name: channel.name.clone(),
                });
            }
            let largest = values.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
            // The next power of two above twice the largest value: rounding cannot overflow.
            let range = if largest > 0.0 {
                (2.1 * largest).log2().ceil().exp2()
            } else {
                1.0
            };
            let hard_value = range / factor;
            let scale = hard_value / RANGE * factor;
            let counts = values.iter().map(|v| (v / scale).round() as i32).collect();
            (counts, hard_value)
        }
    };
    let hard_unit = match sensitivity.value {
        Some(_) => "V".to_owned(),
        None => written_unit(&channel.unit),
    };
    Ok(Encoded {
        channel,
        counts,
        hard_value,
        hard_unit,
        sensitivity,
    })
}

/// Sensitivities of the order of a real scanner's, so that the voltages look like voltages.
fn sensitivity(channel: &Channel) -> Sensitivity {
    let axis = sensor_axis(&channel.name, &channel.internal_name);
    let Some(nm) = nm_per(&channel.unit) else {
        return Sensitivity {
            name: format!("Sens. {}", plain(&channel.name)),
            value: None,
            in_scanner_list: false,
        };
    };
    let (name, in_nm) = match axis {
        Some('X') => ("Sens. Xsensor".to_owned(), 3410.089),
        Some(_) => ("Sens. Ysensor".to_owned(), 3641.009),
        None => (format!("Sens. {}Sens", plain(&channel.name)), 70.0),
    };
    Sensitivity {
        name,
        value: Some((in_nm / nm, written_unit(&channel.unit))),
        in_scanner_list: axis.is_some(),
    }
}

/// Text that cannot break the header's grammar.
fn plain(text: &str) -> String {
    text.chars()
        .map(|c| {
            if c.is_control() || "[]\"\\".contains(c) {
                ' '
            } else {
                c
            }
        })
        .collect()
}

/// Degrees as the instruments write them: the ordinal sign.
fn written_unit(unit: &str) -> String {
    plain(unit).replace('°', "º")
}

fn header(scan: &Scan, channels: &[Encoded<'_>], start: usize) -> String {
    let mut lines = vec![
        r"\*File list".to_owned(),
        r"\Version: 0x09700105".to_owned(),
    ];
    lines.extend(scan.acquired.map(|t| format!(r"\Date: {}", date_text(t))));
    lines.push(r"\Start context: OL2".to_owned());
    lines.push(format!(r"\Data length: {start}"));
    lines.push(r"\*Equipment list".to_owned());
    let instrument = scan.instrument.as_deref().unwrap_or("");
    lines.push(format!(r"\Description: {}", plain(instrument)));
    lines.push(r"\*Scanner list".to_owned());
    sensitivity_lines(&mut lines, channels, true);
    scan_list(&mut lines, scan, channels);
    let mut offset = start;
    for channel in channels {
        image_list(&mut lines, scan, channel, offset);
        offset += 4 * channel.counts.len();
    }
    lines.push(r"\*File list end".to_owned());
    lines.iter().fold(String::new(), |mut text, line| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{line}\r\n");
        text
    })
}

fn sensitivity_lines(lines: &mut Vec<String>, channels: &[Encoded<'_>], in_scanner_list: bool) {
    for channel in channels {
        let s = &channel.sensitivity;
        let line = match &s.value {
            Some((value, unit)) => format!(r"\@{}: V {value} {unit}/V", s.name),
            None => format!(r"\@{}: V 1.000000 ", s.name),
        };
        if s.in_scanner_list == in_scanner_list && !lines.contains(&line) {
            lines.push(line);
        }
    }
}

fn scan_list(lines: &mut Vec<String>, scan: &Scan, channels: &[Encoded<'_>]) {
    lines.push(r"\*Ciao scan list".to_owned());
    lines.push(r"\Operating mode: Image".to_owned());
    if let Some([fast, slow]) = scan.size_nm {
        lines.push(format!(r"\Scan Size: {fast} nm"));
        lines.push(format!(r"\Slow Axis Size: {slow} nm"));
    }
    lines.push(format!(r"\X Offset: {} nm", scan.offset_nm[0]));
    lines.push(format!(r"\Y Offset: {} nm", scan.offset_nm[1]));
    lines.push(format!(r"\Rotate Ang.: {}", scan.rotation_rad));
    lines.extend(scan.rounding.map(|r| format!(r"\X round: {r}")));
    if let Some(first) = channels.first() {
        lines.push(format!(r"\Samps/line: {}", first.channel.columns));
        lines.push(format!(r"\Lines: {}", full_lines(scan, first.channel)));
    }
    // Readers disagree on what another ratio does to the sizes: those are given outright.
    lines.push(r"\Aspect Ratio: 1:1".to_owned());
    lines.extend(scan.line_rate_hz.map(|r| format!(r"\Scan Rate: {r}")));
    if let Some(direction) = scan.frame_direction {
        lines.push(format!(
            r"\Capture direction: {}",
            direction_text(direction)
        ));
    }
    if let Some(closed) = scan.closed_loop {
        let state = if closed { "On" } else { "Off" };
        lines.push(format!(r"\XY Closed Loop: {state}"));
    }
    sensitivity_lines(lines, channels, false);
}

/// Lines of the full frame: an unfinished one has recorded only a part of its height.
fn full_lines(scan: &Scan, channel: &Channel) -> usize {
    match (scan.size_nm, channel.height_nm) {
        (Some([_, full]), Some(height)) if height > 0.0 && full > height => {
            (channel.rows as f64 * full / height).round() as usize
        }
        _ => channel.rows,
    }
}

fn image_list(lines: &mut Vec<String>, scan: &Scan, encoded: &Encoded<'_>, offset: usize) {
    let Encoded {
        channel,
        hard_value,
        hard_unit,
        sensitivity,
        ..
    } = encoded;
    let mut push = |line: String| lines.push(line);
    push(r"\*Ciao image list".to_owned());
    push(format!(r"\Data offset: {offset}"));
    push(format!(r"\Data length: {}", 4 * encoded.counts.len()));
    push(r"\Bytes/pixel: 4".to_owned());
    push(r"\Start context: OL".to_owned());
    push(r"\Data type: AFM".to_owned());
    if let Some(direction) = scan.frame_direction {
        push(format!(r"\Frame direction: {}", direction_text(direction)));
    }
    push(format!(r"\Samps/line: {}", channel.columns));
    push(format!(r"\Number of lines: {}", channel.rows));
    // Another ratio than 1:1 marks an unfinished frame.
    match (channel.height_nm, scan.size_nm) {
        (Some(height), Some([fast, _])) if full_lines(scan, channel) != channel.rows => {
            push(format!(r"\Aspect Ratio: {}", height / fast));
        }
        _ => push(r"\Aspect Ratio: 1:1".to_owned()),
    }
    if let Some([fast, slow]) = scan.size_nm {
        push(format!(r"\Scan Size: {fast} {slow} nm"));
    }
    let scan_line = channel.scan_line.as_deref().unwrap_or("Main");
    push(format!(r"\Scan Line: {}", plain(scan_line)));
    match channel.line_direction {
        Some(LineDirection::Trace) => push(r"\Line Direction: Trace".to_owned()),
        Some(LineDirection::Retrace) => push(r"\Line Direction: Retrace".to_owned()),
        None => {}
    }
    let fit = channel.plane_fit.as_deref().unwrap_or("");
    push(format!(
        r"\Realtime Planefit: {}",
        fit_text(fit, "realtime")
    ));
    push(format!(r"\Offline Planefit: {}", fit_text(fit, "offline")));
    push(r"\Valid data start X: 0".to_owned());
    push(r"\Valid data start Y: 0".to_owned());
    push(format!(r"\Valid data len X: {}", channel.columns));
    push(format!(r"\Valid data len Y: {}", channel.rows));
    push(format!(
        r#"\@2:Image Data: S [{}] "{}""#,
        plain(&channel.internal_name),
        plain(&channel.name)
    ));
    let lsb = decimal(hard_value / RANGE);
    push(r"\@Z magnify: C [2:Z scale] 0.01".to_owned());
    push(format!(
        r"\@2:Z scale: V [{}] ({lsb} {hard_unit}/LSB) {hard_value} {hard_unit}",
        sensitivity.name
    ));
    push(format!(
        r"\@2:Z offset: V [{}] ({lsb} {hard_unit}/LSB) 0 {hard_unit}",
        sensitivity.name
    ));
}

/// The part of `Line (realtime), Full (offline)` that happened `when`; words without a time count
/// as realtime.
fn fit_text(fit: &str, when: &str) -> String {
    let ending = format!(" ({when})");
    let part = fit.split(", ").find_map(|part| part.strip_suffix(&ending));
    match part {
        Some(part) => plain(part),
        None if when == "realtime" && !fit.is_empty() && !fit.contains('(') => plain(fit),
        None => "None".to_owned(),
    }
}

/// A small number without exponent, which other readers do not expect there.
fn decimal(value: f64) -> String {
    format!("{value:.20}")
}

fn direction_text(direction: FrameDirection) -> &'static str {
    match direction {
        FrameDirection::Up => "Up",
        FrameDirection::Down => "Down",
    }
}

/// `07:37:34 PM Fri Mar 15 2024`.
fn date_text(t: DateTime) -> String {
    const MONTHS: [&str; 12] = [
        "Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec",
    ];
    const DAYS: [&str; 7] = ["Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"];
    // Sakamoto's rule: the weekday of the proleptic Gregorian calendar.
    const SHIFTS: [i32; 12] = [0, 3, 2, 5, 0, 3, 5, 1, 4, 6, 2, 4];
    let month = usize::from(t.month.clamp(1, 12)) - 1;
    let year = if month < 2 { t.year - 1 } else { t.year };
    let weekday = (year + year.div_euclid(4) - year.div_euclid(100)
        + year.div_euclid(400)
        + SHIFTS[month]
        + i32::from(t.day))
    .rem_euclid(7);
    let hour = match t.hour % 12 {
        0 => 12,
        hour => hour,
    };
    format!(
        "{hour:02}:{:02}:{:02} {} {} {} {:02} {}",
        t.minute,
        t.second,
        if t.hour < 12 { "AM" } else { "PM" },
        DAYS[weekday as usize],
        MONTHS[month],
        t.day,
        t.year
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The dates of real files, weekday included.
    #[test]
    fn dates_as_instruments_write_them() {
        let at = |year, month, day, hour, minute, second| {
            date_text(DateTime {
                year,
                month,
                day,
                hour,
                minute,
                second,
            })
        };
        assert_eq!(at(2021, 6, 30, 11, 38, 13), "11:38:13 AM Wed Jun 30 2021");
        assert_eq!(at(2014, 12, 15, 13, 33, 51), "01:33:51 PM Mon Dec 15 2014");
        assert_eq!(at(2016, 1, 12, 9, 57, 48), "09:57:48 AM Tue Jan 12 2016");
    }
}
