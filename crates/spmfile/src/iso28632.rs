//! ISO 28632 text (`ISO/TC 201 SPM data transfer format`), often named `.spm`.
//!
//! 128 lines of fixed meaning, from the magic line to `end of header`, then one line of numbers per
//! pixel (one number per channel), then `end of experiment`. Line numbers below count from 1 as in
//! the standard.
//!
//! - Pixels are in the order of the scan: lines 21 and 23 say from where to where (`left to right`,
//!   `top to bottom`).
//! - Line 34 is the rotation in degrees, counter-clockwise; lines 28 and 29 the field of view,
//!   edge to edge, in the units of lines 26 and 27.
//! - Image programs that export this format invent the scan: where line 7 calls the parameters
//!   bogus, directions, rate and control are left open.

use crate::clock;
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::labels;
use crate::outline::{Input, Mixed, Outline};
use crate::raster::{self, Order};
use crate::scan::{ChannelInfo, DateTime, FrameDirection, LineDirection, Scan};
use crate::stored::Stored;
use crate::units;
use crate::words::{self, Unread};

const FORMAT: &str = "ISO 28632";
/// Number of header lines.
const LINES: usize = 128;
/// Lines that hold the same words in every file.
const FIXED: [(usize, &str); 6] = [
    (2, "general information"),
    (16, "scan information"),
    (68, "single-channel mapping description"),
    (87, "data treatment description"),
    (93, "multi-channel mapping description"),
    (LINES, "end of header"),
];

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let (head, body) = split(bytes)?;
    let header = Header::of(&head)?;
    let channels = header.channels()?;
    let columns = header.count(24)?;
    let rows = header.count(25)?;
    let pixels = columns.checked_mul(rows);
    // A number takes two bytes at least.
    let pixels = pixels
        .filter(|&n| n.saturating_mul(2 * channels.len()) <= bytes.len().saturating_add(1))
        .ok_or_else(|| {
            damaged(format!(
                "expected {rows} lines of {columns} pixels, found {} bytes in all",
                bytes.len()
            ))
        })?;
    let order = header.order()?;
    let mut outline = Outline::of(header.frame());
    outline.scan.notes = header.unread.notes();
    let size = outline.scan.size_nm;
    for (info, unit) in channels {
        let of_channel = ChannelHeader {
            plane_fit: header.text(89).map(str::to_owned),
            ..ChannelHeader::new(info, rows, columns)
                .in_unit(&unit)
                .of_size(size)
        };
        outline.add(of_channel, Stored::Mixed);
    }
    outline.together = Some(Box::new(move |chosen| {
        let (values, damage) = values(body, pixels, chosen)?;
        let turned = |values: Vec<f64>| raster::turned(&values, columns, order);
        Ok(Mixed {
            values: values.into_iter().map(turned).collect(),
            damage,
        })
    }));
    Ok(outline)
}

/// The header's lines and the bytes behind them.
fn split(bytes: &[u8]) -> Result<(Vec<String>, &[u8]), ReadError> {
    let mut rest = bytes;
    let mut lines = Vec::with_capacity(LINES);
    while lines.len() < LINES {
        let Some(end) = rest.iter().position(|&b| b == b'\n') else {
            return Err(damaged(format!(
                "expected {LINES} lines of header, found {}: the file was cut off inside it",
                lines.len()
            )));
        };
        let text = words::decode(&rest[..end]);
        lines.push(text.trim().to_owned());
        rest = &rest[end + 1..];
    }
    Ok((lines, rest))
}

struct Header<'a> {
    lines: &'a [String],
    unread: Unread,
}

impl<'a> Header<'a> {
    fn of(lines: &'a [String]) -> Result<Self, ReadError> {
        for (number, words) in FIXED {
            let found = lines.get(number - 1).map_or("", String::as_str);
            if !found.eq_ignore_ascii_case(words) {
                return Err(damaged(format!(
                    "expected {words:?} in line {number}, found {found:?}"
                )));
            }
        }
        Ok(Self {
            lines,
            unread: Unread::default(),
        })
    }

