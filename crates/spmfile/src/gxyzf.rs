//! Gwyddion XYZ fields, `.gxyzf`: points with one or more values, double precision, little endian.
//!
//! Gwyddion user guide, "Gwyddion XYZ Field": the magic line, lines `Key = value`, one to eight
//! NULs up to a multiple of eight bytes, then x, y and `NChannels` values for each point.
//!
//! Points become a scan where `XRes` and `YRes` tell that they lie line by line: x and y are its
//! position sensors. A mere cloud does not tell which points were recorded one after the other.
//!
//! - x to the right, y up. Unless the file was written here: if the lines go down (or the points of a line left), they are turned.
//! - Without a unit of length in `XYUnits` the positions are of no use, and the file is refused.

use crate::cursor::{Cursor, Endian};
use crate::error::ReadError;
use crate::export::{ExportError, base_values};
use crate::fields;
use crate::header::ChannelHeader;
use crate::labels;
use crate::outline::{Input, Outline};
use crate::scan::{Channel, ChannelInfo, LineDirection, Samples, Scan, Span};
use crate::stored::{Stored, Unpacked};
use crate::units;
use crate::whole::MOST_CHANNELS;

const FORMAT: &str = "Gwyddion XYZ field";
const KEYS: [&str; 7] = [
    "NChannels",
    "NPoints",
    "XRes",
    "YRes",
    "XYUnits",
    "ZUnits",
    "Title",
];

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

fn unsupported(reason: String) -> ReadError {
    ReadError::unsupported(FORMAT, reason)
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let (fields, start) = fields::header(bytes, 8).map_err(damaged)?;
    let channels = fields::count(&fields, "NChannels").map_err(damaged)?;
    if channels > MOST_CHANNELS {
        return Err(ReadError::TooManyChannels {
            found: channels,
            limit: MOST_CHANNELS,
        });
    }
    let data = bytes.get(start..).unwrap_or(&[]);
    let width = 8 * (channels + 2);
    let found = data.len() / width;
    let points = match fields::get(&fields, "NPoints") {
        Some(_) => fields::count(&fields, "NPoints").map_err(damaged)?,
        None => found,
    };
    if data.len() % width != 0 || points != found {
        return Err(damaged(format!(
            "expected {points} points of {width} bytes, found {} bytes",
            data.len()
        )));
    }
    let size = |key: &str| fields::count(&fields, key).ok();
    let (Some(columns), Some(rows)) = (size("XRes"), size("YRes")) else {
        return Err(unsupported(format!(
            "it holds {points} points without XRes and YRes: which of them make a line is not told"
        )));
    };
    if columns.checked_mul(rows) != Some(points) {
        return Err(unsupported(format!(
            "its {points} points are not {rows} lines of {columns}"
        )));
    }
    let lateral = fields::get(&fields, "XYUnits").unwrap_or("");
    let nm = units::nm_per(&units::clean(lateral)).ok_or_else(|| {
        unsupported(format!(
            "its positions are in {lateral:?}, not in a unit of length"
        ))
    })?;
    // Of files written here the order is known.
    let order = match labels::value(&fields, "rotation (rad)") {
        Some(_) => Turned {
            lines: false,
            points: false,
        },
        None => Turned::of(data, width, columns, rows),
    };
    let span = match labels::value(&fields, "size reaches") {
        Some("edges") => Span::PixelEdges,
        Some("frame") => Span::Frame,
        _ => Span::PixelCentres,
    };
    let mut scan = Scan {
        format: FORMAT.to_owned(),
        metadata: fields.clone(),
        ..Scan::default()
    };
    labels::apply(&mut scan);
    scan.metadata = fields::others(scan.metadata, &KEYS);
    let line_direction = labels::stated_direction(&fields);
    let size = scan.size_nm;
    let mut outline = Outline::of(scan);
    for index in 0..channels + 2 {
        let unit = match index {
            0 | 1 => "nm",
            _ => {
                let own = fields::get(&fields, &format!("ZUnits{}", index - 1));
                own.or(fields::get(&fields, "ZUnits")).unwrap_or("")
            }
        };
        let scale = if index < 2 { nm } else { 1.0 };
        let header = ChannelHeader {
            span,
            ..ChannelHeader::new(info(index, &fields, line_direction), rows, columns)
                .in_unit(unit)
                .of_size(size)
                .scaled(scale, 0.0, "values as stored".to_owned())
        };
        let samples = move || {
            let place = |point: usize| order.place(point, columns, rows);
            let values = (0..points).map(|point| number(data, width, place(point), index));
            Ok(Unpacked::measured(Samples::F64(values.collect())))
        };
        outline.add(header, Stored::Packed(Box::new(samples)));
    }
    Ok(outline)
}

