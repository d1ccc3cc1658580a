//! Agilent files (Molecular Imaging before, Keysight after), `.mi`.
//!
//! A text of lines with a key of 14 characters and a value; `bufferLabel` begins a channel, `data`
//! ends the header and names the kind of samples that follow, little endian, channel by channel.
//!
//! - Value = count × `bufferRange` / 2³¹ (`BINARY_32`) or / 2¹⁵ (`BINARY` or nothing).
//! - The bottom line comes first whatever `scanUp` says, retrace lines in order of position.
//! - Lengths are in m; `scanSpeed` is in lines per second, a line being trace and retrace.
//! - `scanAngle` is in degrees, taken as counter-clockwise.

use crate::clock;
use crate::cursor::Endian;
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding};
use crate::scan::{ChannelInfo, DateTime, FrameDirection, LineDirection, Scan, UnreadableChannel};
use crate::stored::Flat;
use crate::whole::{Extent, MOST_CHANNELS, some_readable};
use crate::words::{self, Unread};

const FORMAT: &str = "Agilent";
const KEY_WIDTH: usize = 14;
const MONTHS: [&str; 12] = [
    "Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec",
];

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

type Lines = Vec<(String, String)>;

fn get<'a>(lines: &'a [(String, String)], key: &str) -> Option<&'a str> {
    let (_, value) = lines.iter().find(|(k, _)| k == key)?;
    Some(value)
}

/// The text before the samples.
struct Header {
    frame: Lines,
    channels: Vec<Lines>,
    /// The value of `data`.
    data: String,
    /// Byte at which the samples begin.
    end: usize,
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let header = header(bytes)?;
    let kind = get(&header.frame, "fileType").unwrap_or("");
    if kind != "Image" {
        return Err(ReadError::Unsupported {
            format: FORMAT,
            reason: format!("expected an image, found {kind:?}"),
        });
    }
    let encoding = match header.data.as_str() {
        "BINARY_32" => Encoding::I32,
        "BINARY" | "" => Encoding::I16,
        other => {
            return Err(ReadError::Unsupported {
                format: FORMAT,
                reason: format!("expected data BINARY or BINARY_32, found {other:?}"),
            });
        }
    };
    let count = |key: &str| {
        let text = get(&header.frame, key).unwrap_or("");
        let count = text.parse::<usize>().ok();
        count.ok_or_else(|| damaged(format!("expected a number {key}, found {text:?}")))
    };
    let (columns, rows) = (count("xPixels")?, count("yPixels")?);
    let length = raster::byte_length(rows, columns, encoding)
        .ok_or_else(|| damaged(format!("its size is {rows} lines of {columns} samples")))?;
    if header.channels.is_empty() {
        return Err(damaged("its header announces no channel (no bufferLabel)"));
    }

    let mut outline = Outline::of(frame(&header.frame));
    let mut extent = Extent::default();
    for (index, lines) in header.channels.iter().enumerate() {
        let info = info(lines);
        let start = index.saturating_mul(length).saturating_add(header.end);
        if !extent.take(input.length, start, length, &info.name) {
            continue;
        }
        let range = get(lines, "bufferRange").unwrap_or("");
        let Some(range) = words::number(range) else {
            outline.scan.unreadable.push(UnreadableChannel {
                name: info.name,
                error: format!("expected a number bufferRange, found {range:?}"),
            });
            continue;
        };
        let full = 2f64.powi(8 * encoding.width() as i32 - 1);
        let words = format!("counts × bufferRange {range} / {full}");
        let of_channel = ChannelHeader::new(info, rows, columns)
            .in_unit(get(lines, "bufferUnit").unwrap_or(""))
            .of_size(outline.scan.size_nm)
            .scaled(range / full, 0.0, words);
        outline.add_flat(of_channel, Flat::at(start, encoding, Endian::Little));
    }
    extent.judge(some_readable(outline, header.channels.len())?, input.length)
}