    /// A line that is not empty; numbers count from 1.
    fn text(&self, line: usize) -> Option<&'a str> {
        let text = self.lines.get(line.checked_sub(1)?)?.as_str();
        (!text.is_empty()).then_some(text)
    }

    fn number(&self, line: usize) -> Option<f64> {
        self.unread.number(&format!("line {line}"), self.text(line))
    }

    fn count(&self, line: usize) -> Result<usize, ReadError> {
        let text = self.text(line).unwrap_or("");
        match text.parse() {
            Ok(n) if n > 0 => Ok(n),
            _ => Err(damaged(format!(
                "expected a number above 0 in line {line}, found {text:?}"
            ))),
        }
    }

    /// A length: its number in one line, its unit in another.
    fn length_nm(&self, line: usize, unit: usize) -> Option<f64> {
        Some(self.number(line)? * units::nm_per(self.text(unit)?)?)
    }

    /// Whether the scan's parameters are said to be invented.
    fn bogus(&self) -> bool {
        let comment = self.text(7).unwrap_or("").to_ascii_lowercase();
        comment.contains("bogus")
    }

    /// Name and unit of every channel.
    fn channels(&self) -> Result<Vec<(ChannelInfo, String)>, ReadError> {
        let mode = self.text(8).unwrap_or("");
        let regular = self.text(17).unwrap_or("");
        let refused = |reason: String| ReadError::Unsupported {
            format: FORMAT,
            reason,
        };
        let places: Vec<(usize, usize)> = match mode {
            "MAP_SC" => vec![(69, 70)],
            "MAP_MC" => {
                let count = self.count(94)?;
                if count > 8 {
                    return Err(ReadError::TooManyChannels {
                        found: count,
                        limit: 8,
                    });
                }
                (0..count).map(|n| (95 + 3 * n, 96 + 3 * n)).collect()
            }
            other => {
                return Err(refused(format!(
                    "its experiment mode is {other:?}, no image"
                )));
            }
        };
        if !regular.eq_ignore_ascii_case("REGULAR MAPPING") {
            return Err(refused(format!(
                "its scan mode is {regular:?}, no regular image"
            )));
        }
        let channel = |(name, unit)| {
            let name = self.text(name).unwrap_or("").to_owned();
            let info = ChannelInfo {
                line_direction: labels::line_direction(&name).or_else(|| self.line_direction()),
                name,
                internal_name: String::new(),
                scan_line: None,
            };
            let unit = match self.text(unit) {
                None | Some("n" | "d") => String::new(),
                Some(unit) => unit.to_owned(),
            };
            (info, unit)
        };
        Ok(places.into_iter().map(channel).collect())
    }

    fn line_direction(&self) -> Option<LineDirection> {
        match self.text(21) {
            _ if self.bogus() => None,
            Some("left to right") => Some(LineDirection::Trace),
            Some("right to left") => Some(LineDirection::Retrace),
            _ => None,
        }
    }

    /// In which order the pixels come.
    fn order(&self) -> Result<Order, ReadError> {
        let (fast, slow) = (self.text(20), self.text(22));
        if (fast, slow) != (Some("X"), Some("Y")) {
            return Err(ReadError::Unsupported {
                format: FORMAT,
                reason: format!(
                    "its fast and slow axes are {:?} and {:?}; expected X and Y",
                    fast.unwrap_or(""),
                    slow.unwrap_or("")
                ),
            });
        }
        let told = |line: usize, usual: &str, turned: &str| match self.text(line) {
            Some(words) if words.eq_ignore_ascii_case(usual) => Ok(false),
            Some(words) if words.eq_ignore_ascii_case(turned) => Ok(true),
            found => Err(damaged(format!(
                "expected {usual:?} or {turned:?} in line {line}, found {:?}",
                found.unwrap_or("")
            ))),
        };
        Ok(Order {
            top_first: !told(23, "top to bottom", "bottom to top")?,
            mirrored: told(21, "left to right", "right to left")?,
        })
    }

    /// Everything about the frame but its channels.
    fn frame(&self) -> Scan {
        let real = !self.bogus();
        let size = self.length_nm(28, 26).zip(self.length_nm(29, 27));
        Scan {
            format: FORMAT.to_owned(),
            instrument: self.text(4).map(str::to_owned),
            acquired: self.date(),
            frame_direction: match self.text(23) {
                Some("top to bottom") if real => Some(FrameDirection::Down),
                Some("bottom to top") if real => Some(FrameDirection::Up),
                _ => None,
            },
            line_rate_hz: self
                .number(38)
                .filter(|&rate| real && rate > 0.0 && self.text(37) == Some("Hz")),
            rotation_rad: self.number(34).unwrap_or(0.0).to_radians(),
            offset_nm: [(32, 30), (33, 31)]
                .map(|(line, unit)| self.length_nm(line, unit).unwrap_or(0.0)),
            size_nm: size
                .map(|(width, height)| [width, height])
                .filter(|&[width, height]| width > 0.0 && height > 0.0),
            closed_loop: match self.text(18).map(str::to_ascii_lowercase) {
                Some(words) if real && words.contains("closed") => Some(true),
                Some(words) if real && words.contains("open") => Some(false),
                _ => None,
            },
            metadata: self
                .lines
                .iter()
                .enumerate()
                .filter(|(index, line)| {
                    let fixed = FIXED.iter().any(|(number, _)| number == &(index + 1));
                    *index > 0 && !fixed && !line.is_empty()
                })
                .map(|(index, line)| (format!("line {}", index + 1), line.clone()))
                .collect(),
            ..Scan::default()
        }
    }

    fn date(&self) -> Option<DateTime> {
        let whole = |text: &str| text.parse::<i64>().ok();
        let part = |line: usize| {
            self.unread
                .entry(&format!("line {line}"), self.text(line), whole)
        };
        clock::date(
            [part(9)?, part(10)?, part(11)?],
            [part(12)?, part(13)?, part(14)?],
        )
    }
}

