//! Pictures: PNG, JPEG and TIFF, decoded by libraries under limits of memory.

use std::io::Cursor as Bytes;

use png::{ColorType, Transformations};
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use super::plane::{Plane, turn};
use crate::archive::unpacked_limit;
use crate::cursor::Endian;
use crate::labels;
use crate::raster::{self, Encoding, Order};
use crate::scan::Samples;
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

/// Reads a PNG picture, 8 or 16 bits deep.
pub(super) fn png(bytes: &[u8]) -> Result<Plane, String> {
    #[cfg(test)]
    crate::seeds::keep(bytes);
    let limit = unpacked_limit(bytes.len());
    let mut decoder = png::Decoder::new_with_limits(
        Bytes::new(bytes),
        png::Limits {
            bytes: limit as usize,
        },
    );
    // Palettes into colours, fewer bits than eight into eight.
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|e| e.to_string())?;
    let palette = reader.info().palette.as_deref().unwrap_or_default().len();
    if palette % 3 != 0 || palette > 3 * 256 {
        return Err(format!(
            "expected a palette of three bytes for each of up to 256 colours, found {palette} bytes"
        ));
    }
    let length = reader
        .output_buffer_size()
        .filter(|&length| length as u64 <= limit)
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
            return Ok(plane(rows, columns, samples, false));
        }
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb => 3,
        ColorType::Rgba => 4,
        ColorType::Indexed => return Err("expected colours, found a palette".to_owned()),
    };
    // One line as long as all lines together: nothing is turned yet.
    let count = buffer.len() / encoding.width();
    let pixels = raster::decode(buffer, count, encoding, Endian::Big, Order::default());
    let mut plane = luminance(rows, columns, per_pixel, &pixels)?;
    plane.samples = turned(plane.samples, columns);
    Ok(plane)
}

/// Reads a JPEG picture as its luminance.
pub(super) fn jpeg(bytes: &[u8]) -> Result<Plane, String> {
    #[cfg(test)]
    crate::seeds::keep(bytes);
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
    let coloured = decoder.input_colorspace() != Some(ColorSpace::Luma);
    let pixels = decoder.decode().map_err(|e| e.to_string())?;
    if pixels.len() != rows * columns {
        return Err(format!(
            "expected {} grey values, found {}",
            rows * columns,
            pixels.len()
        ));
    }
    let samples = raster::decode(&pixels, columns, Encoding::U8, Endian::Big, TOP_FIRST);
    Ok(plane(rows, columns, samples, coloured))
}

/// Reads every picture of a TIFF file.
pub(super) fn tiff(bytes: &[u8]) -> Result<Vec<Plane>, String> {
    #[cfg(test)]
    crate::seeds::keep(bytes);
    let words = |error: tiff::TiffError| error.to_string();
    let mut left = unpacked_limit(bytes.len()) as usize;
    let mut decoder = Decoder::new(Bytes::new(bytes)).map_err(words)?;
    let mut planes = Vec::new();
    loop {
        let mut limits = Limits::default();
        limits.decoding_buffer_size = left;
        limits.intermediate_buffer_size = left;
        limits.ifd_value_size = bytes.len().max(1 << 20);
        decoder = decoder.with_limits(limits);
        let plane = tiff_page(&mut decoder)?;
        left = left.saturating_sub(8 * plane.samples.len());
        planes.push(plane);
        if !decoder.more_images() {
            return Ok(planes);
        }
        if planes.len() == MOST_CHANNELS {
            return Err(format!("it holds more than {MOST_CHANNELS} pictures"));
        }
        decoder.next_image().map_err(words)?;
    }
}

fn tiff_page(decoder: &mut Decoder<Bytes<&[u8]>>) -> Result<Plane, String> {
    use tiff::ColorType;
    let words = |error: tiff::TiffError| error.to_string();
    let (width, height) = decoder.dimensions().map_err(words)?;
    let (rows, columns) = (height as usize, width as usize);
    let per_pixel = match decoder.colortype().map_err(words)? {
        ColorType::Gray(_) | ColorType::Multiband { num_samples: 1, .. } => 1,
        ColorType::GrayA(_) => 2,
        ColorType::RGB(_) => 3,
        ColorType::RGBA(_) => 4,
        other => {
            return Err(format!(
                "expected grey values or red, green, blue, found {other:?}"
            ));
        }
    };
    let mut tag = |tag: Tag| decoder.find_tag_unsigned::<u16>(tag).map_err(words);
    if per_pixel > 1 && tag(Tag::PlanarConfiguration)?.unwrap_or(1) != 1 {
        return Err("expected colours side by side, found one plane for each".to_owned());
    }
    // Where the first pixel lies: top left, top right, bottom right, bottom left.
    let (top, left) = match tag(Tag::Orientation)?.unwrap_or(1) {
        1 => (true, true),
        2 => (true, false),
        3 => (false, false),
        4 => (false, true),
        other => return Err(format!("expected orientation 1 to 4, found {other}")),
    };
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
    let description = decoder.get_tag_ascii_string(Tag::ImageDescription);
    let carried = labels::lines(&labels::from_ascii(&description.unwrap_or_default()));
    let mut plane = luminance(rows, columns, per_pixel, &pixels)?;
    if labels::fits(&carried, [rows, columns]) {
        plane.carried = carried;
    }
    if top {
        plane.samples = turned(plane.samples, columns);
    }
    if !left {
        plane.samples = mirrored(plane.samples, columns);
    }
    Ok(plane)
}

