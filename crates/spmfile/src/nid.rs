//! Nanosurf files (`.nid`, and `.ezd` before).
//!
//! A text of sections `[name]` with lines `key=value`, the bytes `#!`, and the images
//! one behind the other. The section `DataSet` lists them by group (`Gr0-Ch1`), each with a section
//! of its own; `Dim0` and `Dim1` are the axes, `Dim2` the value.
//!
//! - Value = (count + half the range of counts) / range of counts × `Dim2Range` + `Dim2Min`.
//! - The bottom line comes first, backward lines are stored in order of position.
//! - `Time/Line` is the time of one line in one direction; the way back takes as long again
//!   (manual of the scan software).
//! - `Rotation` is in degrees, taken as counter-clockwise.
//! - `CurLine` is the last line of an unfinished frame; lines never filled are missing.

use std::collections::BTreeMap;

use memchr::memmem;

use crate::clock;
use crate::cursor::Endian;
use crate::error::ReadError;
use crate::header::{ChannelHeader, Scaling};
use crate::judge::Check;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding};
use crate::scan::{ChannelInfo, DateTime, FrameDirection, LineDirection, Scan, UnreadableChannel};
use crate::stored::Flat;
use crate::units::{self, nm_per};
use crate::whole::{Extent, MOST_CHANNELS, some_readable};
use crate::words::{self, Unread};

const FORMAT: &str = "Nanosurf";
const DATA_MARK: &[u8] = b"#!";

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// Sections by name, keys in the order of the file.
struct Header {
    sections: Vec<(String, Vec<(String, String)>)>,
    unread: Unread,
}

impl Header {
    fn section(&self, name: &str) -> Option<&[(String, String)]> {
        let (_, lines) = self.sections.iter().find(|(n, _)| n == name)?;
        Some(lines)
    }

    /// A value of what the user sees of the scan.
    fn info(&self, key: &str) -> Option<&str> {
        get(self.section("DataSet-Info")?, key)
    }

    /// The same as a number with a unit: lengths in nm, times in s.
    fn quantity(&self, key: &str) -> Option<(f64, String)> {
        self.unread.entry(key, self.info(key), quantity)
    }
}

fn get<'a>(lines: &'a [(String, String)], key: &str) -> Option<&'a str> {
    let (_, value) = lines.iter().find(|(k, _)| k.eq_ignore_ascii_case(key))?;
    Some(value)
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let end = memmem::find(bytes, DATA_MARK).ok_or_else(|| {
        damaged(format!(
            "expected the mark #! behind the header, found none in {} bytes: the file was cut \
                 off inside the header",
            bytes.len()
        ))
    })?;
    let header = header(&bytes[..end]);
    let names = listed(&header)?;
    let mut outline = Outline::of(frame(&header));
    let mut extent = Extent::default();
    let mut announced = 0;
    let mut start = end + DATA_MARK.len();
    for name in names {
        let Some(section) = header.section(&name) else {
            return Err(damaged(format!(
                "expected a section [{name}], found none: the place of the next images is unknown"
            )));
        };
        let block =
            block(section).map_err(|reason| damaged(format!("section [{name}]: {reason}")))?;
        let here = start;
        start = start.saturating_add(block.length);
        if !block.image {
            continue;
        }
        announced += 1;
        let info = info(section, &name);
        if !extent.take(input.length, here, block.length, &info.name) {
            continue;
        }
        match scaling(section, &block) {
            Ok(scaling) => {
                let samples = Flat {
                    check: unfilled(&block, section, outline.scan.frame_direction),
                    ..Flat::at(here, block.encoding, block.endian)
                };
                outline.add_flat(
                    channel(info, &block, section, scaling, &header.unread),
                    samples,
                );
            }
            Err(error) => outline.scan.unreadable.push(UnreadableChannel {
                name: info.name,
                error,
            }),
        }
    }
    if announced == 0 {
        return Err(ReadError::Unsupported {
            format: FORMAT,
            reason: "it holds no image (curves only)".to_owned(),
        });
    }
    let first = outline.channels.first();
    outline.scan.size_nm = first
        .and_then(|c| c.header.width_nm.zip(c.header.height_nm))
        .map(Into::into);
    outline.scan.notes = header.unread.notes();
    extent.judge(some_readable(outline, announced)?, input.length)
}

