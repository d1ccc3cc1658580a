//! Scans as plain arrays: `.npz`, 32-bit TIFF, text matrices. The top line comes first.
//!
//! Values are in the unit of the channel. What else is known (unit, size, how the frame was scanned,
//! what was done with it) goes along as lines `key = value`: in a text beside each array of an
//! archive, in the description of each picture, in comments above a matrix. [`crate::arrays::read()`] takes it
//! back.

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};

#[cfg(feature = "pictures")]
use tiff::encoder::{Rational, TiffEncoder, colortype::Gray32Float};
#[cfg(feature = "pictures")]
use tiff::tags::{ResolutionUnit, Tag};
#[cfg(feature = "archives")]
use zip::write::SimpleFileOptions;
#[cfg(feature = "archives")]
use zip::{CompressionMethod, ZipWriter};

use crate::export::{ExportError, checked_values, from_the_top, positions, unique_names};
use crate::labels;
use crate::scan::{Channel, Scan};

/// Bytes that are put into an archive at a time.
#[cfg(feature = "archives")]
const PIECE: usize = 1 << 20;

/// The bytes of a `.npz` archive: one array of doubles per channel, with a text of the same name;
/// `x_nm` and `y_nm`, the positions of columns and lines, where all channels share them.
///
/// # Errors
/// - There is no channel.
/// - A channel's samples do not fill its lines.
#[cfg(feature = "archives")]
pub fn npz(scan: &Scan, log: &[String]) -> Result<Vec<u8>, ExportError> {
    npz_between(scan, log, &|| ())
}

/// The same; `between` is called before each line and each array.
#[cfg(feature = "archives")]
pub(crate) fn npz_between(
    scan: &Scan,
    log: &[String],
    between: &dyn Fn(),
) -> Result<Vec<u8>, ExportError> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // Without a date, so that the same scan gives the same bytes.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(zip::DateTime::default())
        .large_file(true);
    let mut entries = Vec::new();
    let mut texts = Vec::new();
    for (name, channel) in unique_names(scan)?.into_iter().zip(&scan.channels) {
        let values = checked_values(channel)?;
        let lines = from_the_top(&values, channel, between);
        let top_first: Vec<f64> = lines.flatten().copied().collect();
        let shape = format!("({}, {})", channel.rows, channel.columns);
        entries.push((format!("{name}.npy"), npy(&shape, &top_first)));
        texts.push((
            format!("{name}.txt"),
            labels::text(scan, channel, log).into_bytes(),
        ));
    }
    if let Some([x, mut y]) = common_positions(scan) {
        y.reverse();
        for (name, values) in [("x_nm", x), ("y_nm", y)] {
            let shape = format!("({},)", values.len());
            entries.push((format!("{name}.npy"), npy(&shape, &values)));
        }
    }
    for (name, content) in entries.iter().chain(&texts) {
        zip.start_file(name.as_str(), options)
            .map_err(|e| ExportError::Library(e.to_string()))?;
        for piece in content.chunks(PIECE) {
            between();
            zip.write_all(piece)
                .map_err(|e| ExportError::Library(e.to_string()))?;
        }
    }
    let finished = zip.finish();
    Ok(finished
        .map_err(|e| ExportError::Library(e.to_string()))?
        .into_inner())
}

/// The positions of columns and of lines from the bottom, if all channels have the same.
fn common_positions(scan: &Scan) -> Option<[Vec<f64>; 2]> {
    let first = positions(scan, scan.channels.first()?)?;
    let same = |c: &Channel| positions(scan, c).as_ref() == Some(&first);
    scan.channels[1..].iter().all(same).then_some(first)
}

