//! Gwyddion simple fields, `.gsf`: one image of single-precision samples, little endian.
//!
//! Gwyddion user guide, "Gwyddion Simple Field": the magic line, lines `Key = value`, one to four
//! NULs up to a multiple of four bytes, the samples; the file ends with the last sample.
//!
//! - Row 0 is the top line.
//! - `XReal` and `YReal` are edge to edge in `XYUnits`; without a unit of length there is no size.

use crate::cursor::Endian;
use crate::error::ReadError;
use crate::export::{ExportError, base_values};
use crate::fields;
use crate::header::ChannelHeader;
use crate::labels;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding, Order};
use crate::scan::{Channel, ChannelInfo, Scan};
use crate::stored::Flat;
use crate::units;
use crate::whole::Extent;

const FORMAT: &str = "Gwyddion simple field";
const KEYS: [&str; 9] = [
    "XRes", "YRes", "XReal", "YReal", "XOffset", "YOffset", "XYUnits", "ZUnits", "Title",
];

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let (fields, start) = fields::header(bytes, 4).map_err(damaged)?;
    let rows = fields::count(&fields, "YRes").map_err(damaged)?;
    let columns = fields::count(&fields, "XRes").map_err(damaged)?;
    let length = raster::byte_length(rows, columns, Encoding::F32)
        .ok_or_else(|| damaged(format!("its size is {rows} lines of {columns} samples")))?;
    let beyond = input
        .length
        .saturating_sub(start.saturating_add(length) as u64);
    if beyond > 0 {
        return Err(damaged(format!(
            "{beyond} bytes too many for {rows} lines of {columns} samples"
        )));
    }
    let title = fields::get(&fields, "Title").unwrap_or("").to_owned();
    let nm = fields::get(&fields, "XYUnits").and_then(|unit| units::nm_per(&units::clean(unit)));
    let length_nm = |key: &str| {
        let size = fields::number(&fields, key)? * nm?;
        Some(size.abs()).filter(|&size| size > 0.0)
    };
    let (width_nm, height_nm) = (length_nm("XReal"), length_nm("YReal"));
    let size_nm = width_nm
        .zip(height_nm)
        .map(|(width, height)| [width, height]);
    let mut offset_nm = [0.0; 2];
    for (index, key) in ["XOffset", "YOffset"].into_iter().enumerate() {
        if let (Some(offset), Some(nm), Some(size)) = (fields::number(&fields, key), nm, size_nm) {
            offset_nm[index] = offset * nm + 0.5 * size[index];
        }
    }
    let info = ChannelInfo {
        line_direction: labels::stated_direction(&fields)
            .or_else(|| labels::line_direction(&title)),
        name: title,
        internal_name: labels::value(&fields, "internal name")
            .unwrap_or("")
            .to_owned(),
        scan_line: labels::value(&fields, "scan line").map(str::to_owned),
    };
    let unit = fields::get(&fields, "ZUnits").unwrap_or("").to_owned();
    let plane_fit = labels::value(&fields, "plane fit").map(str::to_owned);
    let mut scan = Scan {
        format: FORMAT.to_owned(),
        size_nm,
        offset_nm,
        metadata: fields::others(fields, &KEYS),
        ..Scan::default()
    };
    labels::apply(&mut scan);
    let mut outline = Outline::of(scan);
    let mut extent = Extent::default();
    if extent.take(input.length, start, length, &info.name) {
        let order = Order {
            top_first: true,
            mirrored: false,
        };
        let header = ChannelHeader {
            width_nm,
            height_nm,
            plane_fit,
            ..ChannelHeader::new(info, rows, columns).in_unit(&unit)
        };
        let samples = Flat::at(start, Encoding::F32, Endian::Little).in_order(order);
        outline.add_flat(header, samples);
    }
    extent.judge(outline, input.length)
}

