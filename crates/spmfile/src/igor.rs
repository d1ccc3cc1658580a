//! Igor binary waves (`WaveMetrics`), `.ibw`, as written by Asylum instruments among others.
//!
//! Versions 1 to 3 hold one-dimensional waves and are refused with that reason; version 5 holds up
//! to four dimensions: x, y and channel. The byte order is that of the machine which wrote the
//! file. All 16-bit words of the headers add up to zero (`WaveMetrics`, Technical Note 003).
//!
//! - x runs fastest; y = 0 is the bottom line. Retrace lines are in order of position.
//! - The note of Asylum's software is a list of `key: value`: `FastScanSize`, `SlowScanSize` (m) are
//!   the distances of the outermost pixel centres (the step of the wave is size/(N − 1));
//!   `ScanRate` is in lines per second, trace and retrace together; `ScanDown` 1 (its lowest bit)
//!   means that the top line came first; `XOffset`, `YOffset` are the centre.
//! - `ScanAngle` turns the frame clockwise, in degrees: the scan procedure of the software moves
//!   to `x = f cos α + s sin α`, `y = −f sin α + s cos α` (f fast, s slow).
//! - The same procedure samples `N` of 2.5 `N` equal steps of a line in each direction: the motion
//!   exceeds the frame by a quarter ([`Scan::rounding`] is 0.25).

use crate::clock;
use crate::cursor::{Cursor, Endian};
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding, Order};
use crate::scan::{ChannelInfo, DateTime, FrameDirection, LineDirection, Scan, Span};
use crate::stored::Flat;
use crate::units::{self, quantity};
use crate::whole::{Extent, MOST_CHANNELS};
use crate::words::{self, Unread};

const FORMAT: &str = "Igor binary wave";
/// Length of both headers of a version 5 file.
const HEADERS: usize = 64 + 320;
/// Width of a dimension label.
const LABEL: usize = 32;
/// Overscan of Asylum's scan procedure.
const ROUNDING: f64 = 0.25;

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

fn unsupported(reason: impl Into<String>) -> ReadError {
    ReadError::unsupported(FORMAT, reason)
}

/// An Igor binary wave has no signature: a version, and a kind of number that exists.
pub(crate) fn detect(head: &[u8]) -> bool {
    let little = matches!(head, [1..=3 | 5, 0, ..]);
    let big = matches!(head, [0, 1..=3 | 5, ..]);
    if !little && !big {
        return false;
    }
    let endian = if little { Endian::Little } else { Endian::Big };
    let cursor = Cursor::new(head, endian);
    // The place of the wave's type in its header.
    let place = match cursor.clone().u16() {
        Ok(1) => 8,
        Ok(2) => 16,
        Ok(3) => 20,
        _ => 80,
    };
    // Waves of elder versions are not read: those that are whole are named, others may be anything.
    if place != 80 && check_sum(head, place + 126, endian).is_err() {
        return false;
    }
    let kind = cursor.at(place).u16();
    // Bits: complex 1, float 2, double 4, 8-, 16-, 32-bit integer 8, 16, 32, unsigned 64; 0 is text.
    kind.is_ok_and(|kind| kind == 0 || matches!(kind & !0x41, 2 | 4 | 8 | 16 | 32 | 128))
}

