//! One `\*Ciao image list` section: where its samples lie, what they mean.

use std::ops::Range;

use super::header::{Section, leading_number};
use crate::cursor::Endian;
use crate::judge::Check;
use crate::raster::Encoding;
use crate::scan::{ChannelInfo, LineDirection};
use crate::stored::{Flat, Valid};

/// Where a channel's samples lie in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Bytes per sample as stored: data length / (rows · columns).
    pub(super) stored: usize,
    /// Bytes per sample as labelled; the divisor of the scale follows it.
    pub(super) label: i32,
    /// First byte, and the one after the last.
    pub(super) data: Range<u64>,
}

/// Name and directions of an image section; `number` (from 1) stands in for a lost name.
pub(super) fn info(image: &Section<'_>, number: usize) -> ChannelInfo {
    let (internal_name, name) = image.grouped("Image Data").next().map_or(("", ""), names);
    ChannelInfo {
        name: match (name, internal_name) {
            ("", "") => format!("channel {number}"),
            ("", internal) => internal.to_owned(),
            (name, _) => name.to_owned(),
        },
        internal_name: internal_name.to_owned(),
        line_direction: match image.get("Line direction") {
            Some(d) if d.eq_ignore_ascii_case("Trace") => Some(LineDirection::Trace),
            Some(d) if d.eq_ignore_ascii_case("Retrace") => Some(LineDirection::Retrace),
            _ => None,
        },
        scan_line: image
            .get("Scan line")
            .filter(|s| !s.is_empty())
            .map(str::to_owned),
    }
}

/// `S [Internal] "External"`.
pub(super) fn names(value: &str) -> (&str, &str) {
    let between = |open, close| {
        let (_, after) = value.split_once(open)?;
        Some(after.split_once(close)?.0.trim())
    };
    (
        between('[', ']').unwrap_or(""),
        between('"', '"').unwrap_or(""),
    )
}

/// Reads where the samples lie; the error says what is odd.
pub(super) fn layout(image: &Section<'_>) -> Result<Layout, String> {
    let number = |key: &str| -> Result<u64, String> {
        let text = image.get(key).ok_or_else(|| format!("it has no {key:?}"))?;
        let first = text.split_whitespace().next().unwrap_or("");
        first
            .parse()
            .map_err(|_| format!("its {key:?} is {text:?}, not a whole number"))
    };
    let (columns, mut rows) = (number("Samps/line")?, number("Number of lines")?);
    let (offset, length) = (number("Data offset")?, number("Data length")?);
    // Narrow scans of version 5 have as many lines as samples by `Number of lines`; the data have those that are valid.
    let fits = |rows: u64| {
        let samples = columns.saturating_mul(rows);
        length > 0
            && [2, 4]
                .iter()
                .any(|&bytes| samples.saturating_mul(bytes) == length)
    };
    if !fits(rows)
        && number("Valid data start Y") == Ok(0)
        && let Ok(valid) = number("Valid data len Y")
        && fits(valid)
    {
        rows = valid;
    }
    let pixels = columns.checked_mul(rows).filter(|&n| n > 0);
    let Some(pixels) = pixels else {
        return Err(format!("its size is {rows} lines of {columns} samples"));
    };
    if length != pixels.saturating_mul(2) && length != pixels.saturating_mul(4) {
        return Err(format!(
            "its {rows} lines of {columns} samples need 2 or 4 bytes each, but it is {length} bytes long"
        ));
    }
    let stored = (length / pixels) as usize;
    let label = match image.get("Bytes/pixel") {
        None if stored == 2 => 2,
        None => 4,
        Some("2") => 2,
        Some("4") if stored == 4 => 4,
        Some(label) => {
            return Err(format!(
                "its samples are labelled {label} bytes wide and stored with {stored}"
            ));
        }
    };
    let end = offset
        .checked_add(length)
        .ok_or_else(|| format!("its data offset is {offset}"))?;
    let size = |n: u64| usize::try_from(n).map_err(|_| format!("{n} samples are too many"));
    Ok(Layout {
        rows: size(rows)?,
        columns: size(columns)?,
        stored,
        label,
        data: offset..end,
    })
}

/// Where the samples lie and how they are stored.
pub(super) fn samples(image: &Section<'_>, layout: &Layout) -> Flat<'static> {
    let encoding = match layout.stored {
        2 => Encoding::I16,
        _ => Encoding::I32,
    };
    let narrow = layout.stored == 4 && layout.label == 2;
    Flat {
        valid: valid(image, layout),
        check: if narrow {
            Check::Narrow
        } else {
            Check::Nothing
        },
        ..Flat::at(layout.data.start as usize, encoding, Endian::Little)
    }
}

/// The part of the image that was recorded, if it is not all of it.
///
/// `Valid data start/len X/Y` are in stored rows and columns. A region that does not fit the
/// image is not believed.
fn valid(image: &Section<'_>, layout: &Layout) -> Option<Valid> {
    let span = |start: &str, length: &str, all: usize| -> Range<usize> {
        let read = |key| {
            let (n, _) = leading_number(image.get(key)?)?;
            (n >= 0.0 && n <= all as f64).then_some(n as usize)
        };
        match (read(start), read(length)) {
            (Some(start), Some(length)) if length > 0 && start + length <= all => {
                start..start + length
            }
            _ => 0..all,
        }
    };
    let columns = span("Valid data start X", "Valid data len X", layout.columns);
    let rows = span("Valid data start Y", "Valid data len Y", layout.rows);
    let all = columns.len() == layout.columns && rows.len() == layout.rows;
    (!all).then_some(Valid { rows, columns })
}

/// What the instrument subtracted, as in `Line (realtime), Full (offline)`.
pub(super) fn plane_fit(image: &Section<'_>) -> Option<String> {
    let fits: Vec<String> = [
        ("Realtime planefit", "realtime"),
        ("Offline planefit", "offline"),
    ]
    .into_iter()
    .filter_map(|(key, when)| {
        let fit = image.get(key)?;
        (!fit.is_empty() && !fit.eq_ignore_ascii_case("None")).then(|| format!("{fit} ({when})"))
    })
    .collect();
    (!fits.is_empty()).then(|| fits.join(", "))
}
