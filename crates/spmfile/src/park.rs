//! Park Systems files (XE, NX; PSIA before), `.tiff`.
//!
//! A TIFF file whose visible picture is a rendering. The values are in a private tag, described by
//! another one: a fixed structure of little-endian numbers and UTF-16 texts.
//!
//! - Value = gain × (scale × sample + offset), in the unit of the header; a scale of 0 means 1.
//! - Samples are 16-bit or 32-bit integers or single-precision numbers, bottom line first.
//! - Lengths are in µm, the angle in degrees is that of the fast
//!   direction about the positive x-axis (declaration of the header in the manual).
//! - Where x and y are swapped the lines ran along y: rows are no lines then, and nothing is said
//!   about their times.
//! - Files of force curves hold the image on which the curves were placed; it is read.

use std::borrow::Cow;

use crate::clock;
use crate::cursor::{Cursor, Endian};
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding};
use crate::scan::{ChannelInfo, DateTime, FrameDirection, LineDirection, Scan};
use crate::signature::tiff_has;
use crate::stored::Flat;
use crate::tiff_tags::{Directory, directories};
use crate::whole::Extent;
use crate::words::{Unread, wide_field};

const FORMAT: &str = "Park";
const DATE: u16 = 306;
const MAGIC: u16 = 50432;
const VERSION: u16 = 50433;
const DATA: u16 = 50434;
const HEADER: u16 = 50435;
const COMMENT: u16 = 50436;
const MAGIC_NUMBER: f64 = 0x0e03_1301 as f64;
/// From this version on the header tells the kind of samples.
const VERSION_2: f64 = 0x0100_0002 as f64;
const NM_PER_MICROMETRE: f64 = 1e3;

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// A TIFF file with tags of the maker.
pub(crate) fn detect(bytes: &[u8]) -> bool {
    tiff_has(bytes, 50432, 50441)
}

/// The structure of the tag [`HEADER`].
struct Header {
    source: String,
    mode: String,
    columns: usize,
    rows: usize,
    angle_degrees: f64,
    overscan: f64,
    forward: bool,
    up: bool,
    swapped: bool,
    size_um: [f64; 2],
    offset_um: [f64; 2],
    rate_hz: f64,
    gain: f64,
    scale: f64,
    offset: f64,
    unit: String,
    encoding: Encoding,
}

/// Reads the image if it is wanted.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let pages = directories(bytes).map_err(damaged)?;
    let page = pages
        .iter()
        .find(|page| page.number(MAGIC) == Some(MAGIC_NUMBER))
        .ok_or_else(|| damaged("expected the mark of the maker in its tags, found another"))?;
    let header = page
        .raw(HEADER)
        .ok_or_else(|| damaged("expected its header among the tags of the file, found none"))?;
    let version = page.number(VERSION).unwrap_or(0.0);
    let header = parse(header, version)?;
    let info = ChannelInfo {
        name: header.source.clone(),
        internal_name: String::new(),
        line_direction: Some(if header.forward {
            LineDirection::Trace
        } else {
            LineDirection::Retrace
        }),
        scan_line: None,
    };
    let length =
        raster::byte_length(header.rows, header.columns, header.encoding).ok_or_else(|| {
            let (rows, columns) = (header.rows, header.columns);
            damaged(format!("its size is {rows} lines of {columns} samples"))
        })?;
    let mut outline = Outline::of(frame(&header, page));
    let mut extent = Extent::default();
    let data = page.raw(DATA).unwrap_or_default();
    if extent.take(data.len() as u64, 0, length, &info.name) {
        let block = Cow::Borrowed(&data[..length]);
        let samples = Flat::block(block, header.encoding, Endian::Little);
        let size = outline.scan.size_nm;
        outline.add_flat(channel(&header, info).of_size(size), samples);
    }
    extent.judge(outline, input.length)
}

fn parse(bytes: &[u8], version: f64) -> Result<Header, ReadError> {
    let mut cursor = Cursor::new(bytes, Endian::Little);
    let parsed = structure(&mut cursor, version);
    let (kind, header) = parsed.map_err(|reason| damaged(format!("its header: {reason}")))?;
    match kind {
        0 | 2 => header.map_err(damaged),
        1 => Err(ReadError::Unsupported {
            format: FORMAT,
            reason: "it holds a line profile and no image".to_owned(),
        }),
        other => Err(ReadError::Unsupported {
            format: FORMAT,
            reason: format!("expected an image (kind 0 or 2), found kind {other}"),
        }),
    }
}

