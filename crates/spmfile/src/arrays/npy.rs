//! The array format of `NumPy`, versions 1 to 3.
//!
//! In: the bytes of a file; out: an image. The header is a Python dictionary of three keys
//! (`numpy.lib.format`), read here by its keys rather than as Python.

use super::plane::Plane;
use crate::cursor::{Cursor, Endian};
use crate::raster::{self, Encoding, Order};

const MAGIC: &[u8] = b"\x93NUMPY";

/// Reads an array of two dimensions, not counting those of length 1 where there are more.
pub(super) fn read(bytes: &[u8]) -> Result<Plane, String> {
    #[cfg(test)]
    crate::seeds::keep(bytes);
    let mut cursor = Cursor::new(bytes, Endian::Little);
    if cursor.slice(MAGIC.len(), "the mark of an array")? != MAGIC {
        return Err("expected the mark of an array, found other bytes".to_owned());
    }
    let major = cursor.u8()?;
    cursor.skip(1)?;
    let length = match major {
        1 => usize::from(cursor.u16()?),
        2 | 3 => cursor.u32()? as usize,
        other => return Err(format!("expected version 1, 2 or 3, found {other}")),
    };
    let header = String::from_utf8_lossy(cursor.slice(length, "a header")?);
    let kind = kind(&header)?;
    let [rows, columns] = shape(&header)?;
    let fortran = value(&header, "fortran_order")?.starts_with("True");
    let samples = rows.checked_mul(columns).filter(|&n| n > 0);
    let length = samples
        .and_then(|n| n.checked_mul(kind.width))
        .ok_or_else(|| format!("its shape is {rows} × {columns}"))?;
    let left = cursor.left();
    let block = cursor.slice(length, "samples").map_err(|_| {
        format!("it holds {left} bytes of samples but its header promises {length}")
    })?;
    let ordered;
    let block = if fortran {
        ordered = transposed(block, rows, columns, kind.width);
        &ordered
    } else {
        block
    };
    let wider;
    let (block, endian) = if kind.half {
        wider = singles(block, kind.endian);
        (&*wider, Endian::Little)
    } else {
        (block, kind.endian)
    };
    let order = Order {
        top_first: true,
        mirrored: false,
    };
    Ok(Plane {
        rows,
        columns,
        samples: raster::decode(block, columns, kind.encoding, endian, order),
        rendering: false,
        carried: Vec::new(),
    })
}

/// How the samples are stored.
struct Kind {
    encoding: Encoding,
    endian: Endian,
    /// Bytes per sample in the file.
    width: usize,
    /// Half precision, which is widened first.
    half: bool,
}

/// The text behind a key of the header.
fn value<'a>(header: &'a str, key: &str) -> Result<&'a str, String> {
    let found = ['\'', '"'].iter().find_map(|quote| {
        let (_, rest) = header.split_once(&format!("{quote}{key}{quote}"))?;
        rest.trim_start().strip_prefix(':')
    });
    let value = found.ok_or_else(|| format!("expected {key:?} in its header, found none"))?;
    Ok(value.trim_start())
}

fn kind(header: &str) -> Result<Kind, String> {
    let value = value(header, "descr")?;
    let descr: String = value
        .strip_prefix(['\'', '"'])
        .map(|rest| {
            rest.chars()
                .take_while(|c| !matches!(c, '\'' | '"'))
                .collect()
        })
        .ok_or("expected numbers, found records of several fields")?;
    let (order, kind) = descr.split_at_checked(1).unwrap_or(("", ""));
    let endian = match order {
        "<" | "|" | "=" => Endian::Little,
        ">" => Endian::Big,
        _ => return Err(format!("expected an order of bytes, found {descr:?}")),
    };
    let encoding = match kind {
        "b1" | "u1" => Encoding::U8,
        "i1" => Encoding::I8,
        "i2" => Encoding::I16,
        "u2" => Encoding::U16,
        "i4" => Encoding::I32,
        "u4" => Encoding::U32,
        "i8" => Encoding::I64,
        "u8" => Encoding::U64,
        "f2" | "f4" => Encoding::F32,
        "f8" => Encoding::F64,
        _ => return Err(format!("expected real numbers, found the type {descr:?}")),
    };
    let half = kind == "f2";
    Ok(Kind {
        encoding,
        endian,
        width: if half { 2 } else { encoding.width() },
        half,
    })
}

/// Lines and samples.
fn shape(header: &str) -> Result<[usize; 2], String> {
    let text = value(header, "shape")?;
    let inner = text
        .strip_prefix('(')
        .and_then(|rest| rest.split_once(')'))
        .map(|(inner, _)| inner)
        .ok_or("expected a shape in brackets, found none")?;
    let axes: Option<Vec<usize>> = inner
        .split(',')
        .map(str::trim)
        .filter(|axis| !axis.is_empty())
        // Python 2 wrote long integers with an L.
        .map(|axis| axis.trim_end_matches('L').parse().ok())
        .collect();
    let axes =
        axes.ok_or_else(|| format!("expected whole numbers in its shape, found {inner:?}"))?;
    if let [rows, columns] = axes[..] {
        return Ok([rows, columns]);
    }
    let long: Vec<usize> = axes.iter().copied().filter(|&n| n != 1).collect();
    match long[..] {
        [rows, columns] if axes.len() > 2 => Ok([rows, columns]),
        _ => Err(format!(
            "expected an array of two dimensions, found the shape ({inner})"
        )),
    }
}

