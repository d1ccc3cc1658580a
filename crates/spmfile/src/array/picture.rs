//! Pictures: PNG, JPEG and TIFF, decoded by libraries under limits of memory.

use std::io::Cursor as Bytes;

use png::{ColorType, Transformations};
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use super::calibration;
use super::plane::{Plane, Trouble, turn};
use crate::cursor::Endian;
use crate::labels;
use crate::limits::{MOST_GAIN, unpacked_limit};
use crate::raster::{self, Encoding, Order};
use crate::scan::Samples;
use crate::stored::{Failure, Stored, Unpacked};
use crate::tiff_tags::directories;
use crate::whole::MOST_CHANNELS;

/// Shares of red, green and blue in the luminance (ITU-R BT.601, as in JPEG).
const LUMINANCE: [f64; 3] = [0.299, 0.587, 0.114];
/// A JPEG file holds no more pixels than this per byte, unless it is small anyway.
const JPEG_PIXELS_PER_BYTE: usize = 200;
const JPEG_PIXELS_ALWAYS_ALLOWED: usize = 4 << 20;

const TOP_FIRST: Order = Order {
    top_first: true,
    mirrored: false,
};

/// Finds the picture of a PNG file, 8 or 16 bits deep.
pub(super) fn png(bytes: &[u8]) -> Result<Plane<'_>, String> {
    let reader = png_reader(bytes)?;
    let (columns, rows) = reader.info().size();
    Ok(plane("PNG", rows, columns, move || png_samples(bytes)))
}

fn png_reader(bytes: &[u8]) -> Result<png::Reader<Bytes<&[u8]>>, String> {
    let limit = unpacked_limit(bytes.len());
    let mut decoder = png::Decoder::new_with_limits(
        Bytes::new(bytes),
        png::Limits {
            bytes: limit as usize,
        },
    );
    // Palettes into colours, fewer bits than eight into eight.
    decoder.set_transformations(Transformations::EXPAND);
    let reader = decoder.read_info().map_err(|e| e.to_string())?;
    let palette = reader.info().palette.as_deref().unwrap_or_default().len();
    if palette % 3 != 0 || palette > 3 * 256 {
        return Err(format!(
            "expected a palette of three bytes for each of up to 256 colours, found {palette} bytes"
        ));
    }
    Ok(reader)
}

fn png_samples(bytes: &[u8]) -> Result<Unpacked, String> {
    let mut reader = png_reader(bytes)?;
    let length = reader
        .output_buffer_size()
        .filter(|&length| length as u64 <= unpacked_limit(bytes.len()))
        .ok_or("it would take too much memory for its length")?;
    let mut buffer = vec![0; length];
    let info = reader.next_frame(&mut buffer).map_err(|e| e.to_string())?;
    let buffer = &buffer[..info.buffer_size()];
    let (rows, columns) = (info.height as usize, info.width as usize);
    let encoding = match info.bit_depth {
        png::BitDepth::Sixteen => Encoding::U16,
        _ => Encoding::U8,
    };
    let per_pixel = match info.color_type {
        ColorType::Grayscale => {
            let samples = raster::decode(buffer, columns, encoding, Endian::Big, TOP_FIRST);
            return Ok(Unpacked::measured(samples));
        }
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb => 3,
        ColorType::Rgba => 4,
        ColorType::Indexed => return Err("expected colours, found a palette".to_owned()),
    };
    // One line as long as all lines together: nothing is turned yet.
    let count = buffer.len() / encoding.width();
    let pixels = raster::decode(buffer, count, encoding, Endian::Big, Order::default());
    let mut unpacked = luminance(rows, columns, per_pixel, pixels)?;
    unpacked.samples = turned(unpacked.samples, columns);
    Ok(unpacked)
}

/// Finds the picture of a JPEG file, which is read as its luminance.
pub(super) fn jpeg(bytes: &[u8]) -> Result<Plane<'_>, String> {
    let (_, [rows, columns]) = jpeg_decoder(bytes)?;
    let samples = move || jpeg_samples(bytes);
    Ok(plane("JPEG", rows as u32, columns as u32, samples))
}