/// Kind of the file and its header; the inner error is about values, the outer about length.
///
/// As long as the structure has fields, in their order.
fn structure(c: &mut Cursor<'_>, version: f64) -> Result<(u32, Result<Header, String>), String> {
    let kind = c.u32()?;
    let source = text(c, 32)?;
    let mode = text(c, 8)?;
    // Strength of the low-pass filter, flattening, tracking.
    c.skip(8 + 4 + 4)?;
    let (columns, rows) = (c.u32()? as usize, c.u32()? as usize);
    let angle_degrees = c.f64()?;
    c.skip(4)?;
    let overscan = c.f64()?;
    let (forward, up, swapped) = (c.u32()? != 0, c.u32()? != 0, c.u32()? != 0);
    let (size_um, offset_um) = ([c.f64()?, c.f64()?], [c.f64()?, c.f64()?]);
    let rate_hz = c.f64()?;
    // Setpoint and its unit, bias of tip and sample.
    c.skip(8 + 16 + 8 + 8)?;
    let (gain, scale, offset) = (c.f64()?, c.f64()?, c.f64()?);
    let unit = text(c, 8)?;
    // Least, greatest and mean count, compression.
    c.skip(4 * 3)?;
    let compressed = c.u32()?;
    let samples = if version >= VERSION_2 {
        // Logarithmic scale, square, servo gain, range of the scanner, three words on modes.
        c.skip(4 + 4 + 8 + 8 + 3 * 16)?;
        c.u32()?
    } else {
        0
    };
    let encoding = match samples {
        0 => Encoding::I16,
        1 => Encoding::I32,
        2 => Encoding::F32,
        other => {
            return Ok((
                kind,
                Err(format!("expected samples of kind 0, 1 or 2, found {other}")),
            ));
        }
    };
    if compressed != 0 {
        return Ok((
            kind,
            Err("its samples are compressed in an unknown way".to_owned()),
        ));
    }
    let finite = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite());
    if !finite(&[gain, scale, offset, gain * scale, gain * offset]) {
        return Ok((
            kind,
            Err(format!("expected a scale, found {gain}, {scale}, {offset}")),
        ));
    }
    let header = Header {
        source,
        mode,
        columns,
        rows,
        angle_degrees,
        overscan,
        forward,
        up,
        swapped,
        size_um,
        offset_um,
        rate_hz,
        gain,
        scale: if scale == 0.0 { 1.0 } else { scale },
        offset,
        unit: if unit.is_empty() {
            "um".to_owned()
        } else {
            unit
        },
        encoding,
    };
    Ok((kind, Ok(header)))
}

/// A text of fixed width in UTF-16.
fn text(cursor: &mut Cursor<'_>, units: usize) -> Result<String, String> {
    let bytes = cursor.slice(2 * units, "a text")?;
    Ok(wide_field(bytes))
}

fn channel(header: &Header, info: ChannelInfo) -> ChannelHeader {
    let words = format!(
        "gain {} × (scale {} × samples + offset {})",
        header.gain, header.scale, header.offset
    );
    let (scale, offset) = (header.gain * header.scale, header.gain * header.offset);
    ChannelHeader::new(info, header.rows, header.columns)
        .in_unit(&header.unit)
        .scaled(scale, offset, words)
}

fn frame(header: &Header, page: &Directory<'_>) -> Scan {
    let unread = Unread::default();
    let lines = !header.swapped;
    let nm = |lengths: [f64; 2]| lengths.map(|um| um * NM_PER_MICROMETRE);
    let mut metadata: Vec<(String, String)> = [
        ("Mode", header.mode.clone()),
        ("Overscan", header.overscan.to_string()),
        ("Comment", page.text(COMMENT).unwrap_or_default()),
    ]
    .into_iter()
    .filter(|(_, value)| !value.is_empty())
    .map(|(key, value)| (key.to_owned(), value))
    .collect();
    if header.swapped {
        let direction = "y: the lines of the scan are the columns of the image".to_owned();
        metadata.push(("Fast axis".to_owned(), direction));
    }
    let angle = Some(header.angle_degrees).filter(|angle| angle.is_finite());
    Scan {
        format: FORMAT.to_owned(),
        acquired: unread.entry("its date", page.text(DATE).as_deref(), date_time),
        frame_direction: lines.then_some(if header.up {
            FrameDirection::Up
        } else {
            FrameDirection::Down
        }),
        line_rate_hz: Some(header.rate_hz).filter(|&rate| lines && rate > 0.0 && rate.is_finite()),
        rotation_rad: angle.unwrap_or(0.0).to_radians(),
        offset_nm: Some(nm(header.offset_um))
            .filter(|offset| offset.iter().all(|x| x.is_finite()))
            .unwrap_or_default(),
        size_nm: Some(nm(header.size_um))
            .filter(|size| size.iter().all(|&x| x > 0.0 && x.is_finite())),
        metadata,
        notes: unread.notes(),
        ..Scan::default()
    }
}

