//! `WSxM` images (Nanotec, later UAM), `.stp`, `.top` and the like.
//!
//! A text header in sections (`[General Info]`, then `key: value`), up to `[Header end]`, then one
//! image, little endian.
//!
//! - Samples are stored from the bottom right: bottom line first, each line right to left.
//! - `Image Data Type` is `short` (where it is absent, too), `integer`, `float` or `double`.
//! - Counts become values by `Z Amplitude`, which is the distance of the largest and the smallest
//!   sample; zero stays zero. Floating-point samples are values already, in the same unit, unless
//!   their distance says otherwise; some programs give a factor (`Z Scale Factor`) instead.
//! - `X Amplitude`, `Y Amplitude` and the offsets have units (nm, µm, Å).
//! - `X-Frequency` is lines per second; `Angle` is in degrees, taken as counter-clockwise.
//! - `X scanning direction` and `Y scanning direction` are those of the acquisition, `Forward` or
//!   `Backward`, `Up` or `Down`; the samples are in order of position all the same.

use std::borrow::Cow;

use memchr::memmem;

use crate::clock;
use crate::cursor::Endian;
use crate::error::ReadError;
use crate::header::{ChannelHeader, Scaling};
use crate::judge::Check;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding, Order};
use crate::scan::{ChannelInfo, DateTime, FrameDirection, LineDirection, Scan};
use crate::stored::Flat;
use crate::units::{self, quantity};
use crate::whole::Extent;
use crate::words::{self, Unread};

const FORMAT: &str = "WSxM";
const END: &[u8] = b"[Header end]";

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let (text, end) = text(bytes)?;
    let header = Header::of(&text);
    let rows = header.count("General Info", "Number of rows")?;
    let columns = header.count("General Info", "Number of columns")?;
    let start = data_start(bytes, end);
    let (encoding, start) = layout(input.length, &header, start, rows, columns)?;
    let length = raster::byte_length(rows, columns, encoding)
        .ok_or_else(|| damaged(format!("its size is {rows} lines of {columns} samples")))?;
    let scan = frame(&header);
    let name = header
        .get("General Info", "Acquisition channel")
        .unwrap_or("")
        .to_owned();
    let info = ChannelInfo {
        name,
        internal_name: String::new(),
        line_direction: match header
            .lower("General Info", "X scanning direction")
            .as_deref()
        {
            Some("forward") => Some(LineDirection::Trace),
            Some("backward") => Some(LineDirection::Retrace),
            _ => None,
        },
        scan_line: None,
    };
    let mut outline = Outline::of(scan);
    let mut extent = Extent::default();
    if extent.take(input.length, start, length, &info.name) {
        let (unit, scaling) = scaling(&header, encoding);
        outline.scan.notes = header.unread.notes();
        let header = ChannelHeader {
            scaling: None,
            plane_fit: header
                .get("General Info", "Image processes")
                .map(str::to_owned),
            ..ChannelHeader::new(info, rows, columns)
                .in_unit(&unit)
                .of_size(outline.scan.size_nm)
        };
        let order = Order {
            top_first: false,
            mirrored: true,
        };
        let samples = Flat {
            check: Check::Range(scaling),
            ..Flat::at(start, encoding, Endian::Little).in_order(order)
        };
        outline.add_flat(header, samples);
    }
    extent.judge(outline, input.length)
}

/// The header of an image, and where it ends.
fn text(bytes: &[u8]) -> Result<(Cow<'_, str>, usize), ReadError> {
    let end = memmem::find(bytes, END).ok_or_else(|| {
        damaged(format!(
            "expected [Header end], found none in {} bytes: the file was cut off inside the header",
            bytes.len()
        ))
    });
    let head = &bytes[..end.as_ref().copied().unwrap_or(bytes.len().min(4096))];
    let text = words::decode(head);
    // Before the header's end: tables of numbers have none.
    let kind = text.lines().nth(1).unwrap_or("").trim();
    if !kind.eq_ignore_ascii_case("SxM Image file") {
        return Err(ReadError::Unsupported {
            format: FORMAT,
            reason: format!("expected an \"SxM Image file\", found {kind:?}"),
        });
    }
    Ok((text, end?))
}