fn header(bytes: &[u8]) -> Result<Header, ReadError> {
    let mut header = Header {
        frame: Vec::new(),
        channels: Vec::new(),
        data: String::new(),
        end: 0,
    };
    while let Some(length) = bytes[header.end..].iter().position(|&b| b == b'\n') {
        let line = words::decode(&bytes[header.end..header.end + length]);
        header.end += length + 1;
        // A blank begins a line of a longer value, such as a comment.
        if line.starts_with(' ') {
            continue;
        }
        let place = line
            .char_indices()
            .nth(KEY_WIDTH)
            .map_or(line.len(), |(i, _)| i);
        let (key, value) = (line[..place].trim(), line[place..].trim());
        match key {
            "data" => {
                value.clone_into(&mut header.data);
                return Ok(header);
            }
            "bufferLabel" if header.channels.len() == MOST_CHANNELS => {
                return Err(damaged(format!(
                    "it announces more than {MOST_CHANNELS} channels"
                )));
            }
            "bufferLabel" => header.channels.push(Vec::new()),
            _ => {}
        }
        let lines = header.channels.last_mut().unwrap_or(&mut header.frame);
        lines.push((key.to_owned(), value.to_owned()));
    }
    Err(damaged(format!(
        "expected a line \"data\" behind the header, found none in {} bytes: the file was cut off \
         inside the header",
        bytes.len()
    )))
}

fn info(lines: &[(String, String)]) -> ChannelInfo {
    let direction = get(lines, "direction").or_else(|| get(lines, "trace"));
    ChannelInfo {
        name: get(lines, "bufferLabel").unwrap_or("").to_owned(),
        internal_name: String::new(),
        line_direction: match direction {
            Some("Trace") => Some(LineDirection::Trace),
            Some("Retrace") => Some(LineDirection::Retrace),
            _ => None,
        },
        scan_line: get(lines, "acqMode")
            .filter(|mode| !mode.is_empty())
            .map(str::to_owned),
    }
}

/// Everything about the frame but its channels.
fn frame(lines: &[(String, String)]) -> Scan {
    let unread = Unread::default();
    let number = |key: &str| unread.number(key, get(lines, key));
    let nm = |key: &str| number(key).map(|metres| metres * 1e9);
    Scan {
        format: match get(lines, "version").filter(|version| !version.is_empty()) {
            Some(version) => format!("{FORMAT} {version}"),
            None => FORMAT.to_owned(),
        },
        acquired: unread.entry("dateAcquired", get(lines, "dateAcquired"), date_time),
        frame_direction: unread.entry("scanUp", get(lines, "scanUp"), |up| match up {
            "TRUE" => Some(FrameDirection::Up),
            "FALSE" => Some(FrameDirection::Down),
            _ => None,
        }),
        line_rate_hz: number("scanSpeed").filter(|&rate| rate > 0.0),
        rotation_rad: number("scanAngle").unwrap_or(0.0).to_radians(),
        offset_nm: ["xOffset", "yOffset"].map(|key| nm(key).unwrap_or(0.0)),
        size_nm: nm("xLength")
            .zip(nm("yLength"))
            .filter(|&(x, y)| x > 0.0 && y > 0.0)
            .map(|(x, y)| [x, y]),
        metadata: lines
            .iter()
            .filter(|(_, value)| !value.is_empty())
            .cloned()
            .collect(),
        notes: unread.notes(),
        ..Scan::default()
    }
}