/// What the headers of a version 5 file say.
struct Wave {
    endian: Endian,
    kind: u16,
    name: String,
    /// Numbers of items along x, y, channel and one more dimension.
    size: [usize; 4],
    /// Steps along the dimensions.
    step: [f64; 4],
    unit: String,
    /// Unit along x.
    step_unit: String,
    /// Lengths of the blocks behind the samples: formula, note, units, dimension units.
    formula: usize,
    note: usize,
    units: usize,
    dimension_units: usize,
    labels: [usize; 4],
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let wave = wave(bytes)?;
    let [columns, rows, layers, _] = wave.size;
    let layers = layers.max(1);
    let encoding = encoding(wave.kind)?;
    let length = raster::byte_length(rows, columns, encoding)
        .ok_or_else(|| damaged(format!("its size is {rows} lines of {columns} samples")))?;
    let tail = tail(bytes, &wave, length.saturating_mul(layers));
    if !tail.line_labels.is_empty() {
        return Err(unsupported(format!(
            "its second dimension is named ({}): these are curves, no image",
            tail.line_labels.join(", ")
        )));
    }
    let note = Note {
        lines: &tail.note,
        unread: Unread::default(),
    };
    let mut outline = Outline::of(frame(&note));
    let [width_nm, height_nm] = extent_nm(&wave, &note);
    outline.scan.notes = note.unread.notes();
    outline.scan.size_nm = width_nm
        .zip(height_nm)
        .map(|(width, height)| [width, height]);
    let order = Order {
        top_first: wave.step[1] < 0.0,
        mirrored: wave.step[0] < 0.0,
    };
    let mut extent = Extent::default();
    for layer in 0..layers {
        let label = tail.labels.get(layer).cloned().unwrap_or_default();
        let info = ChannelInfo {
            line_direction: line_direction(&label),
            name: label,
            internal_name: if layers == 1 {
                wave.name.clone()
            } else {
                String::new()
            },
            scan_line: None,
        };
        let place = layer.saturating_mul(length).saturating_add(HEADERS);
        if !extent.take(input.length, place, length, &info.name) {
            continue;
        }
        let header = ChannelHeader {
            width_nm,
            height_nm,
            span: Span::PixelCentres,
            plane_fit: note
                .get(&format!("Planefit {layer}"))
                .filter(|fit| !fit.eq_ignore_ascii_case("none"))
                .map(str::to_owned),
            ..ChannelHeader::new(info.clone(), rows, columns)
                .in_unit(&unit(&wave, &info.name, layers))
        };
        let samples = Flat::at(place, encoding, wave.endian).in_order(order);
        outline.add_flat(header, samples);
    }
    extent.judge(outline, input.length)
}

/// The headers of an image.
fn wave(bytes: &[u8]) -> Result<Wave, ReadError> {
    let endian = if bytes.first() == Some(&0) {
        Endian::Big
    } else {
        Endian::Little
    };
    let version = Cursor::new(bytes, endian).u16().map_err(damaged)?;
    if version != 5 {
        return Err(refuse_one_dimension(bytes, endian, version));
    }
    check_sum(bytes, HEADERS, endian)?;
    let wave = headers(bytes, endian).map_err(damaged)?;
    let [columns, rows, layers, more] = wave.size;
    if rows == 0 {
        return Err(unsupported(format!(
            "it holds a one-dimensional wave of {columns} points, no image"
        )));
    }
    if more > 1 {
        return Err(unsupported("it holds a wave of four dimensions, no image"));
    }
    if layers > MOST_CHANNELS {
        return Err(ReadError::TooManyChannels {
            found: layers,
            limit: MOST_CHANNELS,
        });
    }
    Ok(wave)
}

/// The reason why a file of an elder version is not read.
fn refuse_one_dimension(bytes: &[u8], endian: Endian, version: u16) -> ReadError {
    let start = match version {
        1 => 8,
        2 => 16,
        3 => 20,
        other => return unsupported(format!("expected version 5, found version {other}")),
    };
    // The sum takes in the first sixteen bytes of the data, which count as header in these versions.
    if let Err(error) = check_sum(bytes, start + 126, endian) {
        return error;
    }
    match Cursor::new(bytes, endian).at(start + 42).i32() {
        Ok(points) => unsupported(format!(
            "it holds a one-dimensional wave of {points} points (version {version}), no image"
        )),
        Err(reason) => damaged(reason),
    }
}

fn check_sum(bytes: &[u8], length: usize, endian: Endian) -> Result<(), ReadError> {
    let mut cursor = Cursor::new(bytes, endian);
    let mut sum = 0u16;
    for _ in 0..length / 2 {
        sum = sum.wrapping_add(cursor.u16().map_err(damaged)?);
    }
    if sum == 0 {
        Ok(())
    } else {
        Err(damaged(format!(
            "the words of its header add up to {sum} instead of 0"
        )))
    }
}