/// Section, key and value of every line.
struct Header<'a> {
    lines: Vec<(&'a str, &'a str, &'a str)>,
    unread: Unread,
}

impl<'a> Header<'a> {
    fn of(text: &'a str) -> Self {
        let mut section = "";
        let mut lines = Vec::new();
        for line in text.lines().map(str::trim) {
            if let Some(name) = line.strip_prefix('[').and_then(|l| l.strip_suffix(']')) {
                section = name.trim();
            } else if let Some((key, value)) = line.split_once(':') {
                lines.push((section, key.trim(), value.trim()));
            }
        }
        Self {
            lines,
            unread: Unread::default(),
        }
    }

    fn get(&self, section: &str, key: &str) -> Option<&'a str> {
        let found = self
            .lines
            .iter()
            .find(|(s, k, _)| s.eq_ignore_ascii_case(section) && k.eq_ignore_ascii_case(key));
        found.map(|(_, _, value)| *value).filter(|v| !v.is_empty())
    }

    fn lower(&self, section: &str, key: &str) -> Option<String> {
        self.get(section, key).map(str::to_ascii_lowercase)
    }

    fn number(&self, section: &str, key: &str) -> Option<f64> {
        self.quantity(section, key).map(|(number, _)| number)
    }

    fn quantity(&self, section: &str, key: &str) -> Option<(f64, &'a str)> {
        self.unread.entry(key, self.get(section, key), quantity)
    }

    fn count(&self, section: &str, key: &str) -> Result<usize, ReadError> {
        let text = self.get(section, key).unwrap_or("");
        match text.parse() {
            Ok(n) if n > 0 => Ok(n),
            _ => Err(damaged(format!(
                "expected a {key:?} above 0, found {text:?}"
            ))),
        }
    }
}

/// The byte behind the line `[Header end]`.
fn data_start(bytes: &[u8], end: usize) -> usize {
    let mut start = end + END.len();
    if bytes.get(start) == Some(&b'\r') {
        start += 1;
    }
    if bytes.get(start) == Some(&b'\n') {
        start += 1;
    }
    start
}

/// How the samples are stored and where they begin.
///
/// The size of the header is written in it, by some programs wrongly or as 0; it is believed where
/// the file's length agrees.
fn layout(
    available: u64,
    header: &Header<'_>,
    after_header: usize,
    rows: usize,
    columns: usize,
) -> Result<(Encoding, usize), ReadError> {
    let pixels = rows.saturating_mul(columns);
    let stated = header
        .get("", "Image header size")
        .and_then(|text| text.parse().ok())
        .unwrap_or(after_header);
    let fits = |start: usize, encoding: Encoding| {
        pixels
            .checked_mul(encoding.width())
            .and_then(|n| n.checked_add(start))
            .is_some_and(|n| n as u64 == available)
    };
    let kinds: &[Encoding] = match header.lower("General Info", "Image Data Type").as_deref() {
        Some("short") => &[Encoding::I16],
        Some("float") => &[Encoding::F32],
        Some("double") => &[Encoding::F64],
        // Two or four bytes, by version.
        Some("integer" | "int" | "long") => &[Encoding::I16, Encoding::I32],
        None => &[Encoding::I16, Encoding::F64, Encoding::F32],
        Some(other) => {
            return Err(damaged(format!(
                "expected samples of type short, integer, float or double, found {other:?}"
            )));
        }
    };
    for &kind in kinds {
        for start in [after_header, stated] {
            if fits(start, kind) {
                return Ok((kind, start));
            }
        }
    }
    Ok((kinds[0], after_header))
}

/// From the distance of the largest and the smallest sample to values.
type ByRange = Box<dyn Fn(f64) -> Scaling + Send + Sync>;