type Jpeg<'a> = JpegDecoder<ZCursor<&'a [u8]>>;

/// A decoder that has read the headers, and the rows and columns.
fn jpeg_decoder(bytes: &[u8]) -> Result<(Jpeg<'_>, [usize; 2]), String> {
    let options = DecoderOptions::default()
        .set_max_width(usize::from(u16::MAX))
        .set_max_height(usize::from(u16::MAX))
        .jpeg_set_out_colorspace(ColorSpace::Luma);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| e.to_string())?;
    let info = decoder.info().ok_or("expected a size, found none")?;
    let (rows, columns) = (usize::from(info.height), usize::from(info.width));
    let most = JPEG_PIXELS_ALWAYS_ALLOWED.max(bytes.len().saturating_mul(JPEG_PIXELS_PER_BYTE));
    if rows * columns > most {
        return Err(format!(
            "its size is {rows} × {columns} pixels, too many for {} bytes",
            bytes.len()
        ));
    }
    Ok((decoder, [rows, columns]))
}

fn jpeg_samples(bytes: &[u8]) -> Result<Unpacked, String> {
    let (mut decoder, [rows, columns]) = jpeg_decoder(bytes)?;
    let coloured = decoder.input_colorspace() != Some(ColorSpace::Luma);
    let pixels = decoder.decode().map_err(|e| e.to_string())?;
    if pixels.len() != rows * columns {
        return Err(format!(
            "expected {} grey values, found {}",
            rows * columns,
            pixels.len()
        ));
    }
    Ok(Unpacked {
        samples: raster::decode(&pixels, columns, Encoding::U8, Endian::Big, TOP_FIRST),
        rendering: coloured,
    })
}

/// Finds every picture of a TIFF file.
pub(super) fn tiff(bytes: &[u8]) -> Result<Vec<Plane<'_>>, Trouble> {
    // BigTIFF is left to the library.
    let big = matches!(bytes, [b'I', b'I', 43, ..] | [b'M', b'M', _, 43, ..]);
    let pages = if big { Vec::new() } else { directories(bytes)? };
    // The library takes memory for them before it looks.
    if let Some(tag) = pages.iter().find_map(|page| page.outside) {
        return Err(format!(
            "its tag {tag} has more values than the file, of {} bytes, has room for",
            bytes.len()
        )
        .into());
    }
    let mut ome = None;
    let mut left = unpacked_limit(bytes.len()) as usize;
    let mut stored = bytes.len();
    let mut decoder = Decoder::new(Bytes::new(bytes)).map_err(words)?;
    let mut planes = Vec::new();
    decoder = decoder.with_limits(limits(0, bytes.len()));
    loop {
        let page = tiff_page(&mut decoder)?;
        // Headers that promise more than the file can hold take no memory.
        stored = stored.checked_sub(page.stored).ok_or_else(|| {
            let found = bytes.len();
            format!(
                "its pictures take at least {} bytes more than the {found} of the file",
                page.stored - stored
            )
        })?;
        let (index, allowed) = (planes.len(), page.decoded.min(left));
        let samples = move || tiff_samples(bytes, index, allowed);
        let mut plane = plane("TIFF", page.rows as u32, page.columns as u32, samples);
        let tags = pages.get(index);
        let description = tags.and_then(|tags| tags.text(Tag::ImageDescription.to_u16()));
        let description = description
            .or_else(|| decoder.get_tag_ascii_string(Tag::ImageDescription).ok())
            .unwrap_or_default();
        let carried = labels::lines(&labels::from_ascii(&description));
        if labels::fits(&carried, [page.rows, page.columns]) {
            plane.carried = carried;
        } else if labels::value(&carried, "shape").is_none() {
            ome = ome.or_else(|| calibration::ome(&description));
            let steps = ome.or_else(|| calibration::imagej(&description, tags?));
            plane.size_nm = steps.map(|[x, y]| [x * page.columns as f64, y * page.rows as f64]);
        }
        let pixels = page.rows.saturating_mul(page.columns);
        left = left.saturating_sub(pixels.saturating_mul(8));
        planes.push(plane);
        if !decoder.more_images() {
            return Ok(planes);
        }
        if planes.len() == MOST_CHANNELS {
            return Err(format!("it holds more than {MOST_CHANNELS} pictures").into());
        }
        decoder.next_image().map_err(words)?;
    }
}