fn header(bytes: &[u8]) -> Header {
    let text = words::decode(bytes);
    let mut sections: Vec<(String, Vec<(String, String)>)> = Vec::new();
    for line in text.lines().map(str::trim) {
        let name = line.strip_prefix('[').and_then(|l| l.strip_suffix(']'));
        if let Some(name) = name {
            sections.push((name.to_owned(), Vec::new()));
        } else if let (Some((key, value)), Some((_, lines))) =
            (line.split_once('='), sections.last_mut())
            && !line.starts_with("--")
        {
            lines.push((key.trim().to_owned(), value.trim().to_owned()));
        }
    }
    Header {
        sections,
        unread: Unread::default(),
    }
}

/// Names of the sections of all blocks of data, in the order of the data.
fn listed(header: &Header) -> Result<Vec<String>, ReadError> {
    let lines = header
        .section("DataSet")
        .ok_or_else(|| damaged("expected a section [DataSet], found none"))?;
    let blocks: BTreeMap<(u32, u32), &String> = lines
        .iter()
        .filter_map(|(key, value)| {
            let (group, channel) = key.strip_prefix("Gr")?.split_once("-Ch")?;
            Some(((group.parse().ok()?, channel.parse().ok()?), value))
        })
        .collect();
    match blocks.len() {
        0 => Err(damaged("its section [DataSet] lists no data")),
        found if found > MOST_CHANNELS => Err(ReadError::TooManyChannels {
            found,
            limit: MOST_CHANNELS,
        }),
        _ => Ok(blocks.into_values().cloned().collect()),
    }
}

/// One block of data.
struct Block {
    rows: usize,
    columns: usize,
    encoding: Encoding,
    endian: Endian,
    length: usize,
    image: bool,
}

fn block(section: &[(String, String)]) -> Result<Block, String> {
    let count = |key: &str| {
        let text = get(section, key).unwrap_or("");
        let number = text.parse::<usize>().ok();
        number.ok_or_else(|| format!("expected a number {key}, found {text:?}"))
    };
    let (columns, rows) = (count("Points")?, count("Lines")?);
    let mode = get(section, "SaveMode").unwrap_or("Binary");
    if mode != "Binary" {
        return Err(format!("expected SaveMode Binary, found {mode:?}"));
    }
    let signed = match get(section, "SaveSign").unwrap_or("Signed") {
        "Signed" => true,
        "Unsigned" => false,
        other => {
            return Err(format!(
                "expected SaveSign Signed or Unsigned, found {other:?}"
            ));
        }
    };
    let endian = match get(section, "SaveOrder").unwrap_or("Intel") {
        "Intel" => Endian::Little,
        "Motorola" => Endian::Big,
        other => {
            return Err(format!(
                "expected SaveOrder Intel or Motorola, found {other:?}"
            ));
        }
    };
    let encoding = match (count("SaveBits")?, signed) {
        (8, true) => Encoding::I8,
        (8, false) => Encoding::U8,
        (16, true) => Encoding::I16,
        (16, false) => Encoding::U16,
        (32, true) => Encoding::I32,
        (32, false) => Encoding::U32,
        (bits, _) => return Err(format!("expected SaveBits 8, 16 or 32, found {bits}")),
    };
    let frame = get(section, "Frame").unwrap_or("").to_ascii_lowercase();
    let length = raster::byte_length(rows, columns, encoding);
    // A block of no lines takes no place; one too large to count takes all.
    let length = length.unwrap_or(if rows == 0 || columns == 0 {
        0
    } else {
        usize::MAX
    });
    let axis = |key: &str| get(section, key).and_then(nm_per).is_some();
    let curve = frame.contains("spec") || frame.contains("curve");
    Ok(Block {
        rows,
        columns,
        encoding,
        endian,
        length,
        image: length > 0 && !curve && axis("Dim0Unit") && axis("Dim1Unit"),
    })
}

fn info(section: &[(String, String)], name: &str) -> ChannelInfo {
    let frame = get(section, "Frame").unwrap_or("").to_ascii_lowercase();
    ChannelInfo {
        name: get(section, "Dim2Name").unwrap_or(name).to_owned(),
        internal_name: name.to_owned(),
        line_direction: if frame.contains("backward") {
            Some(LineDirection::Retrace)
        } else if frame.contains("forward") {
            Some(LineDirection::Trace)
        } else {
            None
        },
        scan_line: frame.starts_with("2nd").then(|| "2nd".to_owned()),
    }
}

