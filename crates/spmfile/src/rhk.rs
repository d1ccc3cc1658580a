//! RHK files of version 5, `.sm4`.
//!
//! Objects (kind, place, length) lead from the file's header to the index of pages, from there to
//! the header and the samples of each page, from the page's header to its texts. All little endian,
//! texts in UTF-16. Pages with images are read, curves left out.
//!
//! - Sample *i* of a line lies at offset + *i* × step: a negative step in x means that lines are
//!   stored from right to left. The sign is the same for both directions of the tip, whose lines
//!   are stored in the same order.
//! - Lines are stored in order of time: a positive step in y is a frame upwards.
//! - Value = count × z scale + z offset; lengths are in the unit of the page, mostly m.
//! - The period is the time per sample. The angle is in degrees, taken as counter-clockwise.
//! - The offset is the centre of the frame (manual of the R9 controller).
//! - Lines beyond the count of completed ones are missing.
//!
//! Kinds of objects: Gwyddion's `rhk-sm4.c` and spym's `_sm4.py`.

use crate::clock;
use crate::cursor::{Cursor, Endian};
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::judge::Check;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding, Order};
use crate::scan::{ChannelInfo, FrameDirection, LineDirection, Scan};
use crate::stored::Flat;
use crate::units::nm_per;
use crate::whole::{Extent, MOST_CHANNELS};
use crate::words::{Unread, wide_field};

const FORMAT: &str = "RHK";
/// Kinds of objects.
const PAGE_INDEX_HEADER: u32 = 1;
const PAGE_INDEX: u32 = 2;
const PAGE_HEADER: u32 = 3;
const PAGE_DATA: u32 = 4;
const TEXTS: u32 = 10;
/// Kind of a page.
const IMAGE: u32 = 0;
/// An object is three numbers, unless the file says more.
const OBJECT_WIDTH: usize = 12;
/// Places of the texts of a page.
const LABEL: usize = 0;
const DATE: usize = 5;
const TIME: usize = 6;
const X_UNIT: usize = 7;
const Z_UNIT: usize = 9;
const COMPLETED_LINES: usize = 13;
/// Texts that are kept, with names.
const TOLD: [(usize, &str); 5] = [
    (1, "System text"),
    (2, "Session text"),
    (3, "User text"),
    (4, "Path"),
    (12, "Status"),
];
/// More texts than any version has.
const MOST_TEXTS: usize = 64;

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// The text stands behind a length, in UTF-16 since version 4.
pub(crate) fn detect(bytes: &[u8]) -> bool {
    let mark = b"STiMage";
    let wide: Vec<u8> = mark.iter().flat_map(|&b| [b, 0]).collect();
    bytes.starts_with(mark) || bytes[2.min(bytes.len())..].starts_with(&wide)
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let version = version(bytes).map_err(damaged)?;
    if !version.starts_with("005.") {
        return Err(ReadError::Unsupported {
            format: FORMAT,
            reason: format!("expected version 005 (.sm4), found {version:?}"),
        });
    }
    let objects = pages(bytes).map_err(damaged)?;
    let mut outline = Outline::of(Scan {
        format: format!("{FORMAT} {version}"),
        ..Scan::default()
    });
    let mut extent = Extent::default();
    let mut headers = Vec::new();
    for objects in &objects {
        let page = page(bytes, objects).map_err(damaged)?;
        let length =
            raster::byte_length(page.rows, page.columns, Encoding::I32).ok_or_else(|| {
                let (rows, columns) = (page.rows, page.columns);
                damaged(format!(
                    "the size of a page is {rows} lines of {columns} samples"
                ))
            })?;
        let data = find(objects, PAGE_DATA)
            .ok_or_else(|| damaged("expected the samples of a page, found none"))?;
        let info = page.info();
        if extent.take(input.length, data.place, length, &info.name) {
            outline.add_flat(page.header(info), page.samples(data.place));
        }
        headers.push(page);
    }
    let Some(first) = headers.first() else {
        return Err(ReadError::Unsupported {
            format: FORMAT,
            reason: "it holds no image (curves only)".to_owned(),
        });
    };
    tell(&mut outline.scan, first, &headers);
    extent.judge(outline, input.length)
}

/// `005.004` of the mark `STiMage 005.004 1`.
fn version(bytes: &[u8]) -> Result<String, String> {
    let mut cursor = Cursor::new(bytes, Endian::Little);
    // Before version 4 the mark stood at the first byte, in Latin-1.
    if bytes.starts_with(b"STiMage") {
        let mark = cursor.text(32.min(bytes.len()), "a mark")?;
        return Ok(mark.split_whitespace().nth(1).unwrap_or("").to_owned());
    }
    cursor.skip(2)?;
    let mark = wide_field(cursor.slice(36, "a mark")?);
    Ok(mark.split_whitespace().nth(1).unwrap_or("").to_owned())
}

/// A part of the file.
#[derive(Clone, Copy, Debug)]
struct Object {
    kind: u32,
    place: usize,
    length: usize,
}