/// `Tue Feb 18 15:00:51 2014`.
fn date_time(text: &str) -> Option<DateTime> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let [_, month, day, time, year] = words[..] else {
        return None;
    };
    let month = MONTHS.iter().position(|name| *name == month)? as i64 + 1;
    clock::date(
        [year.parse().ok()?, month, day.parse().ok()?],
        clock::clock(time)?,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(change: &[(&str, &str)], samples: Vec<u8>) -> Vec<u8> {
        let mut text = "fileType      Image\nversion       PicoView 1\n\
            dateAcquired  Tue Feb 18 15:00:51 2014\ncomment       \n              more\n\
            xPixels       3\nyPixels       2\nxOffset       1e-8\nyOffset       -2e-8\n\
            xLength       3.0e-8\nyLength       2.0e-8\nscanUp        FALSE\nscanSpeed     2.5\n\
            scanAngle     33\nbufferLabel   Topography\ndirection     Trace\nacqMode       Main\n\
            bufferRange   2.0\nbufferUnit    um\nbufferLabel   Friction\ndirection     Retrace\n\
            bufferRange   1.0\nbufferUnit    V\ndata          BINARY\n"
            .to_owned();
        for (from, to) in change {
            text = text.replace(from, to);
        }
        let mut bytes = text.into_bytes();
        bytes.extend(samples);
        bytes
    }

    fn counts(n: i16) -> Vec<u8> {
        (0..n).flat_map(|i| (i << 8).to_le_bytes()).collect()
    }

    #[test]
    fn values_and_frame() {
        let scan = crate::read(&file(&[], counts(12))).expect("whole");
        let quarter = 2.0 / 128.0;
        let [height, friction] = &scan.channels[..] else {
            panic!("two channels");
        };
        assert_eq!(
            height.values(),
            [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|n| n * quarter)
        );
        assert_eq!(friction.values()[0], 6.0 / 128.0);
        assert_eq!((height.unit.as_str(), friction.unit.as_str()), ("um", "V"));
        assert_eq!(friction.line_direction, Some(LineDirection::Retrace));
        assert_eq!(height.scan_line.as_deref(), Some("Main"));
        assert_eq!(scan.frame_direction, Some(FrameDirection::Down));
        assert_eq!(scan.line_rate_hz, Some(2.5));
        assert!((scan.rotation_rad - 33f64.to_radians()).abs() < 1e-12);
        let close = |[x, y]: [f64; 2], [a, b]: [f64; 2]| (x - a).abs() + (y - b).abs() < 1e-9;
        assert!(close(scan.size_nm.expect("a size"), [30.0, 20.0]));
        assert!(close(scan.offset_nm, [10.0, -20.0]));
        assert_eq!(scan.acquired, clock::date([2014, 2, 18], [15, 0, 51]));
    }

    #[test]
    fn wide_samples() {
        let wide: Vec<u8> = (0..12i32).flat_map(|n| (n << 24).to_le_bytes()).collect();
        let scan = crate::read(&file(&[("BINARY", "BINARY_32")], wide)).expect("whole");
        assert_eq!(scan.channels[0].values()[5], 5.0 * 2.0 / 128.0);
    }

    #[test]
    fn what_is_missing_is_said() {
        let error = |change: &[(&str, &str)]| {
            crate::read(&file(change, counts(12)))
                .expect_err("damaged")
                .to_string()
        };
        assert!(error(&[("Image", "Spectroscopy")]).contains("Spectroscopy"));
        assert!(error(&[("BINARY", "ASCII")]).contains("ASCII"));
        assert!(error(&[("xPixels       3", "xPixels       x")]).contains("xPixels"));
        assert!(error(&[("xPixels       3", "xPixels       0")]).contains("0 samples"));
        assert!(error(&[("xPixels       3", "xPixels       9999999999999999")]).contains("bytes"));
        assert!(error(&[("data  ", "DATA  ")]).contains("inside the header"));
        assert!(error(&[("bufferLabel", "BufferLabel")]).contains("no channel"));
        assert!(error(&[("bufferRange", "BufferRange")]).contains("bufferRange"));
        let half = crate::read(&file(
            &[("bufferRange   2.0", "bufferRange   x")],
            counts(12),
        ));
        let half = half.expect("one channel");
        assert_eq!((half.channels.len(), half.unreadable.len()), (1, 1));
        assert!(matches!(
            crate::read(&file(&[], counts(11))),
            Err(ReadError::Incomplete { readable, .. }) if readable.channels.len() == 1
        ));
    }
}