/// The bytes of a `.gsf` file with one channel of `scan`.
///
/// Values are in SI base units and single precision; the rest of the scan's header and the lines of
/// `log` (what was done with the data) are kept as further keys.
///
/// # Errors
/// The samples do not fill the lines of the channel.
pub fn write(scan: &Scan, channel: &Channel, log: &[String]) -> Result<Vec<u8>, ExportError> {
    let (values, unit) = base_values(channel)?;
    let mut header = "Gwyddion Simple Field 1.0\n".to_owned();
    let mut put = |key: &str, value: &str| fields::put(&mut header, key, value);
    put("XRes", &channel.columns.to_string());
    put("YRes", &channel.rows.to_string());
    if let Some([width, height]) = channel.edges_nm() {
        let metres = |nm: f64| format!("{:e}", nm / 1e9);
        put("XReal", &metres(width));
        put("YReal", &metres(height));
        put("XOffset", &metres(scan.offset_nm[0] - 0.5 * width));
        put("YOffset", &metres(scan.offset_nm[1] - 0.5 * height));
        put("XYUnits", "m");
    }
    put("ZUnits", &unit);
    put("Title", &channel.name);
    let lines = [labels::describe(scan), labels::describe_channel(channel)].concat();
    // Keys of the format in the header of another one would contradict those above.
    let others = scan.metadata.iter().filter(|(key, _)| {
        let stem = key.trim_end_matches(|c: char| c.is_ascii_digit());
        !KEYS.contains(&stem)
    });
    for (key, value) in lines.iter().chain(others) {
        put(key, value);
    }
    for (step, text) in log.iter().enumerate() {
        put(&format!("log {}", step + 1), text);
    }
    let mut bytes = header.into_bytes();
    bytes.resize((bytes.len() / 4 + 1) * 4, 0);
    // The top line comes first.
    for line in values.rchunks_exact(channel.columns) {
        bytes.extend(line.iter().flat_map(|&value| (value as f32).to_le_bytes()));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::LineDirection;

    /// Two lines of three samples; the header is `head` behind the magic line.
    fn file(head: &str, samples: usize) -> Vec<u8> {
        let mut bytes = format!("Gwyddion Simple Field 1.0\n{head}").into_bytes();
        bytes.resize((bytes.len() / 4 + 1) * 4, 0);
        bytes.extend((0..samples).flat_map(|n| (n as f32).to_le_bytes()));
        bytes
    }

    const WHOLE: &str = "XRes = 3\nYRes = 2\nXReal = 3e-6\nYReal = 1e-6\nXOffset = 1e-6\nXYUnits = m\n\
                         ZUnits = V\nTitle = Z (Backward)\nBias = 0.1 = low\n";

    #[test]
    fn the_first_line_is_the_top_one() {
        for head in [
            WHOLE.to_owned(),
            WHOLE.replace("Bias", "Bi"),
            WHOLE.replace("Bias", "B"),
            WHOLE.replace("Bias", "Biases"),
        ] {
            let scan = crate::read(&file(&head, 6)).expect("an image");
            let channel = &scan.channels[0];
            assert_eq!(channel.values(), [3.0, 4.0, 5.0, 0.0, 1.0, 2.0]);
            assert_eq!(
                (channel.name.as_str(), channel.unit.as_str()),
                ("Z (Backward)", "V")
            );
            assert_eq!(channel.line_direction, Some(LineDirection::Retrace));
            let close = |found: f64, expected: f64| (found - expected).abs() < 1e-9;
            assert!(close(channel.width_nm.expect("width"), 3000.0));
            assert!(close(channel.height_nm.expect("height"), 1000.0));
            assert!(close(scan.offset_nm[0], 2500.0));
            assert_eq!(scan.metadata[0].1, "0.1 = low");
        }
    }

    #[test]
    fn without_units_there_is_no_size() {
        let scan = crate::read(&file(&WHOLE.replace("XYUnits = m\n", ""), 6)).expect("an image");
        assert_eq!((scan.size_nm, scan.channels[0].width_nm), (None, None));
        let scan = crate::read(&file("XRes = 3\nYRes = 2\n", 6)).expect("an image");
        assert_eq!(scan.channels[0].width_nm, None);
    }

    #[test]
    fn lengths_must_agree() {
        let error = |bytes: &[u8]| crate::read(bytes).expect_err("damaged").to_string();
        assert!(error(&file(WHOLE, 7)).contains("4 bytes too many"));
        assert!(matches!(
            crate::read(&file(WHOLE, 5)),
            Err(ReadError::Incomplete { .. })
        ));
        assert!(matches!(
            crate::read(&file(WHOLE, 0)),
            Err(ReadError::HeaderOnly { .. })
        ));
        assert!(error(b"Gwyddion Simple Field 1.0\nXRes = 3").contains("cut off"));
        assert!(error(&file("XRes = 3\n", 6)).contains("YRes"));
        let giant = "XRes = 99999999999\nYRes = 99999999999\n";
        assert!(error(&file(giant, 6)).contains("99999999999"));
        let mut bytes = file(WHOLE, 6);
        let end = bytes.iter().position(|&b| b == 0).expect("a NUL");
        if end % 4 < 3 {
            bytes[end + 1] = 1;
            assert!(error(&bytes).contains("NUL"));
        }
    }
}