fn find(objects: &[Object], kind: u32) -> Option<Object> {
    objects
        .iter()
        .find(|o| o.kind == kind && o.length > 0)
        .copied()
}

/// A list of objects; the position moves behind it.
fn objects(cursor: &mut Cursor<'_>, count: u32, width: usize) -> Result<Vec<Object>, String> {
    if count as usize > cursor.left() / width {
        return Err(format!(
            "expected {count} objects at byte {}, found the end of the file",
            cursor.position()
        ));
    }
    let mut objects = Vec::new();
    for _ in 0..count {
        objects.push(Object {
            kind: cursor.u32()?,
            place: cursor.u32()? as usize,
            length: cursor.u32()? as usize,
        });
        cursor.skip(width - OBJECT_WIDTH)?;
    }
    Ok(objects)
}

/// The objects of every page that holds an image.
fn pages(bytes: &[u8]) -> Result<Vec<Vec<Object>>, String> {
    let file = Cursor::new(bytes, Endian::Little);
    let header = usize::from(file.clone().u16()?);
    let mut cursor = file.at(38);
    let (_pages, count, width) = (cursor.u32()?, cursor.u32()?, cursor.u32()? as usize);
    let width = width.max(OBJECT_WIDTH);
    let expected = |what: &str| format!("expected {what}, found none");
    let top = objects(&mut file.at(2 + header), count, width)?;
    let index = find(&top, PAGE_INDEX_HEADER).ok_or_else(|| expected("an index of pages"))?;
    let mut cursor = file.at(index.place);
    let (pages, count) = (cursor.u32()?, cursor.u32()?);
    cursor.skip(8)?;
    let list = objects(&mut cursor, count, width)?;
    let list = find(&list, PAGE_INDEX).ok_or_else(|| expected("a list of pages"))?;
    let mut cursor = file.at(list.place);
    let mut images = Vec::new();
    for _ in 0..pages {
        cursor.skip(16)?;
        let (kind, _source, count) = (cursor.u32()?, cursor.u32()?, cursor.u32()?);
        cursor.skip(4)?;
        let objects = objects(&mut cursor, count, width)?;
        if kind == IMAGE {
            images.push(objects);
        }
        if images.len() > MOST_CHANNELS {
            return Err(format!("it announces more than {MOST_CHANNELS} images"));
        }
    }
    Ok(images)
}

/// The header of a page.
struct Page {
    columns: usize,
    rows: usize,
    direction: u32,
    x_step: f64,
    y_step: f64,
    z_scale: f64,
    x_offset: f64,
    y_offset: f64,
    z_offset: f64,
    period: f64,
    bias: f64,
    current: f64,
    angle_degrees: f64,
    texts: Vec<String>,
}

fn page(bytes: &[u8], of_page: &[Object]) -> Result<Page, String> {
    let header = find(of_page, PAGE_HEADER).ok_or("expected the header of a page, found none")?;
    let mut c = Cursor::new(bytes, Endian::Little).at(header.place);
    c.skip(2)?;
    let number_of_texts = usize::from(c.u16()?).min(MOST_TEXTS);
    // Kinds of page, source and line; corner.
    c.skip(4 * 3 + 4 * 2)?;
    let (columns, rows) = (c.u32()? as usize, c.u32()? as usize);
    c.skip(4)?;
    let direction = c.u32()?;
    // Group, length of the samples, least and greatest count.
    c.skip(4 * 4)?;
    let mut number = || c.f32().map(f64::from);
    let (x_step, y_step, z_scale, _xy_scale) = (number()?, number()?, number()?, number()?);
    let (x_offset, y_offset, z_offset) = (number()?, number()?, number()?);
    let (period, bias, current, angle_degrees) = (number()?, number()?, number()?, number()?);
    // Colours, grid of curves.
    c.skip(4 * 3)?;
    let count = c.u32()?;
    c.skip(64)?;
    let objects = objects(&mut c, count, OBJECT_WIDTH)?;
    if ![z_scale, z_offset].iter().all(|n| n.is_finite()) {
        return Err(format!(
            "expected the scale of a page, found {z_scale}, {z_offset}"
        ));
    }
    let texts = find(&objects, TEXTS)
        .map(|object| texts(bytes, object, number_of_texts))
        .unwrap_or_default();
    Ok(Page {
        columns,
        rows,
        direction,
        x_step,
        y_step,
        z_scale,
        x_offset,
        y_offset,
        z_offset,
        period,
        bias,
        current,
        angle_degrees,
        texts,
    })
}

/// Texts, each behind its length; as many as there are.
fn texts(bytes: &[u8], object: Object, number: usize) -> Vec<String> {
    let end = object.place.saturating_add(object.length).min(bytes.len());
    let mut cursor = Cursor::new(&bytes[..end], Endian::Little).at(object.place);
    let mut next = || {
        let length = usize::from(cursor.u16().ok()?);
        cursor.slice(2 * length, "a text").ok().map(wide_field)
    };
    (0..number).map_while(|_| next()).collect()
}