/// The unit, and how samples become values.
fn scaling(header: &Header<'_>, encoding: Encoding) -> (String, ByRange) {
    let (amplitude, unit) = header
        .quantity("General Info", "Z Amplitude")
        .map_or((None, ""), |(n, unit)| (Some(n).filter(|&n| n > 0.0), unit));
    let unit = match unit {
        "a.u." => "",
        other => other,
    };
    let floating = matches!(encoding, Encoding::F32 | Encoding::F64);
    let number = |key: &str| header.number("Miscellaneous", key);
    let factor = number("Z Scale Factor").filter(|&f| floating && f != 0.0);
    let by_range: ByRange = if let Some(factor) = factor {
        let offset = number("Z Scale Offset").unwrap_or(0.0);
        Box::new(move |_| Scaling {
            scale: factor,
            offset,
            words: format!("sample × {factor} + {offset} (Z Scale)"),
        })
    } else {
        Box::new(move |range| {
            // The header rounds to six digits.
            let values = floating && amplitude.is_none_or(|a| (range - a).abs() <= 1e-4 * a);
            match amplitude {
                Some(amplitude) if !values && range > 0.0 && range.is_finite() => Scaling {
                    scale: amplitude / range,
                    offset: 0.0,
                    words: format!(
                        "sample × Z Amplitude {amplitude} / range of the samples {range}"
                    ),
                },
                _ => Scaling::as_stored(),
            }
        })
    };
    (unit.to_owned(), by_range)
}

/// Everything about the frame but its channel.
fn frame(header: &Header<'_>) -> Scan {
    let unread = &header.unread;
    let length = |key: &str| unread.entry(key, header.get("Control", key), units::length_nm);
    let positive = |key: &str| length(key).filter(|&n| n > 0.0);
    let angle = header.number("Control", "Angle").unwrap_or(0.0);
    Scan {
        format: FORMAT.to_owned(),
        instrument: header.get("Head Settings", "Head Name").map(str::to_owned),
        acquired: header
            .get("General Info", "Acquisition time")
            .and_then(date),
        frame_direction: unread.entry(
            "Y scanning direction",
            header.get("General Info", "Y scanning direction"),
            FrameDirection::named,
        ),
        line_rate_hz: header
            .quantity("Control", "X-Frequency")
            .filter(|&(rate, unit)| rate > 0.0 && matches!(unit, "" | "Hz"))
            .map(|(rate, _)| rate),
        rotation_rad: angle.to_radians(),
        offset_nm: ["X Offset", "Y Offset"].map(|key| length(key).unwrap_or(0.0)),
        size_nm: positive("X Amplitude").map(|width| {
            let height = positive("Y Amplitude");
            [width, height.unwrap_or(width)]
        }),
        metadata: header
            .lines
            .iter()
            .filter(|(section, _, value)| !section.is_empty() && !value.is_empty())
            .map(|(section, key, value)| (format!("{section}: {key}"), (*value).to_owned()))
            .collect(),
        ..Scan::default()
    }
}