/// An array of doubles, version 1.0.
fn npy(shape: &str, values: &[f64]) -> Vec<u8> {
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    // The samples begin at a multiple of 64 bytes; the header ends with a line feed.
    let length = (10 + header.len() + 1).next_multiple_of(64) - 10;
    while header.len() < length - 1 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\0".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

/// The bytes of a TIFF file: one picture of single-precision values per channel, with a resolution
/// in samples per nm (as `ImageJ` reads it) and a description in ASCII.
///
/// # Errors
/// - There is no channel.
/// - A channel's samples do not fill its lines.
/// - The file would be longer than 4 GB.
#[cfg(feature = "pictures")]
pub fn tiff(scan: &Scan, log: &[String]) -> Result<Vec<u8>, ExportError> {
    tiff_between(scan, log, &|| ())
}

/// The same; `between` is called before each line.
#[cfg(feature = "pictures")]
pub(crate) fn tiff_between(
    scan: &Scan,
    log: &[String],
    between: &dyn Fn(),
) -> Result<Vec<u8>, ExportError> {
    if scan.channels.is_empty() {
        return Err(ExportError::NoChannel);
    }
    let words = |error: tiff::TiffError| ExportError::Library(error.to_string());
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).map_err(words)?;
    let pictures = scan.channels.len();
    for channel in &scan.channels {
        let values = checked_values(channel)?;
        let lines = from_the_top(&values, channel, between);
        let top_first: Vec<f32> = lines.flatten().map(|&value| value as f32).collect();
        let count = |n: usize| u32::try_from(n).map_err(|_| ExportError::TooLong);
        let mut image = encoder
            .new_image::<Gray32Float>(count(channel.columns)?, count(channel.rows)?)
            .map_err(words)?;
        let mut description = "ImageJ=1.53\n".to_owned();
        if pictures > 1 {
            // Writing to a string cannot fail.
            let _ = writeln!(description, "images={pictures}\nslices={pictures}");
        }
        if let Some(pitch) = channel.pitch_nm() {
            description.push_str("unit=nm\n");
            image.resolution_unit(ResolutionUnit::None);
            image.x_resolution(per_nm(pitch[0]));
            image.y_resolution(per_nm(pitch[1]));
        }
        description.push_str(&labels::to_ascii(&labels::text(scan, channel, log)));
        image
            .encoder()
            .write_tag(Tag::ImageDescription, description.as_str())
            .map_err(words)?;
        image.write_data(&top_first).map_err(words)?;
    }
    Ok(bytes.into_inner())
}

/// 1/pitch as a fraction of 32-bit numbers, as exact as they allow.
#[cfg(feature = "pictures")]
fn per_nm(pitch: f64) -> Rational {
    let most = f64::from(u32::MAX);
    // The larger of the two numbers fills its bits.
    let d = if pitch > 1.0 {
        most
    } else {
        (most * pitch).floor().max(1.0)
    };
    let n = (d / pitch).round().clamp(1.0, most);
    Rational {
        n: n as u32,
        d: d as u32,
    }
}

/// The text of a matrix: comments that Gwyddion understands and further ones, then the lines from the
/// top, values separated by commas; `nan` is missing.
///
/// # Errors
/// A channel's samples do not fill its lines.
pub fn csv(scan: &Scan, channel: &Channel, log: &[String]) -> Result<Vec<u8>, ExportError> {
    csv_between(scan, channel, log, &|| ())
}

/// The same; `between` is called before each line.
pub(crate) fn csv_between(
    scan: &Scan,
    channel: &Channel,
    log: &[String],
    between: &dyn Fn(),
) -> Result<Vec<u8>, ExportError> {
    let values = checked_values(channel)?;
    let mut text = String::new();
    // Writing to a string cannot fail.
    for line in labels::text(scan, channel, log).lines() {
        let _ = writeln!(text, "# {line}");
    }
    for row in from_the_top(&values, channel, between) {
        for (index, value) in row.iter().enumerate() {
            let comma = if index > 0 { "," } else { "" };
            let _ = if value.is_nan() {
                write!(text, "{comma}nan")
            } else {
                // The shortest digits that read back as the same number.
                write!(text, "{comma}{value:?}")
            };
        }
        text.push('\n');
    }
    Ok(text.into_bytes())
}
