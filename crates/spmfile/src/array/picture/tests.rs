//! Pictures that libraries made, and some coded by hand.

use super::*;
use tiff::encoder::{TiffEncoder, colortype};

fn decoded(plane: &Plane<'_>) -> Unpacked {
    let Stored::Packed(unpack) = &plane.samples else {
        panic!("pictures are packed");
    };
    unpack().ok().expect("samples")
}

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
        let unpacked = decoded(&png(bytes).expect("a picture"));
        assert!(!unpacked.rendering);
        unpacked.samples
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
        decoded(&planes.remove(1)).samples
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
    assert_eq!((plane.rows, plane.columns), (16, 8));
    let unpacked = decoded(&plane);
    assert!(!unpacked.rendering);
    let Samples::I16(values) = unpacked.samples else {
        panic!("bytes");
    };
    assert!(values[..64].iter().all(|&v| v == 148), "{values:?}");
    assert!(values[64..].iter().all(|&v| v == 138), "{values:?}");
    let mut large = bytes.clone();
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
    let cut = &whole[..whole.len() - 20];
    assert!(png(cut).is_ok() && png_samples(cut).is_err());
    assert!(png(&whole[..20]).is_err());
    // A width of 2³¹ − 1 pixels in a file of some bytes.
    let mut wide = whole.clone();
    wide[16..20].copy_from_slice(&0x7fff_ffffu32.to_be_bytes());
    assert!(png_samples(&wide).is_err());
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

/// A picture of two colours with a palette of a number of bytes.
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
