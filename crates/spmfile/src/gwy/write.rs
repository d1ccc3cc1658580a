//! Scans as Gwyddion containers. The layout is in the head of [`super`].

use crate::export::{ExportError, base_values, from_the_top};
use crate::labels;
use crate::scan::{Channel, Scan};
use crate::words::one_line;

/// The bytes of a `.gwy` file with every channel of `scan`.
///
/// Each channel has its name as title; the rest of the scan's header and the lines of `log` (what
/// was done with the data) are its metadata. Values are in SI base units, as Gwyddion wants them.
///
/// # Errors
/// - A channel's samples do not fill its lines.
/// - The file would be longer than 4 GB.
pub fn write(scan: &Scan, log: &[String]) -> Result<Vec<u8>, ExportError> {
    write_between(scan, log, &|| ())
}

/// The same; `between` is called before each line.
pub(crate) fn write_between(
    scan: &Scan,
    log: &[String],
    between: &dyn Fn(),
) -> Result<Vec<u8>, ExportError> {
    if scan.channels.is_empty() {
        return Err(ExportError::NoChannel);
    }
    let mut bytes = b"GWYP".to_vec();
    object(&mut bytes, "GwyContainer", |items| {
        let mut channels = scan.channels.iter().enumerate();
        channels.try_for_each(|(number, channel)| {
            put_object(items, &format!("/{number}/data"), "GwyDataField", |o| {
                data_field(o, scan, channel, between)
            })?;
            put_text(items, &format!("/{number}/data/title"), &channel.name);
            put_object(items, &format!("/{number}/meta"), "GwyContainer", |o| {
                meta(o, scan, channel, log);
                Ok(())
            })
        })
    })?;
    Ok(bytes)
}

/// The header entries of a channel, and what was done.
fn meta(out: &mut Vec<u8>, scan: &Scan, channel: &Channel, log: &[String]) {
    let mut lines = labels::describe(scan);
    lines.extend(labels::describe_channel(channel));
    lines.extend(scan.metadata.clone());
    let steps = log.iter().enumerate();
    lines.extend(steps.map(|(step, text)| (format!("log {}", step + 1), text.clone())));
    for (key, value) in &lines {
        put_text(out, &one_line(key), value);
    }
}

fn data_field(
    out: &mut Vec<u8>,
    scan: &Scan,
    channel: &Channel,
    between: &dyn Fn(),
) -> Result<(), ExportError> {
    let (values, unit) = base_values(channel)?;
    let count = |n: usize| i32::try_from(n).map_err(|_| ExportError::TooLong);
    let (columns, rows) = (count(channel.columns)?, count(channel.rows)?);
    put_integer(out, "xres", columns);
    put_integer(out, "yres", rows);
    // Gwyddion's sizes go from edge to edge.
    let size = channel.edges_nm();
    let [width, height] = size.map_or([f64::from(columns), f64::from(rows)], |size| {
        size.map(|nm| nm / 1e9)
    });
    put_double(out, "xreal", width);
    put_double(out, "yreal", height);
    if size.is_some() {
        put_double(out, "xoff", scan.offset_nm[0] / 1e9 - 0.5 * width);
        put_double(out, "yoff", scan.offset_nm[1] / 1e9 - 0.5 * height);
    }
    for (name, unit) in [
        ("si_unit_xy", if size.is_some() { "m" } else { "" }),
        ("si_unit_z", unit.as_str()),
    ] {
        put_object(out, name, "GwySIUnit", |o| {
            put_text(o, "unitstr", unit);
            Ok(())
        })?;
    }
    let length = u32::try_from(values.len()).map_err(|_| ExportError::TooLong)?;
    head(out, "data", b'D');
    out.extend(length.to_le_bytes());
    out.reserve(8 * values.len());
    for line in from_the_top(&values, channel, between) {
        for value in line {
            out.extend_from_slice(&value.to_le_bytes());
        }
    }
    Ok(())
}

fn head(out: &mut Vec<u8>, name: &str, kind: u8) {
    out.extend(name.bytes());
    out.extend([0, kind]);
}

fn put_integer(out: &mut Vec<u8>, name: &str, value: i32) {
    head(out, name, b'i');
    out.extend(value.to_le_bytes());
}

fn put_double(out: &mut Vec<u8>, name: &str, value: f64) {
    head(out, name, b'd');
    out.extend(value.to_le_bytes());
}

/// A text ends with its first NUL.
fn put_text(out: &mut Vec<u8>, name: &str, value: &str) {
    head(out, name, b's');
    out.extend(value.bytes().filter(|&b| b != 0));
    out.push(0);
}

fn put_object(
    out: &mut Vec<u8>,
    name: &str,
    kind: &str,
    fill: impl FnOnce(&mut Vec<u8>) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    head(out, name, b'o');
    object(out, kind, fill)
}

/// The length of what is in it goes before it.
fn object(
    out: &mut Vec<u8>,
    kind: &str,
    fill: impl FnOnce(&mut Vec<u8>) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    out.extend(kind.bytes());
    out.push(0);
    let before = out.len();
    out.extend([0; 4]);
    let first = out.len();
    fill(out)?;
    let length = u32::try_from(out.len() - first).map_err(|_| ExportError::TooLong)?;
    out[before..first].copy_from_slice(&length.to_le_bytes());
    Ok(())
}