/// What the library says, which tells damage from what it does not read.
fn words(error: tiff::TiffError) -> Trouble {
    match error {
        tiff::TiffError::UnsupportedError(error) => Trouble::NotRead(error.to_string()),
        error => Trouble::Damaged(error.to_string()),
    }
}

/// Memory that a picture of some bytes may take of a file of a length.
fn limits(decoded: usize, length: usize) -> Limits {
    /// A place or a length of a strip, in the file and in memory.
    const VALUE: [usize; 2] = [8, 32];
    let mut limits = Limits::default();
    limits.decoding_buffer_size = decoded.max(length / VALUE[0] * VALUE[1]);
    limits.intermediate_buffer_size = length;
    limits.ifd_value_size = length;
    limits
}

/// One picture of a TIFF file, as its tags tell.
struct Page {
    rows: usize,
    columns: usize,
    per_pixel: usize,
    /// Bytes that it is decoded to, and takes in the file at least.
    decoded: usize,
    stored: usize,
    /// Whether the first pixel is at the top, and at the left.
    top: bool,
    left: bool,
}

fn tiff_page(decoder: &mut Decoder<Bytes<&[u8]>>) -> Result<Page, Trouble> {
    use tiff::ColorType;
    let (width, height) = decoder.dimensions().map_err(words)?;
    let colours = decoder.colortype().map_err(words)?;
    let per_pixel = match colours {
        ColorType::Gray(_) | ColorType::Multiband { num_samples: 1, .. } => 1,
        ColorType::GrayA(_) => 2,
        ColorType::RGB(_) => 3,
        ColorType::RGBA(_) => 4,
        other => {
            return Err(Trouble::NotRead(format!(
                "expected grey values or red, green, blue, found {other:?}"
            )));
        }
    };
    let mut tag = |tag: Tag| decoder.find_tag_unsigned::<u16>(tag).map_err(words);
    if per_pixel > 1 && tag(Tag::PlanarConfiguration)?.unwrap_or(1) != 1 {
        return Err(Trouble::NotRead(format!(
            "expected the {per_pixel} values of a pixel side by side, found one plane for each; save the planes as \
             pictures of their own"
        )));
    }
    // Where the first pixel lies: top left, top right, bottom right, bottom left.
    let (top, left) = match tag(Tag::Orientation)?.unwrap_or(1) {
        1 => (true, true),
        2 => (true, false),
        3 => (false, false),
        4 => (false, true),
        other => {
            return Err(Trouble::NotRead(format!(
                "expected orientation 1 to 4, found {other}"
            )));
        }
    };
    let gain = match tag(Tag::Compression)?.unwrap_or(1) {
        1 => 1,
        _ => MOST_GAIN as usize,
    };
    let bits = u64::from(colours.bit_depth()) * per_pixel as u64;
    let line = (u64::from(width) * bits).div_ceil(8);
    let decoded = line.saturating_mul(height.into());
    let decoded = usize::try_from(decoded).unwrap_or(usize::MAX);
    Ok(Page {
        rows: height as usize,
        columns: width as usize,
        per_pixel,
        decoded,
        stored: decoded / gain,
        top,
        left,
    })
}