/// `23/11/2011, 20:23:46.484`, day first or month first by the computer's language: believed only
/// where one of them cannot be the month.
fn date(text: &str) -> Option<DateTime> {
    let (day, time) = text.split_once([',', ' '])?;
    let numbers: Vec<i64> = day
        .split(['/', '.', '-'])
        .filter_map(|n| n.trim().parse().ok())
        .collect();
    let [a, b, year] = numbers[..] else {
        return None;
    };
    let (day, month) = match (a > 12, b > 12) {
        (true, false) => (a, b),
        (false, true) => (b, a),
        (false, false) if a == b => (a, b),
        _ => return None,
    };
    clock::date([year, month, day], clock::clock(time)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two lines of three samples, counted up from 10 in the order of the file.
    fn file(kind: &str, head: &str) -> Vec<u8> {
        let declared = if kind.is_empty() {
            String::new()
        } else {
            format!("    Image Data Type: {kind}\r\n")
        };
        let mut bytes =
            b"WSxM file copyright UAM\r\nSxM Image file\r\nImage header size: 0\r\n\r\n".to_vec();
        let text = format!(
            "[Control]\r\n\r\n    Angle: 33\r\n    X Amplitude: 0.6 µm\r\n    X Offset: -2 Å\r\n    \
             X-Frequency: 1.5 Hz\r\n    Y Amplitude: 0.3 µm\r\n\r\n[General Info]\r\n\r\n    \
             Acquisition channel: Topography\r\n    Acquisition time: 23/11/2011, 20:23:46.484\r\n{declared}    \
             Number of columns: 3\r\n    Number of rows: 2\r\n    X scanning direction: Backward\r\n    \
             Y scanning direction: Down\r\n{head}\r\n[Header end]\r\n"
        );
        let (encoded, _, _) = encoding_rs::WINDOWS_1252.encode(&text);
        bytes.extend_from_slice(&encoded);
        for n in 10..16i16 {
            match kind {
                "double" => bytes.extend(f64::from(n).to_le_bytes()),
                "float" => bytes.extend(f32::from(n).to_le_bytes()),
                "integer" => bytes.extend(i32::from(n).to_le_bytes()),
                _ => bytes.extend(n.to_le_bytes()),
            }
        }
        bytes
    }

    const AMPLITUDE: &str = "    Z Amplitude: 50 nm\r\n";

    #[test]
    fn samples_begin_at_the_bottom_right() {
        for kind in ["", "short", "integer"] {
            let scan = crate::read(&file(kind, AMPLITUDE)).expect("an image");
            let channel = &scan.channels[0];
            assert_eq!(
                channel.values(),
                [120.0, 110.0, 100.0, 150.0, 140.0, 130.0],
                "{kind}"
            );
            assert_eq!(channel.unit, "nm");
            assert_eq!(channel.line_direction, Some(LineDirection::Retrace));
        }
    }

    #[test]
    fn floating_samples_are_values() {
        for kind in ["float", "double"] {
            let first = |head: &str| {
                crate::read(&file(kind, head)).expect("an image").channels[0].values()[2]
            };
            assert_eq!(first("    Z Amplitude: 5 nm\r\n"), 10.0);
            assert_eq!(first("    Z Amplitude: 5.0000001 nm\r\n"), 10.0);
            // In µm, but stored in nm.
            assert!((first("    Z Amplitude: 0.005 µm\r\n") - 0.01).abs() < 1e-12);
            assert_eq!(
                first("    Z Amplitude: 1 nm\r\n[Miscellaneous]\r\n    Z Scale Factor: 2\r\n"),
                20.0
            );
        }
    }

    #[test]
    fn the_frame_is_told_in_nm() {
        let scan = crate::read(&file("short", AMPLITUDE)).expect("an image");
        let size = scan.size_nm.expect("a size");
        assert!((size[0] - 600.0).abs() + (size[1] - 300.0).abs() < 1e-9);
        assert!((scan.offset_nm[0] + 0.2).abs() < 1e-12);
        assert_eq!(scan.line_rate_hz, Some(1.5));
        assert_eq!(scan.frame_direction, Some(FrameDirection::Down));
        assert!((scan.rotation_rad - 33f64.to_radians()).abs() < 1e-12);
        assert_eq!(scan.acquired, clock::date([2011, 11, 23], [20, 23, 46]));
        // Converters write UTF-8.
        let text: String = file("short", AMPLITUDE)
            .iter()
            .map(|&b| char::from(b))
            .collect();
        let end = text.find("[Header end]\r\n").expect("an end") + 14;
        let mut utf8 = text.as_bytes()[..end].to_vec();
        utf8.extend((10..16i16).flat_map(i16::to_le_bytes));
        assert_eq!(crate::read(&utf8).expect("an image").size_nm, Some(size));
        assert_eq!(date("03/11/2011, 20:23:46"), None, "which is the month?");
        assert!(date("11/23/2011, 20:23:46") == scan.acquired);
    }

    #[test]
    fn damage_is_named() {
        let error = |bytes: &[u8]| crate::read(bytes).expect_err("damaged").to_string();
        let whole = file("double", AMPLITUDE);
        assert!(matches!(
            crate::read(&whole[..whole.len() - 1]),
            Err(ReadError::Incomplete { .. })
        ));
        assert!(error(&whole[..90]).contains("cut off"));
        assert!(error(&file("complex", AMPLITUDE)).contains("complex"));
        let table = b"WSxM file copyright UAM\r\nWSxM ASCII XYZ file\r\n1 2 3\r\n";
        assert!(error(table).contains("ASCII XYZ"));
        let text: Vec<u8> = whole.clone();
        let place = text
            .windows(5)
            .position(|w| w == b"ns: 3")
            .expect("columns");
        let mut giant = text;
        giant.splice(place + 4..place + 5, *b"99999999999999");
        assert!(error(&giant).contains("promises"));
    }
}
