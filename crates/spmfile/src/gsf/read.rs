//! The file → its channels.

use crate::cursor::Endian;
use crate::error::ReadError;
use crate::fields;
use crate::header::ChannelHeader;
use crate::labels;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding, Order};
use crate::scan::{ChannelInfo, Scan};
use crate::stored::Flat;
use crate::units;
use crate::whole::Extent;
use crate::words::Unread;

const FORMAT: &str = "Gwyddion simple field";
/// Keys of the format; others are metadata.
pub(super) const KEYS: [&str; 9] = [
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
    let unread = Unread::default();
    let size = size(&fields, &unread);
    let info = info(&fields);
    let unit = fields::get(&fields, "ZUnits").unwrap_or("").to_owned();
    let plane_fit = labels::value(&fields, "plane fit").map(str::to_owned);
    let mut scan = Scan {
        format: FORMAT.to_owned(),
        size_nm: size.width.zip(size.height).map(<[f64; 2]>::from),
        offset_nm: size.centre,
        metadata: fields::others(fields, &KEYS),
        notes: unread.notes(),
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
            width_nm: size.width,
            height_nm: size.height,
            plane_fit,
            ..ChannelHeader::new(info, rows, columns).in_unit(&unit)
        };
        let samples = Flat::at(start, Encoding::F32, Endian::Little).in_order(order);
        outline.add_flat(header, samples);
    }
    extent.judge(outline, input.length)
}

/// Where the image lies, nm; what has no unit of length is not known.
struct Size {
    width: Option<f64>,
    height: Option<f64>,
    centre: [f64; 2],
}

fn size(fields: &[(String, String)], unread: &Unread) -> Size {
    let nm = fields::get(fields, "XYUnits").and_then(units::nm_per);
    let length_of = |key: &str| {
        let size = fields::number(fields, key, unread)? * nm?;
        Some(size.abs()).filter(|&size| size > 0.0)
    };
    let (width, height) = (length_of("XReal"), length_of("YReal"));
    let mut centre = [0.0; 2];
    if let (Some(nm), Some(width), Some(height)) = (nm, width, height) {
        let axes = [("XOffset", width), ("YOffset", height)];
        for (centre, (key, length)) in centre.iter_mut().zip(axes) {
            if let Some(offset) = fields::number(fields, key, unread) {
                *centre = offset * nm + 0.5 * length;
            }
        }
    }
    Size {
        width,
        height,
        centre,
    }
}

fn info(fields: &[(String, String)]) -> ChannelInfo {
    let title = fields::get(fields, "Title").unwrap_or("").to_owned();
    ChannelInfo {
        line_direction: labels::stated_direction(fields).or_else(|| labels::line_direction(&title)),
        name: title,
        internal_name: labels::value(fields, "internal name")
            .unwrap_or("")
            .to_owned(),
        scan_line: labels::value(fields, "scan line").map(str::to_owned),
    }
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