/// `2021:09:16 13:17:54`, as in TIFF.
fn date_time(text: &str) -> Option<DateTime> {
    let (date, time) = text.split_once(' ')?;
    let mut ymd = date.split(':').map(str::parse::<i64>);
    let mut number = || ymd.next()?.ok();
    let ymd = [number()?, number()?, number()?];
    clock::date(ymd, clock::clock(time)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tiff_tags::tests::{Value, file};

    struct Made {
        kind: u32,
        columns: u32,
        flags: [u32; 3],
        scale: f64,
        samples: u32,
        version: u32,
        data: Vec<u8>,
    }

    impl Default for Made {
        fn default() -> Self {
            Self {
                kind: 0,
                columns: 3,
                flags: [1, 0, 0],
                scale: 2.0,
                samples: 2,
                version: 0x0100_0002,
                data: (0..6u8).flat_map(|n| f32::from(n).to_le_bytes()).collect(),
            }
        }
    }

    fn made(m: &Made) -> Vec<u8> {
        let wide = |text: &str, units: usize| {
            let mut bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
            bytes.resize(2 * units, 0);
            bytes
        };
        let mut h = m.kind.to_le_bytes().to_vec();
        h.extend(wide("Topography", 32));
        h.extend(wide("NCM", 8));
        h.extend([0; 16]);
        h.extend(m.columns.to_le_bytes());
        h.extend(2u32.to_le_bytes());
        h.extend(135f64.to_le_bytes());
        h.extend([0; 4]);
        h.extend(0.1f64.to_le_bytes());
        h.extend(m.flags.iter().flat_map(|flag| flag.to_le_bytes()));
        for number in [3.0, 2.0, -1.0, 0.5, 1.25] {
            h.extend(f64::to_le_bytes(number));
        }
        h.extend([0; 8 + 16 + 16]);
        for number in [10.0, m.scale, 1.0] {
            h.extend(f64::to_le_bytes(number));
        }
        h.extend(wide("um", 8));
        h.extend([0; 16]);
        h.extend([0; 8 + 16 + 48]);
        h.extend(m.samples.to_le_bytes());
        h.extend([0; 100]);
        let tags = vec![
            (DATE, Value::Text("2021:09:16 13:17:54")),
            (MAGIC, Value::Long(vec![0x0e03_1301])),
            (VERSION, Value::Long(vec![m.version])),
            (DATA, Value::Bytes(m.data.clone())),
            (HEADER, Value::Bytes(h)),
        ];
        file(Endian::Little, &[(tags, vec![])])
    }

    #[test]
    fn values_and_frame() {
        let scan = crate::read(&made(&Made::default())).expect("whole");
        let channel = &scan.channels[0];
        assert_eq!(channel.values(), [10.0, 30.0, 50.0, 70.0, 90.0, 110.0]);
        assert_eq!(
            (channel.name.as_str(), channel.unit.as_str()),
            ("Topography", "um")
        );
        assert_eq!(channel.line_direction, Some(LineDirection::Trace));
        assert_eq!(scan.frame_direction, Some(FrameDirection::Down));
        assert_eq!(scan.size_nm, Some([3000.0, 2000.0]));
        assert_eq!(scan.offset_nm, [-1000.0, 500.0]);
        assert_eq!(scan.line_rate_hz, Some(1.25));
        assert!((scan.rotation_rad - 135f64.to_radians()).abs() < 1e-12);
        assert_eq!(scan.acquired, clock::date([2021, 9, 16], [13, 17, 54]));
    }

    #[test]
    fn samples_of_every_kind() {
        let values = |samples: u32, version: u32, data: Vec<u8>| {
            let m = Made {
                samples,
                version,
                data,
                scale: 0.0,
                ..Made::default()
            };
            crate::read(&made(&m)).expect("whole").channels[0].values()
        };
        let expected = [-10.0, 0.0, 10.0, 20.0, 30.0, 40.0];
        let counts = || -2..4i16;
        let long: Vec<u8> = counts().flat_map(|n| i32::from(n).to_le_bytes()).collect();
        let short: Vec<u8> = counts().flat_map(i16::to_le_bytes).collect();
        assert_eq!(values(1, 0x0100_0002, long), expected);
        assert_eq!(values(0, 0x0100_0002, short.clone()), expected);
        // The first version knows no other samples.
        assert_eq!(values(2, 0x0100_0001, short), expected);
    }

    #[test]
    fn swapped_axes_leave_the_times_open() {
        let m = Made {
            flags: [0, 1, 1],
            ..Made::default()
        };
        let scan = crate::read(&made(&m)).expect("whole");
        assert_eq!(scan.frame_direction, None);
        assert_eq!(scan.line_rate_hz, None);
        assert_eq!(
            scan.channels[0].line_direction,
            Some(LineDirection::Retrace)
        );
    }

    #[test]
    fn what_is_missing_is_said() {
        let error = |m: &Made| crate::read(&made(m)).expect_err("damaged").to_string();
        assert!(
            error(&Made {
                kind: 1,
                ..Made::default()
            })
            .contains("profile")
        );
        assert!(
            error(&Made {
                samples: 7,
                ..Made::default()
            })
            .contains('7')
        );
        assert!(
            error(&Made {
                columns: 0,
                ..Made::default()
            })
            .contains("0 samples")
        );
        let long = error(&Made {
            columns: u32::MAX,
            ..Made::default()
        });
        assert!(long.contains("24 bytes long"), "{long}");
    }
}
