//! The file → its channels.

use crate::cursor::{Cursor, Endian};
use crate::error::ReadError;
use crate::fields;
use crate::header::ChannelHeader;
use crate::labels;
use crate::outline::{Input, Outline};
use crate::scan::{ChannelInfo, LineDirection, Samples, Scan, Span};
use crate::stored::{Stored, Unpacked};
use crate::units;
use crate::whole::MOST_CHANNELS;

const FORMAT: &str = "Gwyddion XYZ field";
/// Keys of the format; others are metadata.
pub(super) const KEYS: [&str; 7] = [
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
    let (fields, start) = fields::header(input.bytes, 8).map_err(damaged)?;
    let points = Points::of(&fields, input.bytes.get(start..).unwrap_or(&[]))?;
    let lateral = fields::get(&fields, "XYUnits").unwrap_or("");
    let nm = units::nm_per(lateral).ok_or_else(|| {
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
        None => Turned::of(&points),
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
    for index in 0..points.channels + 2 {
        let info = info(index, &fields, line_direction);
        let scale = if index < 2 { nm } else { 1.0 };
        let header = ChannelHeader {
            span,
            ..ChannelHeader::new(info, points.rows, points.columns)
                .in_unit(unit(index, &fields))
                .of_size(size)
                .scaled(scale, 0.0, "values as stored".to_owned())
        };
        let samples = move || {
            let all = 0..points.rows * points.columns;
            let values = all.map(|pixel| points.number(order.place(pixel, &points), index));
            Ok(Unpacked::measured(Samples::F64(values.collect())))
        };
        outline.add(header, Stored::Packed(Box::new(samples)));
    }
    Ok(outline)
}

/// The points, line by line.
#[derive(Clone, Copy)]
struct Points<'a> {
    data: &'a [u8],
    /// Values of a point beside its position.
    channels: usize,
    rows: usize,
    columns: usize,
}

impl<'a> Points<'a> {
    fn of(fields: &[(String, String)], data: &'a [u8]) -> Result<Self, ReadError> {
        let channels = fields::count(fields, "NChannels").map_err(damaged)?;
        if channels > MOST_CHANNELS {
            return Err(ReadError::TooManyChannels {
                found: channels,
                limit: MOST_CHANNELS,
            });
        }
        let width = 8 * (channels + 2);
        let found = data.len() / width;
        let points = match fields::get(fields, "NPoints") {
            Some(_) => fields::count(fields, "NPoints").map_err(damaged)?,
            None => found,
        };
        if !data.len().is_multiple_of(width) || points != found {
            return Err(damaged(format!(
                "expected {points} points of {width} bytes, found {} bytes",
                data.len()
            )));
        }
        let size = |key: &str| fields::count(fields, key).ok();
        let (Some(columns), Some(rows)) = (size("XRes"), size("YRes")) else {
            return Err(unsupported(format!(
                "it holds {points} points without XRes and YRes, so it is not known which of them make a line"
            )));
        };
        if columns.checked_mul(rows) != Some(points) {
            return Err(unsupported(format!(
                "its {points} points are not {rows} lines of {columns}"
            )));
        }
        Ok(Self {
            data,
            channels,
            rows,
            columns,
        })
    }

    /// Value `index` of a point; the first two are its position.
    fn number(&self, point: usize, index: usize) -> f64 {
        Cursor::new(self.data, Endian::Little)
            .at(8 * (point * (self.channels + 2) + index))
            .f64()
            .unwrap_or(f64::NAN)
    }
}

/// The unit of a column.
fn unit(index: usize, fields: &[(String, String)]) -> &str {
    if index < 2 {
        return "nm";
    }
    let own = fields::get(fields, &format!("ZUnits{}", index - 1));
    own.or(fields::get(fields, "ZUnits")).unwrap_or("")
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

/// Which way the stored lines and points run against up and right.
#[derive(Clone, Copy)]
struct Turned {
    lines: bool,
    points: bool,
}

impl Turned {
    /// Judged by the ends of the frame; a frame whose lines follow each other sideways is left.
    fn of(points: &Points<'_>) -> Self {
        let (rows, columns) = (points.rows, points.columns);
        let at = |row: usize, column: usize| -> [f64; 2] {
            [0, 1].map(|axis| points.number(row * columns + column, axis))
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
    fn place(self, pixel: usize, points: &Points<'_>) -> usize {
        let (rows, columns) = (points.rows, points.columns);
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