fn plane(rows: usize, columns: usize, samples: Samples, rendering: bool) -> Plane {
    Plane {
        rows,
        columns,
        samples,
        rendering,
        carried: Vec::new(),
    }
}

/// The luminance of pixels of one to four values (grey or colours, then opacity), lines as they
/// come. Grey pixels keep their values, also where they are written as colours.
fn luminance(
    rows: usize,
    columns: usize,
    per_pixel: usize,
    pixels: &Samples,
) -> Result<Plane, String> {
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
                $(Samples::$kind(v) if per_pixel == 1 => (Samples::$kind(v.clone()), false),)*
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
    Ok(plane(rows, columns, samples, rendering))
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
mod tests {
    use super::*;
    use tiff::encoder::{TiffEncoder, colortype};

    fn png_of(color: ColorType, depth: png::BitDepth, width: u32, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, 2);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if color == ColorType::Indexed {
            encoder.set_palette(vec![10, 10, 10, 30, 30, 30]);
        }
        let mut writer = encoder.write_header().expect("memory");
        writer.write_image_data(data).expect("memory");
        writer.finish().expect("memory");
        bytes
    }

    #[test]
    fn grey_pngs_keep_their_values() {
        use png::BitDepth::{Eight, One, Sixteen};
        let samples = |bytes: &[u8]| {
            let plane = png(bytes).expect("a picture");
            assert!(!plane.rendering);
            plane.samples
        };
        let grey = png_of(ColorType::Grayscale, Eight, 2, &[1, 2, 3, 255]);
        assert_eq!(samples(&grey), Samples::I16(vec![3, 255, 1, 2]));
        let deep = png_of(ColorType::Grayscale, Sixteen, 1, &[1, 0, 255, 255]);
        assert_eq!(samples(&deep), Samples::I32(vec![65535, 256]));
        let opaque = png_of(ColorType::GrayscaleAlpha, Eight, 1, &[7, 255, 9, 0]);
        assert_eq!(samples(&opaque), Samples::I16(vec![9, 7]));
        let coded = png_of(ColorType::Indexed, One, 2, &[0b0100_0000, 0b1100_0000]);
        assert_eq!(samples(&coded), Samples::I16(vec![30, 30, 10, 30]));
    }

    #[test]
    fn colours_become_luminance() {
        let red_and_blue = [200, 0, 0, 0, 0, 100];
        let bytes = png_of(ColorType::Rgb, png::BitDepth::Eight, 1, &red_and_blue);
        let scan = crate::read(&bytes).expect("a picture");
        let values = scan.channels[0].values();
        assert!((values[0] - 11.4).abs() < 1e-5 && (values[1] - 59.8).abs() < 1e-5);
        let (key, note) = &scan.metadata[0];
        assert!(key == "rendering" && note.contains("luminance"), "{note}");
    }

    #[test]
    fn tiffs_of_every_kind_of_number() {
        fn made<C: colortype::ColorType>(data: &[C::Inner]) -> Samples
        where
            [C::Inner]: tiff::encoder::TiffValue,
        {
            let mut bytes = Bytes::new(Vec::new());
            let mut encoder = TiffEncoder::new(&mut bytes).expect("memory");
            for _ in 0..2 {
                encoder.write_image::<C>(2, 2, data).expect("memory");
            }
            let mut planes = tiff(bytes.get_ref()).expect("pictures");
            assert_eq!(planes.len(), 2);
            planes.remove(1).samples
        }
        assert_eq!(
            made::<colortype::Gray8>(&[1, 2, 3, 255]),
            Samples::I16(vec![3, 255, 1, 2])
        );
        assert_eq!(
            made::<colortype::Gray16>(&[1, 2, 3, 65535]),
            Samples::I32(vec![3, 65535, 1, 2])
        );
        let large = f64::from(u32::MAX);
        assert_eq!(
            made::<colortype::Gray32>(&[1, 2, 3, u32::MAX]),
            Samples::F64(vec![3.0, large, 1.0, 2.0])
        );
        assert_eq!(
            made::<colortype::Gray32Float>(&[1.5, 2.0, -3.0, 4.0]),
            Samples::F32(vec![-3.0, 4.0, 1.5, 2.0])
        );
        let grey = [1u8, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4];
        assert_eq!(
            made::<colortype::RGB8>(&grey),
            Samples::I16(vec![3, 4, 1, 2])
        );
    }

    /// Two blocks of 8 × 8 pixels, one above the other, coded by hand (ITU-T T.81, annexes B and F).
    ///
    /// Every quantum is 8, so that a block of nothing but the coefficient `c` has the value 128 + `c`.
    /// The one code for coefficients is a 0 bit, for differences of four bits; so is the one for the
    /// end of a block. Each block has the difference 10 to the one before.
    fn grey_jpeg() -> Vec<u8> {
        let segment = |mark: u8, content: &[u8]| {
            let length = (content.len() as u16 + 2).to_be_bytes();
            [&[0xff, mark], &length[..], content].concat()
        };
        let one_code = |class: u8, value: u8| {
            let mut table = vec![class, 1];
            table.extend([0; 15]);
            table.push(value);
            segment(0xc4, &table)
        };
        [
            vec![0xff, 0xd8],
            segment(0xdb, &[&[0], &[8; 64][..]].concat()),
            segment(0xc0, &[8, 0, 16, 0, 8, 1, 1, 0x11, 0]),
            one_code(0, 4),
            one_code(0x10, 0),
            segment(0xda, &[1, 1, 0, 0, 63, 0]),
            // 0 1010 0, 0 1010 0, filled up with ones.
            vec![0b0101_0001, 0b0100_1111, 0xff, 0xd9],
        ]
        .concat()
    }

    #[test]
    fn grey_jpegs_keep_their_values() {
        let bytes = grey_jpeg();
        let plane = jpeg(&bytes).expect("a picture");
        assert_eq!((plane.rows, plane.columns, plane.rendering), (16, 8, false));
        let Samples::I16(values) = plane.samples else {
            panic!("bytes");
        };
        assert!(values[..64].iter().all(|&v| v == 148), "{values:?}");
        assert!(values[64..].iter().all(|&v| v == 138), "{values:?}");
        let mut large = bytes;
        let size = large
            .windows(2)
            .position(|w| w == [0xff, 0xc0])
            .expect("a size");
        large[size + 5..size + 9].fill(0xff);
        let error = jpeg(&large).err().expect("too large");
        assert!(error.contains("too many"), "{error}");
    }

    #[test]
    fn damaged_pictures() {
        let whole = png_of(ColorType::Grayscale, png::BitDepth::Eight, 2, &[1, 2, 3, 4]);
        assert!(png(&whole[..whole.len() / 2]).is_err());
        // A width of 2³¹ − 1 pixels in a file of some bytes.
        let mut wide = whole.clone();
        wide[16..20].copy_from_slice(&0x7fff_ffffu32.to_be_bytes());
        assert!(png(&wide).is_err());
        assert!(jpeg(b"\xff\xd8\xff\xe0\0\x10JFIF").is_err());
        assert!(tiff(b"II*\0\x08\0\0\0\0\0").is_err());
    }

    /// CRC-32 as the chunks of a PNG file have it.
    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
                (crc >> 1) ^ (0xedb8_8320 & 0u32.wrapping_sub(crc & 1))
            })
        })
    }

    /// A picture of two colours whose palette has so many bytes.
    fn indexed(palette: usize) -> Vec<u8> {
        let mut whole = Vec::new();
        let mut encoder = png::Encoder::new(&mut whole, 2, 2);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_palette(vec![0, 0, 0, 200, 200, 200]);
        let mut writer = encoder.write_header().expect("a header");
        writer.write_image_data(&[0, 1, 1, 0]).expect("an image");
        writer.finish().expect("an end");
        let at = whole
            .windows(4)
            .position(|w| w == b"PLTE")
            .expect("a palette");
        let mut chunk = b"PLTE".to_vec();
        chunk.extend((0..palette).map(|i| (i * 40) as u8));
        let sum = crc(&chunk);
        let mut changed = whole[..at - 4].to_vec();
        changed.extend((palette as u32).to_be_bytes());
        changed.extend(&chunk);
        changed.extend(sum.to_be_bytes());
        changed.extend(&whole[at + 4 + 6 + 4..]);
        changed
    }

    /// Found by fuzzing: the library stumbles over such a palette.
    #[test]
    fn broken_palettes_are_refused() {
        assert_eq!(super::png(&indexed(6)).expect("two colours").rows, 2);
        for broken in [5, 148] {
            let error = super::png(&indexed(broken)).err().expect("no palette");
            assert!(error.contains(&format!("found {broken} bytes")), "{error}");
        }
        for broken in [1, 3 * 257] {
            assert!(super::png(&indexed(broken)).is_err());
        }
    }
}