/// The first two columns are the position sensors.
fn info(
    index: usize,
    fields: &[(String, String)],
    line_direction: Option<LineDirection>,
) -> ChannelInfo {
    let title = match index {
        0 => "X Sensor".to_owned(),
        1 => "Y Sensor".to_owned(),
        _ => {
            let key = format!("Title{}", index - 1);
            let title = fields::get(fields, &key).or(fields::get(fields, "Title"));
            title.unwrap_or("").to_owned()
        }
    };
    ChannelInfo {
        line_direction: line_direction.or_else(|| labels::line_direction(&title)),
        name: title,
        internal_name: String::new(),
        scan_line: None,
    }
}

/// Value `index` of a point; the caller has checked the length.
fn number(data: &[u8], width: usize, point: usize, index: usize) -> f64 {
    Cursor::new(data, Endian::Little)
        .at(point * width + 8 * index)
        .f64()
        .unwrap_or(f64::NAN)
}

/// Which way the stored lines and points run against up and right.
#[derive(Clone, Copy)]
struct Turned {
    lines: bool,
    points: bool,
}

impl Turned {
    /// Judged by the ends of the frame; a frame whose lines follow each other sideways is left.
    fn of(data: &[u8], width: usize, columns: usize, rows: usize) -> Self {
        let at = |row: usize, column: usize| -> [f64; 2] {
            [0, 1].map(|axis| number(data, width, row * columns + column, axis))
        };
        let (first, right, top) = (at(0, 0), at(0, columns - 1), at(rows - 1, 0));
        let fast = [right[0] - first[0], right[1] - first[1]];
        let slow = [top[0] - first[0], top[1] - first[1]];
        let upright = fast[0].abs() > fast[1].abs() && slow[1].abs() > slow[0].abs();
        Self {
            lines: upright && slow[1] < 0.0,
            points: upright && fast[0] < 0.0,
        }
    }

    /// The stored place of a pixel counted from the bottom left.
    fn place(self, pixel: usize, columns: usize, rows: usize) -> usize {
        let (row, column) = (pixel / columns, pixel % columns);
        let row = if self.lines { rows - 1 - row } else { row };
        let column = if self.points {
            columns - 1 - column
        } else {
            column
        };
        row * columns + column
    }
}