/// The values of the chosen channels, and what is missing. `chosen` has one entry per channel.
fn values(
    body: &[u8],
    pixels: usize,
    chosen: &[bool],
) -> Result<(Vec<Vec<f64>>, Option<String>), ReadError> {
    let count = chosen.iter().filter(|&&c| c).count();
    let mut all: Vec<Vec<f64>> = vec![Vec::with_capacity(pixels); count];
    let text = words::decode(body);
    let mut lines = text.lines();
    for pixel in 0..pixels {
        let line = lines.next().unwrap_or("").trim();
        let mut numbers = line.split([' ', '\t', ',']).filter(|word| !word.is_empty());
        let mut target = all.iter_mut();
        for &chosen in chosen {
            let word = numbers.next().unwrap_or("");
            let Ok(value) = word.parse::<f64>() else {
                return missing(all, pixels, pixel, line, lines.next().is_some());
            };
            if chosen && let Some(target) = target.next() {
                target.push(if value.is_finite() { value } else { f64::NAN });
            }
        }
    }
    let end = lines.next().unwrap_or("").trim();
    if end.eq_ignore_ascii_case("end of experiment") {
        Ok((all, None))
    } else if end.is_empty() {
        Ok((
            all,
            Some("the line \"end of experiment\" is missing".to_owned()),
        ))
    } else {
        Err(damaged(format!(
            "expected \"end of experiment\" behind {pixels} pixels, found {end:?}"
        )))
    }
}

/// A pixel that is no number: a file cut off there is incomplete, any other is damaged.
fn missing(
    mut all: Vec<Vec<f64>>,
    pixels: usize,
    pixel: usize,
    line: &str,
    more: bool,
) -> Result<(Vec<Vec<f64>>, Option<String>), ReadError> {
    let ended = line.is_empty() || line.eq_ignore_ascii_case("end of experiment");
    if more && !ended {
        return Err(damaged(format!(
            "expected numbers for pixel {pixel} of {pixels}, found {line:?}"
        )));
    }
    for values in &mut all {
        values.truncate(pixel);
        values.resize(pixels, f64::NAN);
    }
    Ok((
        all,
        Some(format!("it ends after {pixel} of {pixels} pixels")),
    ))
}

#[cfg(test)]
mod tests;