/// How counts become values.
fn scaling(section: &[(String, String)], block: &Block) -> Result<Scaling, String> {
    let number = |key: &str| {
        let text = get(section, key).unwrap_or("");
        let number = text.parse::<f64>().ok().filter(|n| n.is_finite());
        number.ok_or_else(|| format!("expected a number {key}, found {text:?}"))
    };
    let (range, least) = (number("Dim2Range")?, number("Dim2Min")?);
    let counts = 2f64.powi(8 * block.encoding.width() as i32);
    let signed = matches!(block.encoding, Encoding::I8 | Encoding::I16 | Encoding::I32);
    let offset = if signed { least + range / 2.0 } else { least };
    let scale = range / counts;
    Ok(Scaling {
        scale,
        offset,
        words: format!("counts × {scale} + {offset}: the range of Dim2 over that of the counts"),
    })
}

fn channel(
    info: ChannelInfo,
    block: &Block,
    section: &[(String, String)],
    scaling: Scaling,
    unread: &Unread,
) -> ChannelHeader {
    let length = |axis: u8| {
        let key = format!("Dim{axis}Range");
        let range = unread.number(&key, get(section, &key))?;
        let nm = nm_per(get(section, &format!("Dim{axis}Unit"))?)?;
        Some((range * nm).abs()).filter(|&length| length > 0.0 && length.is_finite())
    };
    ChannelHeader {
        width_nm: length(0),
        height_nm: length(1),
        scaling: Some(scaling),
        ..ChannelHeader::new(info, block.rows, block.columns)
            .in_unit(get(section, "Dim2Unit").unwrap_or(""))
    }
}

/// Lines that an unfinished frame may never have filled.
fn unfilled(
    block: &Block,
    section: &[(String, String)],
    direction: Option<FrameDirection>,
) -> Check {
    let current = get(section, "CurLine").and_then(|line| line.parse::<usize>().ok());
    let Some(current) = current.filter(|&line| line.saturating_add(1) < block.rows) else {
        return Check::Nothing;
    };
    let left = block.rows - 1 - current;
    match direction {
        Some(FrameDirection::Up) => Check::unfilled(current + 1..block.rows),
        // Whether it counts lines or tells a place is not known.
        Some(FrameDirection::Down) => {
            Check::Unfilled(vec![0..left.max(current), 0..left.min(current)])
        }
        None => Check::Nothing,
    }
}

/// Everything about the frame but its channels.
fn frame(header: &Header) -> Scan {
    let length = |key: &str| header.quantity(key).filter(|(_, unit)| unit == "nm");
    let offset_nm = ["X-Pos", "Y-Pos"].map(|key| length(key).map_or(0.0, |(nm, _)| nm));
    let line_time = header
        .quantity("Time/Line")
        .filter(|(time, unit)| unit == "s" && *time > 0.0)
        .map(|(time, _)| time);
    let rotation = header.quantity("Rotation").map_or(0.0, |(angle, _)| angle);
    let software = header.info("Software ver.");
    Scan {
        format: match software {
            Some(version) => format!("{FORMAT} {version}"),
            None => FORMAT.to_owned(),
        },
        instrument: header.info("Head type").map(str::to_owned),
        acquired: date_time(header),
        frame_direction: header.unread.entry(
            "Scan direction",
            header.info("Scan direction"),
            FrameDirection::named,
        ),
        line_rate_hz: line_time.map(|time| 0.5 / time),
        line_times_s: line_time.map(|time| [time, time]),
        rotation_rad: rotation.to_radians(),
        offset_nm,
        metadata: header.section("DataSet-Info").unwrap_or_default().to_vec(),
        ..Scan::default()
    }
}

fn quantity(text: &str) -> Option<(f64, String)> {
    let (number, unit) = units::quantity(text)?;
    Some(match (nm_per(unit), unit) {
        (Some(nm), _) => (number * nm, "nm".to_owned()),
        (None, "ms") => (number * 1e-3, "s".to_owned()),
        (None, "min") => (number * 60.0, "s".to_owned()),
        (None, other) => (number, other.to_owned()),
    })
}

/// `01-03-2016`, day first, and `18:36:58`.
fn date_time(header: &Header) -> Option<DateTime> {
    let day = header.unread.entry("Date", header.info("Date"), |text| {
        let mut dmy = text.split('-').map(str::parse::<i64>);
        let mut number = || dmy.next()?.ok();
        Some([number()?, number()?, number()?])
    });
    let time = header
        .unread
        .entry("Time", header.info("Time"), clock::clock);
    let [day, month, year] = day?;
    clock::date([year, month, day], time?)
}

#[cfg(test)]
mod tests;