/// The bytes of a `.gxyzf` file: `channels` at the positions that the sensors `x` and `y` recorded.
///
/// Values are in SI base units; the points come line by line, the bottom line first.
///
/// # Errors
/// - There is no channel, or one of another shape than the sensors.
/// - A sensor is not in a unit of length.
pub fn write(
    scan: &Scan,
    [x, y]: [&Channel; 2],
    channels: &[&Channel],
    log: &[String],
) -> Result<Vec<u8>, ExportError> {
    if channels.is_empty() {
        return Err(ExportError::NoChannel);
    }
    let (rows, columns) = (x.rows, x.columns);
    let mut values = Vec::new();
    let mut units = Vec::new();
    for (index, channel) in [x, y].iter().chain(channels).enumerate() {
        if (channel.rows, channel.columns) != (rows, columns) {
            return Err(ExportError::Unlike {
                name: channel.name.clone(),
                rows,
                columns,
            });
        }
        let (of_channel, unit) = base_values(channel)?;
        if index < 2 && unit != "m" {
            return Err(ExportError::NotALength {
                name: channel.name.clone(),
                unit: channel.unit.clone(),
            });
        }
        values.push(of_channel);
        units.push(unit);
    }
    let mut header = "Gwyddion XYZ Field 1.0\n".to_owned();
    let mut put = |key: &str, value: &str| fields::put(&mut header, key, value);
    put("NChannels", &channels.len().to_string());
    put("NPoints", &(rows * columns).to_string());
    put("XRes", &columns.to_string());
    put("YRes", &rows.to_string());
    put("XYUnits", "m");
    for (index, channel) in channels.iter().enumerate() {
        put(&format!("ZUnits{}", index + 1), &units[index + 2]);
        put(&format!("Title{}", index + 1), &channel.name);
    }
    let lines = [labels::describe(scan), labels::describe_channel(x)].concat();
    // Keys of the format in the header of another one would contradict those above.
    let others = fields::others(scan.metadata.clone(), &KEYS);
    for (key, value) in lines.iter().chain(&others) {
        put(key, value);
    }
    let reaches = match x.span {
        Span::PixelCentres => "centres",
        Span::Frame => "frame",
        Span::PixelEdges => "edges",
    };
    put("spmfile size reaches", reaches);
    for (step, text) in log.iter().enumerate() {
        put(&format!("log {}", step + 1), text);
    }
    let mut bytes = header.into_bytes();
    bytes.resize((bytes.len() / 8 + 1) * 8, 0);
    bytes.reserve(8 * values.len() * rows * columns);
    for point in 0..rows * columns {
        for of_channel in &values {
            bytes.extend(of_channel[point].to_le_bytes());
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {

    /// 2 lines of 3 points, x and y in `unit`, one value counted up.
    fn file(head: &str, positions: impl Fn(usize, usize) -> [f64; 2]) -> Vec<u8> {
        let mut bytes = format!("Gwyddion XYZ Field 1.0\n{head}").into_bytes();
        bytes.resize((bytes.len() / 8 + 1) * 8, 0);
        for point in 0..6 {
            let [x, y] = positions(point / 3, point % 3);
            for value in [x, y, point as f64] {
                bytes.extend(value.to_le_bytes());
            }
        }
        bytes
    }

    const HEAD: &str = "NChannels = 1\nNPoints = 6\nXYUnits = m\nZUnits1 = V\nTitle1 = Phase\nXRes = 3\nYRes = 2\n";

    #[test]
    fn points_in_lines_become_sensors() {
        let straight = |row: usize, column: usize| [1e-9 * column as f64, 2e-9 * row as f64];
        let scan = crate::read(&file(HEAD, straight)).expect("a scan");
        let names: Vec<_> = scan
            .channels
            .iter()
            .map(|c| (c.name.as_str(), c.unit.as_str()))
            .collect();
        assert_eq!(
            names,
            [("X Sensor", "nm"), ("Y Sensor", "nm"), ("Phase", "V")]
        );
        assert_eq!(scan.channels[2].values(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let (x, y) = (scan.channels[0].values(), scan.channels[1].values());
        let close = |found: &[f64], expected: [f64; 6]| {
            found
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-12)
        };
        assert!(close(&x, [0.0, 1.0, 2.0, 0.0, 1.0, 2.0]));
        assert!(close(&y, [0.0, 0.0, 0.0, 2.0, 2.0, 2.0]));
        assert_eq!(scan.size_nm, None);
    }

    #[test]
    fn lines_from_the_top_are_turned_and_sideways_ones_left() {
        let top = |row: usize, column: usize| [-1e-9 * column as f64, -2e-9 * row as f64];
        let scan = crate::read(&file(HEAD, top)).expect("a scan");
        assert_eq!(scan.channels[2].values(), [5.0, 4.0, 3.0, 2.0, 1.0, 0.0]);
        let sideways = |row: usize, column: usize| [-1e-9 * row as f64, -2e-9 * column as f64];
        let scan = crate::read(&file(HEAD, sideways)).expect("a scan");
        assert_eq!(scan.channels[2].values(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn what_is_no_scan_is_refused() {
        let straight = |row: usize, column: usize| [1e-9 * column as f64, 2e-9 * row as f64];
        let error = |from: &str, to: &str| {
            let bytes = file(&HEAD.replace(from, to), straight);
            crate::read(&bytes).expect_err("refused").to_string()
        };
        assert!(error("XRes = 3\n", "").contains("6 points without XRes"));
        assert!(error("XRes = 3", "XRes = 4").contains("not 2 lines of 4"));
        assert!(error("XYUnits = m\n", "").contains("unit of length"));
        assert!(error("NPoints = 6", "NPoints = 7").contains("expected 7 points"));
        assert!(error("NChannels = 1", "NChannels = 0").contains("NChannels"));
        assert!(error("NChannels = 1", "NChannels = 99999").contains("99999"));
    }
}