fn headers(bytes: &[u8], endian: Endian) -> Result<Wave, String> {
    let mut cursor = Cursor::new(bytes, endian).at(8);
    let mut length = || -> Result<usize, String> { Ok(cursor.u32()? as usize) };
    let (formula, note, units) = (length()?, length()?, length()?);
    let dimension_units = (0..4).try_fold(0usize, |sum, _| Ok::<_, String>(sum + length()?))?;
    let mut labels = [0; 4];
    for label in &mut labels {
        *label = length()?;
    }
    let mut cursor = cursor.at(64 + 16);
    let kind = cursor.u16()?;
    cursor.skip(10)?;
    let name = cursor.text(32, "a name")?;
    cursor.skip(8)?;
    let mut size = [0; 4];
    for items in &mut size {
        *items = cursor.u32()? as usize;
    }
    let mut step = [0.0; 4];
    for value in &mut step {
        *value = cursor.f64()?;
    }
    cursor.skip(4 * 8)?;
    Ok(Wave {
        endian,
        kind,
        name,
        size,
        step,
        unit: cursor.text(4, "a unit")?,
        step_unit: cursor.text(4, "a unit")?,
        formula,
        note,
        units,
        dimension_units,
        labels,
    })
}

fn encoding(kind: u16) -> Result<Encoding, ReadError> {
    Ok(match kind {
        0x02 => Encoding::F32,
        0x04 => Encoding::F64,
        0x08 => Encoding::I8,
        0x10 => Encoding::I16,
        0x20 => Encoding::I32,
        0x48 => Encoding::U8,
        0x50 => Encoding::U16,
        0x60 => Encoding::U32,
        0x80 => Encoding::I64,
        0xc0 => Encoding::U64,
        0 => return Err(unsupported("it holds texts, no numbers")),
        other if other & 1 == 1 => return Err(unsupported("it holds complex numbers")),
        other => return Err(damaged(format!("its kind of number is {other:#x}"))),
    })
}

/// What stands behind the samples; absent parts are empty.
struct Tail {
    note: Vec<(String, String)>,
    /// Names of the second dimension's items.
    line_labels: Vec<String>,
    /// Names of the layers.
    labels: Vec<String>,
}

fn tail(bytes: &[u8], wave: &Wave, data: usize) -> Tail {
    let blocks = || -> Result<(&[u8], [Vec<String>; 2]), String> {
        let start = HEADERS
            .checked_add(data)
            .and_then(|n| n.checked_add(wave.formula));
        let mut cursor = Cursor::new(bytes, wave.endian).at(start.ok_or("too long")?);
        let note = cursor.slice(wave.note, "a note")?;
        cursor.skip(wave.units)?;
        cursor.skip(wave.dimension_units)?;
        cursor.skip(wave.labels[0])?;
        let lines = labels(cursor.slice(wave.labels[1], "labels")?);
        let layers = labels(cursor.slice(wave.labels[2], "labels")?);
        Ok((note, [lines, layers]))
    };
    let (note, [line_labels, labels]) = blocks().unwrap_or_default();
    let text = words::decode(note);
    let note = text
        .split(['\r', '\n'])
        .filter_map(|line| line.split_once(':'))
        .map(|(key, value)| (key.trim().to_owned(), value.trim().to_owned()))
        .collect();
    Tail {
        note,
        line_labels,
        labels,
    }
}

/// The labels of a dimension's items; the first one stored is that of the dimension itself.
fn labels(block: &[u8]) -> Vec<String> {
    let mut labels: Vec<String> = block
        .chunks_exact(LABEL)
        .skip(1)
        .map(words::field)
        .collect();
    if labels.iter().all(String::is_empty) {
        labels.clear();
    }
    labels
}

/// `HeightRetrace` is of the retrace, `HeightTrace` and `HeightTrace2` of the trace.
fn line_direction(label: &str) -> Option<LineDirection> {
    let plain = label
        .trim_end_matches(|c: char| c.is_ascii_digit())
        .to_ascii_lowercase();
    if plain.ends_with("retrace") {
        Some(LineDirection::Retrace)
    } else if plain.ends_with("trace") {
        Some(LineDirection::Trace)
    } else {
        None
    }
}

/// The unit of a layer. A wave has one unit only; where several quantities share it, the name of
/// Asylum's channel tells.
fn unit(wave: &Wave, label: &str, layers: usize) -> String {
    const UNITS: [(&str, &str); 14] = [
        ("Height", "m"),
        ("ZSensor", "m"),
        ("XSensor", "m"),
        ("YSensor", "m"),
        ("Amplitude", "m"),
        ("Deflection", "m"),
        ("Raw", "m"),
        ("Phase", "deg"),
        ("Lateral", "V"),
        ("UserIn", "V"),
        ("Potential", "V"),
        ("Current", "A"),
        ("Frequency", "Hz"),
        ("Capacitance", "F"),
    ];
    let known = UNITS.iter().find(|(name, _)| label.starts_with(name));
    match known {
        Some((_, unit)) if line_direction(label).is_some() => (*unit).to_owned(),
        _ if layers == 1 => wave.unit.clone(),
        _ => String::new(),
    }
}