impl Page {
    fn text(&self, index: usize) -> &str {
        self.texts.get(index).map_or("", String::as_str)
    }

    fn info(&self) -> ChannelInfo {
        let label = self.text(LABEL);
        ChannelInfo {
            name: if label.is_empty() { "image" } else { label }.to_owned(),
            internal_name: String::new(),
            line_direction: match self.direction {
                0 => Some(LineDirection::Trace),
                1 => Some(LineDirection::Retrace),
                _ => None,
            },
            scan_line: None,
        }
    }

    /// Width and height, nm.
    fn size_nm(&self) -> Option<[f64; 2]> {
        let unit = nm_per(self.text(X_UNIT))?;
        let width = self.columns as f64 * self.x_step.abs() * unit;
        let height = self.rows as f64 * self.y_step.abs() * unit;
        let positive = |length: f64| length > 0.0 && length.is_finite();
        (positive(width) && positive(height)).then_some([width, height])
    }

    fn header(&self, info: ChannelInfo) -> ChannelHeader {
        let words = format!("counts × {} + {}", self.z_scale, self.z_offset);
        ChannelHeader::new(info, self.rows, self.columns)
            .in_unit(self.text(Z_UNIT))
            .of_size(self.size_nm())
            .scaled(self.z_scale, self.z_offset, words)
    }

    fn samples(&self, place: usize) -> Flat<'static> {
        let order = Order {
            top_first: self.y_step < 0.0,
            mirrored: self.x_step < 0.0,
        };
        // Files of old or foreign programs count no lines.
        let completed = self.text(COMPLETED_LINES).parse::<usize>();
        let completed = completed.ok().filter(|&n| n > 0 && n < self.rows);
        let check = match completed {
            Some(n) if order.top_first => Check::unfilled(0..self.rows - n),
            Some(n) => Check::unfilled(n..self.rows),
            None => Check::Nothing,
        };
        Flat {
            check,
            ..Flat::at(place, Encoding::I32, Endian::Little).in_order(order)
        }
    }

    /// Time of a line in one direction, s.
    fn line_time(&self) -> Option<f64> {
        let time = self.period * self.columns as f64;
        (time > 0.0 && time.is_finite()).then_some(time)
    }
}

/// What the headers of the pages say of the frame; where they contradict each other, nothing.
fn tell(scan: &mut Scan, first: &Page, pages: &[Page]) {
    let direction = |page: &Page| match page.y_step {
        step if step > 0.0 => Some(FrameDirection::Up),
        step if step < 0.0 => Some(FrameDirection::Down),
        _ => None,
    };
    let told = direction(first);
    if pages.iter().all(|page| direction(page) == told) {
        scan.frame_direction = told;
    }
    // The same time for all lines of a direction.
    let time = |of: u32| {
        let mut times = pages
            .iter()
            .filter(|p| p.direction == of)
            .map(Page::line_time);
        let first = times.next()??;
        times.all(|time| time == Some(first)).then_some(first)
    };
    if let (Some(forward), Some(backward)) = (time(0), time(1)) {
        scan.line_times_s = Some([forward, backward]);
        scan.line_rate_hz = Some(1.0 / (forward + backward));
    }
    if first.angle_degrees.is_finite() {
        scan.rotation_rad = first.angle_degrees.to_radians();
    }
    let unit = nm_per(first.text(X_UNIT));
    let offset = unit.map(|unit| [first.x_offset * unit, first.y_offset * unit]);
    scan.offset_nm = offset
        .filter(|offset| offset.iter().all(|x| x.is_finite()))
        .unwrap_or_default();
    scan.size_nm = first.size_nm();
    let unread = Unread::default();
    let date = unread.entry("Date", Some(first.text(DATE)), calendar_day);
    let time = unread.entry("Time", Some(first.text(TIME)), clock::clock);
    scan.acquired = date
        .zip(time)
        .and_then(|(date, time)| clock::date(date, time));
    scan.notes = unread.notes();
    scan.metadata = [("Bias (V)", first.bias), ("Current (A)", first.current)]
        .map(|(name, value)| (name.to_owned(), value.to_string()))
        .into_iter()
        .chain(TOLD.iter().filter_map(|&(index, name)| {
            let text = first.text(index);
            (!text.is_empty()).then(|| (name.to_owned(), text.to_owned()))
        }))
        .collect();
}

/// Year, month and day of `07/02/20`, month first.
fn calendar_day(date: &str) -> Option<[i64; 3]> {
    let mut mdy = date.split('/').map(str::parse::<i64>);
    let mut number = || mdy.next()?.ok();
    let (month, day, year) = (number()?, number()?, number()?);
    // The format is younger than 2000.
    let year = if year < 100 { year + 2000 } else { year };
    Some([year, month, day])
}

#[cfg(test)]
mod tests;