fn tiff_samples(bytes: &[u8], index: usize, allowed: usize) -> Result<Unpacked, Trouble> {
    let mut decoder = Decoder::new(Bytes::new(bytes)).map_err(words)?;
    decoder = decoder.with_limits(limits(allowed, bytes.len()));
    decoder.seek_to_image(index).map_err(words)?;
    let page = tiff_page(&mut decoder)?;
    let pixels = match decoder.read_image().map_err(words)? {
        DecodingResult::U8(v) => Samples::I16(v.into_iter().map(i16::from).collect()),
        DecodingResult::I8(v) => Samples::I16(v.into_iter().map(i16::from).collect()),
        DecodingResult::I16(v) => Samples::I16(v),
        DecodingResult::U16(v) => Samples::I32(v.into_iter().map(i32::from).collect()),
        DecodingResult::I32(v) => Samples::I32(v),
        DecodingResult::U32(v) => Samples::F64(v.into_iter().map(f64::from).collect()),
        DecodingResult::I64(v) => Samples::F64(v.into_iter().map(|n| n as f64).collect()),
        DecodingResult::U64(v) => Samples::F64(v.into_iter().map(|n| n as f64).collect()),
        DecodingResult::F16(v) => Samples::F32(v.into_iter().map(f32::from).collect()),
        DecodingResult::F32(v) => Samples::F32(v),
        DecodingResult::F64(v) => Samples::F64(v),
    };
    let columns = page.columns;
    let mut unpacked = luminance(page.rows, columns, page.per_pixel, pixels)?;
    if page.top {
        unpacked.samples = turned(unpacked.samples, columns);
    }
    if !page.left {
        unpacked.samples = mirrored(unpacked.samples, columns);
    }
    Ok(unpacked)
}

/// A picture that is decoded when it is wanted.
fn plane<'a, T: Into<Trouble>>(
    format: &'static str,
    rows: u32,
    columns: u32,
    samples: impl Fn() -> Result<Unpacked, T> + Send + Sync + 'a,
) -> Plane<'a> {
    let failed = move |trouble: T| Failure::File(trouble.into().of(format));
    let samples = move || samples().map_err(failed);
    Plane {
        rows: rows as usize,
        columns: columns as usize,
        samples: Stored::Packed(Box::new(samples)),
        carried: Vec::new(),
        size_nm: None,
    }
}

/// The luminance of pixels of one to four values (grey or colours, then opacity), lines as they
/// come. Grey pixels keep their values, also where they are written as colours.
fn luminance(
    rows: usize,
    columns: usize,
    per_pixel: usize,
    pixels: Samples,
) -> Result<Unpacked, String> {
    let count = rows.saturating_mul(columns);
    let expected = count.saturating_mul(per_pixel);
    if pixels.len() != expected || expected == 0 {
        return Err(format!(
            "expected {expected} values of pixels, found {}",
            pixels.len()
        ));
    }
    macro_rules! each {
        ($($kind:ident),*) => {
            match pixels {
                $(Samples::$kind(v) if per_pixel == 1 => (Samples::$kind(v), false),)*
                $(Samples::$kind(v) => {
                    let pixels = v.chunks_exact(per_pixel);
                    if per_pixel < 3 || pixels.clone().all(|p| p[0] == p[1] && p[1] == p[2]) {
                        (Samples::$kind(pixels.map(|p| p[0]).collect()), false)
                    } else {
                        let grey = pixels.map(|p| {
                            let shares = LUMINANCE.iter().zip(p);
                            shares.map(|(share, &value)| share * f64::from(value)).sum::<f64>() as f32
                        });
                        (Samples::F32(grey.collect()), true)
                    }
                })*
            }
        };
    }
    let (samples, rendering) = each!(I16, I32, F32, F64);
    Ok(Unpacked { samples, rendering })
}

/// Lines in the other order.
fn turned(mut samples: Samples, columns: usize) -> Samples {
    match &mut samples {
        Samples::I16(v) => turn(v, columns),
        Samples::I32(v) => turn(v, columns),
        Samples::F32(v) => turn(v, columns),
        Samples::F64(v) => turn(v, columns),
    }
    samples
}

/// The samples of each line in the other order.
fn mirrored(mut samples: Samples, columns: usize) -> Samples {
    fn mirror<T>(values: &mut [T], columns: usize) {
        values
            .chunks_exact_mut(columns.max(1))
            .for_each(<[T]>::reverse);
    }
    match &mut samples {
        Samples::I16(v) => mirror(v, columns),
        Samples::I32(v) => mirror(v, columns),
        Samples::F32(v) => mirror(v, columns),
        Samples::F64(v) => mirror(v, columns),
    }
    samples
}

#[cfg(test)]
mod tests;