/// Keys and values of the note; a value changed during the scan stands there again, with `@Line`.
struct Note<'a> {
    lines: &'a [(String, String)],
    unread: Unread,
}

impl Note<'_> {
    fn get(&self, key: &str) -> Option<&str> {
        let (_, value) = self.lines.iter().find(|(k, _)| k == key)?;
        Some(value)
    }

    fn number(&self, key: &str) -> Option<f64> {
        let number = |text| quantity(text).map(|(number, _)| number);
        self.unread.entry(key, self.get(key), number)
    }

    /// A number that did not change during the scan.
    fn constant(&self, key: &str) -> Option<f64> {
        let first = self.number(key)?;
        let mut all = self.lines.iter().filter(|(k, _)| k == key);
        let same = |value: &str| {
            quantity(value).is_some_and(|(n, _)| (n - first).abs() <= 1e-3 * first.abs())
        };
        all.all(|(_, value)| same(value)).then_some(first)
    }
}

/// Distances of the outermost pixel centres. The note is believed where its numbers of points are
/// the wave's; otherwise the wave's steps tell.
fn extent_nm(wave: &Wave, note: &Note<'_>) -> [Option<f64>; 2] {
    let axis = |index: usize, size: &str, points: &str| {
        let count = wave.size[index] as f64;
        let noted = note
            .number(size)
            .or_else(|| note.number("ScanSize"))
            .filter(|_| note.number(points).is_none_or(|n| n == count))
            .map(|metres| metres * 1e9);
        let stepped = || {
            let per_unit = units::nm_per(&wave.step_unit)?;
            Some(wave.step[index].abs() * (count - 1.0) * per_unit)
        };
        noted.or_else(stepped).filter(|&n| n > 0.0 && n.is_finite())
    };
    [
        axis(0, "FastScanSize", "ScanPoints"),
        axis(1, "SlowScanSize", "ScanLines"),
    ]
}

/// Everything about the frame but its channels and size.
fn frame(note: &Note<'_>) -> Scan {
    let clockwise = note.constant("ScanAngle").unwrap_or(0.0);
    let line_rate_hz = note.constant("ScanRate").filter(|&rate| rate > 0.0);
    let mode = note.get("ScanMode").unwrap_or("").to_ascii_lowercase();
    Scan {
        format: match note.get("Version") {
            Some(version) => format!("{FORMAT}, Asylum {version}"),
            None => FORMAT.to_owned(),
        },
        instrument: note.get("MicroscopeModel").map(str::to_owned),
        acquired: acquired(note),
        frame_direction: note.number("ScanDown").map(|down| {
            if down as i64 & 1 == 1 {
                FrameDirection::Down
            } else {
                FrameDirection::Up
            }
        }),
        rounding: line_rate_hz.map(|_| ROUNDING),
        line_rate_hz,
        rotation_rad: if clockwise == 0.0 {
            0.0
        } else {
            -clockwise.to_radians()
        },
        offset_nm: ["XOffset", "YOffset"].map(|key| note.number(key).unwrap_or(0.0) * 1e9),
        closed_loop: match (mode.starts_with("closed"), mode.starts_with("open")) {
            (true, _) => Some(true),
            (_, true) => Some(false),
            _ => None,
        },
        metadata: note.lines.to_vec(),
        ..Scan::default()
    }
}

/// `2021-10-11` and `3:52:01 PM`.
fn acquired(note: &Note<'_>) -> Option<DateTime> {
    let day = note.unread.entry("Date", note.get("Date"), |text| {
        let date: Option<Vec<i64>> = text
            .split('-')
            .map(|part| part.trim().parse().ok())
            .collect();
        <[i64; 3]>::try_from(date?).ok()
    });
    let time = note.unread.entry("Time", note.get("Time"), clock::clock);
    clock::date(day?, time?)
}

#[cfg(test)]
mod tests;
