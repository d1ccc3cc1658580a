//! A scan → the bytes of a file.

use super::read::KEYS;
use crate::export::{ExportError, base_values};
use crate::fields;
use crate::labels;
use crate::scan::{Channel, Scan, Span};

/// The bytes of a `.gxyzf` file: `channels` at the positions that the `sensors` of x and y recorded.
///
/// Values are in SI base units; the points come line by line, the bottom line first.
///
/// # Errors
/// - There is no channel, or one of another shape than the sensors.
/// - A sensor is not in a unit of length.
pub fn write(
    scan: &Scan,
    sensors: [&Channel; 2],
    channels: &[&Channel],
    log: &[String],
) -> Result<Vec<u8>, ExportError> {
    write_between(scan, sensors, channels, log, &|| ())
}

/// The same; `between` is called before each line.
pub(crate) fn write_between(
    scan: &Scan,
    [x, y]: [&Channel; 2],
    channels: &[&Channel],
    log: &[String],
    between: &dyn Fn(),
) -> Result<Vec<u8>, ExportError> {
    if channels.is_empty() {
        return Err(ExportError::NoChannel);
    }
    let (rows, columns) = (x.rows, x.columns);
    let (values, units) = in_base_units([x, y], channels)?;
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
        if point % columns == 0 {
            between();
        }
        for of_channel in &values {
            bytes.extend(of_channel[point].to_le_bytes());
        }
    }
    Ok(bytes)
}

/// The values of the sensors, then of the channels, and their units; all of one shape.
fn in_base_units(
    [x, y]: [&Channel; 2],
    channels: &[&Channel],
) -> Result<(Vec<Vec<f64>>, Vec<String>), ExportError> {
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
    Ok((values, units))
}