/// An array stored column by column, line by line.
fn transposed(block: &[u8], rows: usize, columns: usize, width: usize) -> Vec<u8> {
    let mut lines = Vec::with_capacity(block.len());
    for row in 0..rows {
        for column in 0..columns {
            let start = (column * rows + row) * width;
            lines.extend_from_slice(&block[start..start + width]);
        }
    }
    lines
}

/// Half-precision numbers as single-precision ones, little endian (IEEE 754).
fn singles(block: &[u8], endian: Endian) -> Vec<u8> {
    let (pairs, _) = block.as_chunks::<2>();
    pairs
        .iter()
        .flat_map(|&pair| {
            let bits = match endian {
                Endian::Little => u16::from_le_bytes(pair),
                Endian::Big => u16::from_be_bytes(pair),
            };
            single(bits).to_le_bytes()
        })
        .collect()
}

fn single(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let exponent = i32::from(bits >> 10 & 0x1f);
    let fraction = f32::from(bits & 0x3ff);
    match exponent {
        0 => sign * fraction * 2f32.powi(-24),
        31 if fraction == 0.0 => sign * f32::INFINITY,
        31 => f32::NAN,
        _ => sign * (1024.0 + fraction) * 2f32.powi(exponent - 25),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::Samples;

    fn array(version: u8, header: &str, samples: &[u8]) -> Vec<u8> {
        let mut bytes = [MAGIC, &[version, 0]].concat();
        if version == 1 {
            bytes.extend((header.len() as u16).to_le_bytes());
        } else {
            bytes.extend((header.len() as u32).to_le_bytes());
        }
        [&bytes, header.as_bytes(), samples].concat()
    }

    fn header(descr: &str, fortran: &str, shape: &str) -> String {
        format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}     \n")
    }

    #[test]
    fn orders_of_axes_and_bytes() {
        let samples: Vec<u8> = (0..6i16).flat_map(i16::to_be_bytes).collect();
        let plane = read(&array(1, &header(">i2", "False", "(2, 3)"), &samples));
        let plane = plane.expect("an image");
        assert_eq!((plane.rows, plane.columns), (2, 3));
        assert_eq!(plane.samples, Samples::I16(vec![3, 4, 5, 0, 1, 2]));
        let plane = read(&array(2, &header(">i2", "True", "(2L, 3L)"), &samples));
        assert_eq!(
            plane.expect("an image").samples,
            Samples::I16(vec![1, 3, 5, 0, 2, 4])
        );
        let plane = read(&array(3, &header(">i2", "False", "(1, 3, 2, 1)"), &samples));
        let plane = plane.expect("an image");
        assert_eq!((plane.rows, plane.columns), (3, 2));
    }

    /// Values from the table of examples of binary16 in IEEE 754-2008.
    #[test]
    fn half_precision() {
        for (bits, value) in [
            (0x0001, 2f32.powi(-24)),
            (0x03ff, 1023.0 * 2f32.powi(-24)),
            (0x0400, 2f32.powi(-14)),
            (0x3555, 0.333_251_95),
            (0x3c00, 1.0),
            (0x7bff, 65504.0),
            (0xc000, -2.0),
            (0xfc00, f32::NEG_INFINITY),
        ] {
            assert_eq!(single(bits), value);
        }
        assert!(single(0x7e00).is_nan());
        let plane = read(&array(
            1,
            &header("<f2", "False", "(1, 2)"),
            &[0, 0x3c, 0, 0xc0],
        ));
        assert_eq!(
            plane.expect("an image").samples,
            Samples::F32(vec![1.0, -2.0])
        );
    }

    #[test]
    fn what_is_not_read_is_said() {
        let error = |descr: &str, shape: &str, n: usize| {
            let bytes = array(1, &header(descr, "False", shape), &vec![0; n]);
            read(&bytes).err().expect("no image")
        };
        assert!(error("<f8", "(2, 3)", 47).contains("47"));
        assert!(error("<c16", "(2, 3)", 96).contains("c16"));
        assert!(error("|O", "(2, 3)", 96).contains('O'));
        assert!(error("<f8", "(6,)", 48).contains("two dimensions"));
        assert!(error("<f8", "(2, 3, 4)", 192).contains("two dimensions"));
        assert!(error("<f8", "(0, 3)", 0).contains("0 × 3"));
        assert!(error("<f8", "(99999999999, 99999999999)", 0).contains("99999999999"));
        assert!(error("<f8", "(-1, 3)", 0).contains("whole numbers"));
        let fields = "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1, 1)}";
        assert!(read(&array(1, fields, &[0; 8])).is_err());
        assert!(read(&array(1, "{}", &[])).is_err());
        assert!(read(&array(9, "{}", &[])).is_err());
        assert!(read(b"\x93NUMPY\x01\0\xff\xff").is_err());
    }
}
